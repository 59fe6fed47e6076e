"""Types that annotations of every package use, and long arrays part by part."""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pyarrow as pa

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
PART = 2**16
"""Rows that are looked at together: what is computed of them stays small beside the columns of a long recording."""


def give_back() -> None:
    """Give memory that was freed in small parts back to the system, if the C library is glibc."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def numpy_of(values: pa.Array) -> NDArray[Any]:
    """Values of Arrow, NaN where there is none; `to_numpy` alone would load pandas where that is installed."""
    if values.null_count == 0 and str(values.type).startswith(("int", "uint", "float", "double")):
        return np.asarray(np.from_dlpack(values))
    return np.asarray(values.to_numpy(zero_copy_only=False))


def masked(values: FloatArray, mask: BoolArray) -> FloatArray:
    """Return `values[mask]`, without a copy if the mask selects everything."""
    return values if mask.all() else values[mask]


def steps_where(values: FloatArray, predicate: Callable[[FloatArray], BoolArray]) -> BoolArray:
    """Apply a predicate to the differences of consecutive values, part by part; shape (n - 1,)."""
    parts = (np.diff(values[part.start : part.stop + 1]) for part in parts_of(len(values) - 1))
    return np.concatenate([np.zeros(0, dtype=bool), *map(predicate, parts)])


def parts_of(rows: int, size: int = PART) -> Iterator[slice]:
    """Yield slices of some rows, part by part."""
    return (slice(at, min(at + size, rows)) for at in range(0, rows, size))
