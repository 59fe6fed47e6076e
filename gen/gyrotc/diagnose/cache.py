"""Banks on disk, by the hash of what they depend on (`store.kept`).

Reading makes nothing but the classes of a bank, plain values and arrays.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import inspect
import io
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..store import kept
from .blocks import Records
from .candidates import Candidate, diagnosed
from .signature_bank import Alternative, Signature, SignatureBank, build
from .static_map import MapBasis

__all__ = ["bank_of"]

_VERSION = 5  # raised with every change of what a bank holds
_MAKERS = ("causes", "target", "diagnose")  # packages whose code decides what a bank holds
_CLASSES = (SignatureBank, Signature, Alternative, MapBasis, Candidate)
_OWN = {(kind.__module__, kind.__qualname__): kind for kind in _CLASSES}
_NUMPY = {
    ("numpy", "ndarray"),
    ("numpy", "dtype"),
    *((f"numpy.{core}.{part}", name) for core in ("core", "_core") for part, name in (
        ("multiarray", "_reconstruct"), ("multiarray", "scalar"), ("numeric", "_frombuffer"),
    )),
}  # fmt: skip


def bank_of(records: Records, level: int, say: Callable[[str], None] = lambda _: None) -> SignatureBank:
    """The bank of these temperature records, from disk or made and kept."""
    digest = hashlib.sha256(f"{_VERSION} {level} {_code()} {records.key()}".encode()).hexdigest()
    bank = kept.kept(f"{digest}.bank", _bank)
    if bank is None:
        say("computing the signatures of all causes")
        bank = build(records, level)
        kept.keep(f"{digest}.bank", _content(bank))
    return bank


def _content(bank: SignatureBank) -> bytes:
    return pickle.dumps(bank, protocol=5)


def _bank(content: bytes) -> SignatureBank | None:
    bank = _Reader(io.BytesIO(content)).load()
    return bank if isinstance(bank, SignatureBank) else None


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


@functools.cache
def _code() -> str:
    """Hash of the code that makes a bank: a new version makes new banks."""
    package = Path(__file__).parents[1]
    files = [path for name in _MAKERS for path in sorted((package / name).rglob("*.py"))]
    files += [Path(inspect.getfile(t.features)) for t in diagnosed().values() if t.features is not None]
    return hashlib.sha256(b"".join(path.read_bytes() for path in dict.fromkeys(files))).hexdigest()
