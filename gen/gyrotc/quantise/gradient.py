"""How steep a network is: what an error of its inputs can cost at most.

The sum of the single Gaussians' slopes is far too large a bound where weights of opposite sign stand side by side;
here the slope of the whole map is taken on a fine grid, plus what it can grow between the grid's points.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["largest_gradient"]

_POINTS = (2049, 1025)
_STEEPEST = math.sqrt(2.0 / math.e)  # largest |d/dx exp(-x²)|
_MOST_CURVED = 2.0  # largest |d²/dx² exp(-x²)|

Floats = NDArray[np.float64]


def largest_gradient(
    linear: Floats, centers: Floats, inverse_widths: Floats, weights: Floats, low: Floats, high: Floats
) -> Floats:
    """Upper bounds of |∂f/∂z_T| and |∂f/∂z_r| over a box of normalised inputs, deg/h, shape (2,).

    Args:
        linear: Linear part, shape (2,).
        centers: Normalised centers, shape (n, 2).
        inverse_widths: 1/δ, 0 where a width is infinite, shape (n, 2).
        weights: Weights, deg/h, shape (n,).
        low, high: Corners of the box, shape (2,).
    """
    if not len(weights):
        return np.abs(linear)
    bounds = np.empty(2)
    for axis in (0, 1):
        other = 1 - axis
        moving = [np.linspace(low[k], high[k], _POINTS[k]) for k in (0, 1)]
        a = (moving[axis][:, None] - centers[:, axis]) * inverse_widths[:, axis]
        slope = -2.0 * a * inverse_widths[:, axis] * np.exp(-(a**2)) * weights
        b = (moving[other][:, None] - centers[:, other]) * inverse_widths[:, other]
        found = np.abs(linear[axis] + slope @ np.exp(-(b**2)).T).max()
        half = (high - low) / (np.array(_POINTS) - 1.0) / 2.0
        size = np.abs(weights) * inverse_widths[:, axis]
        growth = _MOST_CURVED * half[axis] * (size * inverse_widths[:, axis]).sum()
        growth += _STEEPEST**2 * half[other] * (size * inverse_widths[:, other]).sum()
        bounds[axis] = found + growth
    return bounds
