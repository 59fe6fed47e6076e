"""An orthonormal base of given columns: the one place where diagnosis decides what is linearly dependent."""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr

from .arrays import FloatArray

__all__ = ["TOLERANCE", "main_directions", "orthonormal"]


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
