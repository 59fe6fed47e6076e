"""Cache of results between calls, named by hashes of what they depend on.

A file is the SHA-256 of its name and content, followed by the content. Three things protect the user: the folder is his
own (made with mode 0700; one that belongs to somebody else, or that others may write, is not used); the checksum finds
damage and a content that lies under another name; and a reader takes nothing from a content but what it should hold.
A file that does not fit is removed, and its content is computed again. `joblib.Memory` has no such protection: it
unpickles whatever it finds. Objects and compiled templates are code that will run, so no reader can tell what they
should hold: for them the first two have to be enough.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import stat
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

from platformdirs import user_cache_path

from .. import __version__, _core
from ..common.errors import InputError
from ..common.inputs import read_input, runtime_folders
from .files import sha256, write_atomically
from .json_text import digest_of

_COMPUTING = ("numpy", "scipy", "pyarrow")  # libraries that a model's figures come out of


@functools.cache
def program_of() -> str:
    """Return the SHA-256 of the program: package, compiled core, C runtime, and versions of the numerical libraries."""
    here = Path(__file__).resolve().parents[1]
    parts: list[Any] = [__version__, {name: metadata.version(name) for name in _COMPUTING}]
    for folder in (here, *runtime_folders()):
        files = sorted(path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
        parts.append({path.relative_to(folder).as_posix(): sha256(path) for path in files})
    return digest_of([*parts, sha256(Path(_core.__file__))])


T = TypeVar("T")

# Some thousand compiled objects of the runtime and its tables.
_MAX_BYTES = 2 * 10**8
_MAGIC = b"gyrotc kept\n"
_HEAD_BYTES = len(_MAGIC) + hashlib.sha256().digest_size


def folder() -> Path:
    """Return the folder of the cache."""
    return user_cache_path("gyrotc", appauthor=False) / "kept"


def kept(name: str, content_of: Callable[[bytes], T | None]) -> T | None:
    """Return what was kept under a name.

    Args:
        name: Name of the file: a hash, and the kind after a point.
        content_of: Function that makes the value of its bytes; it may raise anything, or return None, if they are not
            what they should be.

    Returns:
        The value, or None if there is none; a file that is not as it was written is removed.
    """
    path = folder() / name
    if not (_is_own() and path.is_file()):
        return None
    try:
        data = read_input(path, "recording_mib", "what was kept")
        head, content = data[:_HEAD_BYTES], data[_HEAD_BYTES:]
        if head == head_of_content(path.name, content):
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
    """Keep a content under a name, and drop the least recently used. If that fails nothing is kept."""
    with contextlib.suppress(OSError, InputError):  # a cache that cannot be written costs time, nothing else
        if _is_own():
            write_atomically(folder() / name, head_of_content(name, content), content)
            _trim()


def head_of_content(name: str, content: bytes) -> bytes:
    """Return what precedes a content in its file."""
    digest = hashlib.sha256(name.encode() + b"\n")
    digest.update(content)
    return _MAGIC + digest.digest()


def _is_own() -> bool:
    """Test whether the folder exists, belongs to the user, and nobody else may write into it."""
    if not folder().is_absolute():  # of a user without a home: it would be made in the working folder
        return False
    try:
        folder().mkdir(parents=True, exist_ok=True, mode=0o700)
        facts = folder().stat()
    except OSError:
        return False
    return facts.st_uid == os.geteuid() and not facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _trim() -> None:
    """Drop the least recently used files, down to the limit."""
    total = 0
    for path in sorted(folder().glob("*.*"), key=lambda p: p.stat().st_mtime, reverse=True):
        total += path.stat().st_size
        if total > _MAX_BYTES:
            path.unlink(missing_ok=True)
