"""Banks on disk, by the hash of what they depend on (`$XDG_CACHE_HOME/gyrotc`, default `~/.cache/gyrotc`).

A bank is kept as the SHA-256 of its bytes and then the bytes. What protects whom: the folder is the user's own (made
with mode 0700; one that belongs to somebody else, or that others may write, is not used), the checksum finds damage,
and reading makes nothing but the classes of a bank, plain values and arrays. Whatever does not fit is thrown away and
computed again. `joblib.Memory` keeps results on disk as well, but has neither: it unpickles whatever lies there.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib
import inspect
import io
import os
import pickle
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...inputs import read_input
from ...outputs import write_atomically
from ..screen.blocks import Records
from .candidates import Candidate, diagnosed
from .signature_bank import Alternative, Signature, SignatureBank, build
from .static_map import MapBasis

__all__ = ["bank_of", "clear", "folder", "held", "limit", "set_limit"]

_VERSION = 4  # raised with every change of what a bank holds
_MOST_BYTES = 2 * 10**9  # some dozens of banks
_LIMIT = "limit_bytes"  # a file beside the banks that says otherwise
_MAKERS = (
    "diagnose/screen/blocks",
    "diagnose/noise_colour/colours",
    "diagnose/noise_colour/whitener",
    "diagnose/signatures/alternatives",
    "diagnose/signatures/candidates",
    "diagnose/signatures/changed_input",
    "diagnose/signatures/signature_bank",
    "diagnose/signatures/static_map",
    "terms/memory",
    "terms/operators",
    "terms/search",
)  # modules that what a bank holds depends on, beside those of the causes
_MAGIC = b"gyrotc bank\n"
_SUM_BYTES = hashlib.sha256().digest_size
_CLASSES = (SignatureBank, Signature, Alternative, MapBasis, Candidate)
_OWN = {(kind.__module__, kind.__qualname__): kind for kind in _CLASSES}
_NUMPY = {
    ("numpy", "ndarray"),
    ("numpy", "dtype"),
    *((f"numpy.{core}.{part}", name) for core in ("core", "_core") for part, name in (
        ("multiarray", "_reconstruct"), ("multiarray", "scalar"), ("numeric", "_frombuffer"),
    )),
}  # fmt: skip


def folder() -> Path:
    """Where banks are kept."""
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "gyrotc" / "banks"


def bank_of(records: Records, level: int, say: Callable[[str], None] = lambda _: None) -> SignatureBank:
    """The bank of these temperature records, from disk or made and kept."""
    digest = hashlib.sha256(f"{_VERSION} {level} {_code()} {records.key()}".encode()).hexdigest()
    path = folder() / f"{digest}.bank"
    own = _own_folder()
    bank = _kept(path) if own else None
    if bank is not None:
        return bank
    say("computing the signatures of all causes")
    bank = build(records, level)
    if own:
        _keep(path, bank)
    return bank


def _own_folder() -> bool:
    """Whether the folder is there, is the user's and nobody else may write into it."""
    try:
        folder().mkdir(parents=True, exist_ok=True, mode=0o700)
        facts = folder().stat()
    except OSError:
        return False
    return facts.st_uid == os.geteuid() and not facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _kept(path: Path) -> SignatureBank | None:
    """The bank in a file; None where there is none, or where the file is not as it was written (it is removed)."""
    if not path.is_file():
        return None
    try:
        data = read_input(path, "recording_mib", "a bank")
        head, total, content = (
            data[: len(_MAGIC)],
            data[len(_MAGIC) :][:_SUM_BYTES],
            data[len(_MAGIC) + _SUM_BYTES :],
        )
        if head == _MAGIC and hashlib.sha256(content).digest() == total:
            bank = _Reader(io.BytesIO(content)).load()
            if isinstance(bank, SignatureBank):
                path.touch()
                return bank
    except (InputError, OSError):
        return None
    except Exception:  # written by another program or version: unpickling may raise anything
        pass
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)
    return None


def _keep(path: Path, bank: SignatureBank) -> None:
    content = pickle.dumps(bank, protocol=5)
    try:
        write_atomically(path, _MAGIC + hashlib.sha256(content).digest() + content)
        _trim()
    except OSError:
        pass  # a cache that cannot be written costs time, nothing else


class _Reader(pickle.Unpickler):
    """Makes the classes of a bank and arrays, and calls nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in _OWN:
            return _OWN[module, name]
        if (module, name) == ("builtins", "slice"):
            return slice
        if (module, name) in _NUMPY:
            return getattr(importlib.import_module(module), name)
        raise pickle.UnpicklingError(f"{module}.{name} has no place in a bank")


def _code() -> str:
    """Hash of the modules that make a bank, those of the causes among them: a new version makes new banks."""
    package = Path(__file__).parents[2]
    names = [package / f"{name}.py" for name in _MAKERS]
    names += [Path(inspect.getfile(t.features)) for t in diagnosed().values() if t.features is not None]
    return hashlib.sha256(b"".join(_content(name) for name in names)).hexdigest()


@functools.cache
def _content(path: Path) -> bytes:
    return path.read_bytes()


def limit() -> int:
    """Most bytes that all banks may take."""
    try:
        return min(int((folder() / _LIMIT).read_text("ascii")[:20]), 10**15)
    except (OSError, ValueError):
        return _MOST_BYTES


def set_limit(most: int) -> None:
    """Keeps to another limit from now on.

    Raises:
        InputError: The folder is not there and cannot be made, or is not the user's own.
    """
    if not _own_folder():
        raise InputError(str(folder()), "is not a folder that only this user may write", "such a folder")
    write_atomically(folder() / _LIMIT, f"{most}\n")
    _trim()


def held() -> tuple[int, int]:
    """How many banks there are, and their bytes."""
    sizes = [path.stat().st_size for path in folder().glob("*.bank")]
    return len(sizes), sum(sizes)


def clear() -> None:
    """Removes all banks."""
    for path in folder().glob("*.bank"):
        path.unlink(missing_ok=True)


def _trim() -> None:
    """Drops the banks that were not used for longest, down to the limit."""
    most = limit()
    files = sorted(folder().glob("*.bank"), key=lambda p: p.stat().st_mtime, reverse=True)
    total = 0
    for path in files:
        total += path.stat().st_size
        if total > most:
            path.unlink(missing_ok=True)
