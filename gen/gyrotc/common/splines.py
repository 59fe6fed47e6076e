"""Evaluate cubic B-splines, without `scipy.interpolate`: its import takes longer than to train a map."""

from __future__ import annotations

import numpy as np

from .arrays import FloatArray

_DEGREE = 3


def cubic_splines(x: FloatArray, knots: FloatArray) -> FloatArray:
    """Return the cubic B-splines over some knots at some places, shape (n, knots + 2).

    The recursion is that of Cox and de Boor. The outer knots are repeated, so that the splines add up to 1 everywhere
    between them.

    Args:
        x: Places from the first knot to the last, shape (n,).
        knots: In ascending order, two at least.
    """
    t = np.concatenate([[knots[0]] * _DEGREE, knots, [knots[-1]] * _DEGREE])
    last = np.clip(np.searchsorted(t, x, side="right") - 1, _DEGREE, len(t) - _DEGREE - 2)  # of the knots not above x
    values = np.zeros((_DEGREE + 1, len(x)))
    values[0] = 1.0
    for degree in range(1, _DEGREE + 1):
        lower = values[:degree].copy()
        values[0] = 0.0
        for k in range(1, degree + 1):
            right, left = t[last + k], t[last + k - degree]
            share = lower[k - 1] / np.where(right > left, right - left, np.inf)
            values[k - 1] += share * (right - x)
            values[k] = share * (x - left)
    columns = np.zeros((len(x), len(knots) + _DEGREE - 1))
    columns[np.arange(len(x))[:, None], last[:, None] - _DEGREE + np.arange(_DEGREE + 1)] = values.T
    return columns
