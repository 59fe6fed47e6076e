"""Paired comparisons over stretches of thermal history: is one correction worse than another by more than luck?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from ..common.arrays import FloatArray

__all__ = ["more_than_error_of_pieces", "more_than_its_error", "of_pieces", "surely_above_0", "t_statistic"]


_SIGNIFICANCE = 0.05  # of the t test: docs/training.md, section 2


def more_than_its_error(*differences: FloatArray) -> bool:
    """Whether the mean of each of these, one entry a stretch, is above its standard error."""
    return not any(d.mean() <= d.std(ddof=1) / np.sqrt(len(d)) for d in differences)


def more_than_error_of_pieces(pieces: NDArray[np.int64], *differences: FloatArray) -> bool:
    """The same where stretches of one piece of history resemble each other; those of the piece -1 are left out.

    The standard error of a mean over clusters: the sums of deviations within pieces are what scatters independently
    (Liang and Zeger 1986). False with fewer than two pieces.
    """
    used = pieces >= 0
    _, index = np.unique(pieces[used], return_inverse=True)
    count = int(index.max(initial=-1)) + 1
    if count < 2:
        return False
    for d in (difference[used] for difference in differences):
        sums = np.bincount(index, d - d.mean())
        error = np.sqrt(count / (count - 1.0) * (sums**2).sum()) / len(d)
        if d.mean() <= error:
            return False
    return True


def of_pieces(values: FloatArray, pieces: NDArray[np.int64]) -> FloatArray:
    """Means over the independent pieces of history, shape (pieces,); stretches of the piece -1 belong to none."""
    used = pieces >= 0
    _, index = np.unique(pieces[used], return_inverse=True)
    return np.asarray(np.bincount(index, values[used]) / np.bincount(index))


def t_statistic(gains: FloatArray) -> tuple[float, int]:
    """Student's t of a mean against 0, and its degrees of freedom; 0 degrees where nothing can be said."""
    if len(gains) < 2 or not np.all(np.isfinite(gains)):
        return 0.0, 0
    error = float(gains.std(ddof=1)) / float(np.sqrt(len(gains)))
    return float(gains.mean()) / max(error, 1e-12), len(gains) - 1


def surely_above_0(gains: FloatArray, tried: int = 1) -> bool:
    """Whether the mean is above 0 by a t test, one-sided, at 5 % for all that are `tried` alike (Bonferroni)."""
    t, freedom = t_statistic(gains)
    return freedom > 0 and bool(t > stdtrit(freedom, 1.0 - _SIGNIFICANCE / tried))
