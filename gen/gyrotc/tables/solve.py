"""Arithmetic of `quantise` that gives the same bits on every machine.

A table is a pure function of its model, whatever processor makes it; `np.exp`, `@` and LAPACK are not.
Here are the few functions needed, in operations that IEEE 754 defines, in a fixed order.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["exp2_of_minus", "gram", "solve"]

Floats = NDArray[np.floating[Any]]

_LN2 = 0.6931471805599453  # ln 2
_DEGREE = 17  # of the series of e^y, |y| < ln 2: what is left out is below 2^-60


def exp2_of_minus(u: Any) -> Floats:
    """2^-u for u >= 0, to about 3e-16; 0 beyond 1000."""
    x = np.minimum(np.asarray(u, dtype=np.float64), 1000.0)
    whole = np.floor(x)
    y = (x - whole) * -_LN2
    total = np.ones_like(y)
    for n in range(_DEGREE, 0, -1):
        total = total * y / n + 1.0
    return np.asarray(np.where(x < 1000.0, np.ldexp(total, -whole.astype(np.int64)), 0.0))


def gram(a: Floats, b: Floats) -> Floats:
    """Σ over rows of a[k, i] · b[k, j], added row after row: shape (a.shape[1], b.shape[1])."""
    total = np.zeros((a.shape[1], b.shape[1]))
    for row_a, row_b in zip(a, b, strict=True):
        total = total + row_a[:, None] * row_b[None, :]
    return total


def solve(matrix: Floats, right: Floats) -> Floats:
    """x of matrix · x = right for a symmetric positive definite matrix, by Cholesky.

    Raises:
        ArithmeticError: The matrix is not positive definite to working precision.
    """
    n = len(right)
    left = matrix.copy()
    x = right.copy()
    for j in range(n):
        pivot = left[j, j]
        if not pivot > 0.0:
            raise ArithmeticError("matrix is not positive definite")
        column = left[j:, j] / math.sqrt(pivot)
        left[j:, j] = column
        left[j + 1 :, j + 1 :] -= column[1:, None] * column[None, 1:]
    for j in range(n):
        x[j] = x[j] / left[j, j]
        x[j + 1 :] -= x[j] * left[j + 1 :, j]
    for j in range(n - 1, -1, -1):
        x[j] = x[j] / left[j, j]
        x[:j] -= x[j] * left[j, :j]
    return np.asarray(x)
