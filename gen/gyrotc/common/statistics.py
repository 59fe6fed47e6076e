"""Small statistics: means of cells, quantiles of named distributions, an orthonormal base."""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr
from scipy.special import chdtri, ndtr, ndtri, stdtrit

from .arrays import FloatArray, parts_of
from .metrics import MAD_TO_SIGMA


def cell_means(length_s: float, time_s: FloatArray, *columns: FloatArray) -> tuple[FloatArray, ...]:
    """Means of the time and of every column over cells from the first row on; cells without rows are left out.

    Args:
        length_s: Length of a cell, s.
        time_s: Times in order, s, shape (n,), n > 0.
        columns: Shape (n,) each.
    """
    last, begun = np.array([-1]), []
    for part in parts_of(len(time_s)):
        index = np.floor((time_s[part] - time_s[0]) / length_s + 1e-9).astype(np.int64)
        begun.append(part.start + np.flatnonzero(np.diff(index, prepend=last) > 0))
        last = index[-1:]
    first = np.concatenate(begun)
    count = np.diff(np.r_[first, len(time_s)])
    return tuple(np.add.reduceat(v, first) / count for v in (time_s, *columns))


_UPPER = float(ndtr(2.0))  # 95.45 % of a normal distribution lie between -2 and 2 sigma


def coverage_factor(freedom: float | None) -> float:
    """Return k of 95.45 %: 2, or Student's t where the degrees of freedom are few (JCGM 100:2008, G.3)."""
    return 2.0 if freedom is None else float(stdtrit(freedom, _UPPER))


def noise_of(z: FloatArray) -> float:
    """Standard deviation of numbers about 0 of which most are noise."""
    return MAD_TO_SIGMA * float(np.median(np.abs(z)))


TOLERANCE = float(np.sqrt(np.finfo(np.float64).eps))
"""Share of a column's norm that must be its own beside the other columns.

Everything here ends in energies, squares of inner products. What is left of a column below the square root of the
rounding unit (1.5e-8) has a square at the level of the rounding of 1: its direction is made of rounding errors.
"""


def orthonormal(*blocks: FloatArray) -> FloatArray:
    """Orthonormal columns that span the columns of all blocks, shapes (N, k), in shape (N, rank).

    Where all columns are independent these are the columns made orthogonal in their order (Householder). Where some
    are not, columns are taken by the size of what is left of them (pivoting): dropping a dependent column of a plain
    factorisation would drop part of those after it. Columns of zeros have no direction.
    """
    columns = np.column_stack(blocks)
    norm = np.linalg.norm(columns, axis=0)
    if norm.size == 0:
        return np.zeros((len(columns), 0))
    q, r = np.linalg.qr(columns)
    if norm.size <= len(columns) and (np.abs(np.diag(r)) > TOLERANCE * norm).all():
        return np.asarray(q)
    scaled = columns[:, norm > 0.0] / norm[norm > 0.0]
    if scaled.shape[1] == 0:
        return np.zeros((len(columns), 0))
    q, r, _ = qr(scaled, mode="economic", pivoting=True, check_finite=False)
    return np.asarray(q[:, : np.count_nonzero(np.abs(np.diag(r)) > TOLERANCE)])


def main_directions(columns: FloatArray, share: float) -> FloatArray:
    """Orthonormal directions in which columns, shape (N, k), are at least `share` as strong as in the strongest."""
    left, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, size > share * size[:1]])


CHI2_95_ONE = float(chdtri(1, 0.05))
"""Fall of twice the log-likelihood at the ends of a 95 % interval of one parameter (Wilks): 3.84."""

CHI2_95_TWO = float(chdtri(2, 0.05))
"""The same for the 95 % set of two parameters: 5.99."""

NORMAL_95 = float(ndtri(0.975))
"""Half width of a 95 % interval in standard deviations: 1.96."""


def running_mean(values: FloatArray, width: int) -> FloatArray:
    """Means over `width` neighbours, fewer at the ends, of values, shape (n,) or (n, k)."""
    total = np.cumsum(np.concatenate([np.zeros((1, *values.shape[1:])), values]), axis=0)
    n = len(values)
    low = np.maximum(np.arange(n) - width // 2, 0)
    high = np.minimum(low + width, n)
    count = (high - low).reshape(-1, *([1] * (values.ndim - 1)))
    return np.asarray((total[high] - total[low]) / count)
