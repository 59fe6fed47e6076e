"""Compare a change of one run with memories of its temperature that could explain the run as well."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..mirror.recursions import first_order, play

_WIDTHS_C = (0.7, 1.5, 3.0, 6.0, 12.0, 24.0)  # of plays: octaves over what `causes.hysteresis` looks through
_LAGS_S = (200.0, 600.0, 1800.0, 5400.0)  # over what its lags look through, by factors of three
_RANK = 1e-3  # of the strongest direction: weaker ones are rounding, or a play that is never pushed


def evidence_beside_memories(
    means: tuple[FloatArray, FloatArray, FloatArray], used: NDArray[np.bool_], change: FloatArray, known: FloatArray
) -> float:
    """Return the advantage of a change over any memory for a run, as a difference of Schwarz's criterion (BIC).

    The memories are plays, lags, and both, each beside a level, the temperature's rate and what is `known`, free in all
    their amplitudes. Twice the logarithm of the odds; 10 is very strong (Kass and Raftery, J. Am. Stat. Assoc. 90
    (1995) 773). Means that resemble their neighbours count for less, as of a first-order process.

    Args:
        means: Time (s), temperature (C) and rate of the run, shape (n,) each, with what came before the means used.
        used: Means that count, shape (n,).
        change: Columns that explain the run by a change, shape (n, k); its place counts as one more.
        known: Columns that the memories stand beside, shape (n, k).
    """
    t, x, y = means
    left, rank, alike = _left(change[used], y[used])
    independent = float(used.sum()) * (1.0 - alike) / (1.0 + alike)
    plain = [np.ones_like(t), np.gradient(x, t), *known.T]
    plays = [play(width, x) - x for width in _WIDTHS_C]
    lags = [first_order(tau, t, x) - x for tau in _LAGS_S]
    found = []
    for memories in (plays, lags, plays + lags):
        remains, columns, _ = _left(np.column_stack(plain + memories)[used], y[used])
        better = independent * float(np.log(max(remains, 1e-300) / max(left, 1e-300)))
        found.append(better - (rank + 1 - columns) * float(np.log(max(independent, 1.0))))
    return min(found)


def _left(columns: FloatArray, y: FloatArray) -> tuple[float, int, float]:
    """Return the squares that a fit leaves, its rank, and the correlation of neighbours in the residual, 0 at least."""
    q, size, _ = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), full_matrices=False)
    q = q[:, size > _RANK * size[0]]
    rest = y - q @ (q.T @ y)
    left = float(rest @ rest)
    return left, q.shape[1], min(max(float(rest[1:] @ rest[:-1]) / max(left, 1e-300), 0.0), 0.95)
