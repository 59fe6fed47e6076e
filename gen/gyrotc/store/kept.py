"""What is kept between calls, by the hash of what it depends on (`$XDG_CACHE_HOME/gyrotc`, default `~/.cache/gyrotc`).

A file is the SHA-256 of its content and then the content. What protects whom: the folder is the user's own (made with
mode 0700; one that belongs to somebody else, or that others may write, is not used), the checksum finds damage, and who
reads a content takes nothing from it but what it should hold. Whatever does not fit is thrown away and computed again.
`joblib.Memory` keeps results on disk as well, but has neither: it unpickles whatever lies there.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from ..common.errors import InputError
from ..common.opening import read_input
from .files import write_atomically

__all__ = ["clear", "folder", "held", "keep", "kept", "limit", "set_limit"]

T = TypeVar("T")

_MOST_BYTES = 2 * 10**9  # some dozens of banks of signatures, beside which diagnoses are small
_LIMIT = "limit_bytes"  # a file beside what is kept that says otherwise
_MAGIC = b"gyrotc kept\n"
_SUM_BYTES = hashlib.sha256().digest_size


def folder() -> Path:
    """Where everything is kept."""
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "gyrotc" / "kept"


def kept(name: str, content_of: Callable[[bytes], T | None]) -> T | None:
    """What was kept under a name.

    Args:
        name: Name of the file: a hash, and the kind after a point.
        content_of: Makes it of its bytes; may raise anything, or give None, where they are not what they should be.

    Returns:
        None where there is none, or where the file is not as it was written or does not hold what it should (it is
        removed).
    """
    path = folder() / name
    return _read(path, content_of) if _is_own() and path.is_file() else None


def _read(path: Path, content_of: Callable[[bytes], T | None]) -> T | None:
    try:
        data = read_input(path, "recording_mib", "what was kept")
        head, content = data[: len(_MAGIC) + _SUM_BYTES], data[len(_MAGIC) + _SUM_BYTES :]
        if head == _MAGIC + hashlib.sha256(content).digest():
            found = content_of(content)
            if found is not None:
                os.utime(path, follow_symlinks=False)
                return found
    except (InputError, OSError):
        return None
    except Exception:  # written by another program or version: reading it may raise anything
        pass
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)
    return None


def keep(name: str, content: bytes) -> None:
    """Keeps a content under a name, and drops what was not used for longest. Where that fails nothing is kept."""
    with contextlib.suppress(OSError, InputError):  # a cache that cannot be written costs time, nothing else
        if _is_own():
            write_atomically(folder() / name, _packed(content))
            _trim()


def _packed(content: bytes) -> bytes:
    return _MAGIC + hashlib.sha256(content).digest() + content


def _is_own() -> bool:
    """Whether the folder is there, is the user's and nobody else may write into it."""
    try:
        folder().mkdir(parents=True, exist_ok=True, mode=0o700)
        facts = folder().stat()
    except OSError:
        return False
    return facts.st_uid == os.geteuid() and not facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def limit() -> int:
    """Most bytes that everything may take."""
    try:
        return min(int((folder() / _LIMIT).read_text("ascii")[:20]), 10**15)
    except (OSError, ValueError):
        return _MOST_BYTES


def set_limit(most: int) -> None:
    """Keeps to another limit from now on.

    Raises:
        InputError: The folder is not there and cannot be made, or is not the user's own.
    """
    if not _is_own():
        raise InputError(str(folder()), "is not a folder that only this user may write", "such a folder")
    write_atomically(folder() / _LIMIT, f"{most}\n")
    _trim()


def held(kind: str = "*") -> tuple[int, int]:
    """How many files there are of a kind, and their bytes."""
    sizes = [path.stat().st_size for path in _files(kind)]
    return len(sizes), sum(sizes)


def clear() -> None:
    """Removes all of it."""
    for path in _files():
        path.unlink(missing_ok=True)


def _trim() -> None:
    """Drops what was not used for longest, down to the limit."""
    most = limit()
    total = 0
    for path in sorted(_files(), key=lambda p: p.stat().st_mtime, reverse=True):
        total += path.stat().st_size
        if total > most:
            path.unlink(missing_ok=True)


def _files(kind: str = "*") -> list[Path]:
    return list(folder().glob(f"*.{kind}"))
