"""Means of a recording over cells of equal length, and the size of what noise leaves in fits to them."""

from __future__ import annotations

import numpy as np

from .arrays import FloatArray
from .metrics import MAD_TO_SIGMA

__all__ = ["cell_means", "noise_of"]


def cell_means(length_s: float, time_s: FloatArray, *columns: FloatArray) -> tuple[FloatArray, ...]:
    """Means of the time and of every column over cells from the first row on; cells without rows are left out.

    Args:
        length_s: Length of a cell, s.
        time_s: Times in order, s, shape (n,), n > 0.
        columns: Shape (n,) each.
    """
    index = np.floor((time_s - time_s[0]) / length_s + 1e-9).astype(np.int64)
    first = np.flatnonzero(np.r_[True, np.diff(index) > 0])
    count = np.diff(np.r_[first, len(time_s)])
    return tuple(np.add.reduceat(v, first) / count for v in (time_s, *columns))


def noise_of(z: FloatArray) -> float:
    """Standard deviation of numbers about 0 of which most are noise."""
    return MAD_TO_SIGMA * float(np.median(np.abs(z)))
