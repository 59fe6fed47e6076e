"""Banks on disk, by the hash of what they depend on (`$XDG_CACHE_HOME/gyrotc`, default `~/.cache/gyrotc`)."""

from __future__ import annotations

import functools
import hashlib
import inspect
import os
import pickle
from collections.abc import Callable
from pathlib import Path

from ..outputs import write_atomically
from .bank import Bank, build
from .catalogue import diagnosed
from .records import Records

__all__ = ["bank_of", "folder"]

_VERSION = 2  # raised with every change of what a bank holds
_MOST_BYTES = 2 * 2**30


def folder() -> Path:
    """Where banks are kept."""
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "gyrotc" / "banks"


def bank_of(records: Records, level: int, say: Callable[[str], None] = lambda _: None) -> Bank:
    """The bank of these temperature records, from disk or made and kept."""
    digest = hashlib.sha256(f"{_VERSION} {level} {_code()} {records.key()}".encode()).hexdigest()
    path = folder() / f"{digest}.bank"
    try:
        with path.open("rb") as stream:
            bank = pickle.load(stream)  # written by this program into the user's own cache
        if isinstance(bank, Bank):
            path.touch()
            return bank
    except (OSError, pickle.PickleError, EOFError, AttributeError, ImportError, IndexError):
        pass
    say("computing the signatures of all causes")
    bank = build(records, level)
    try:
        write_atomically(path, pickle.dumps(bank, protocol=5))
        _trim()
    except OSError:
        pass  # a cache that cannot be written costs time, nothing else
    return bank


def _code() -> str:
    """Hash of the modules that make a bank, those of the causes among them: a new version makes new banks."""
    here = Path(__file__).parent
    makers = ("bank", "baseline", "catalogue", "noise", "others", "records")
    shared = ("memory", "operators", "search")
    names = [here / f"{n}.py" for n in makers] + [here.parent / "terms" / f"{n}.py" for n in shared]
    names += [Path(inspect.getfile(t.features)) for t in diagnosed().values() if t.features is not None]
    return hashlib.sha256(b"".join(_content(name) for name in names)).hexdigest()


@functools.cache
def _content(path: Path) -> bytes:
    return path.read_bytes()


def _trim() -> None:
    """Drops the banks that were not used for longest, down to 2 GiB."""
    files = sorted(folder().glob("*.bank"), key=lambda p: p.stat().st_mtime, reverse=True)
    total = 0
    for path in files:
        total += path.stat().st_size
        if total > _MOST_BYTES:
            path.unlink(missing_ok=True)
