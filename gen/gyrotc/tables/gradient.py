"""How steep a network is: what an error of its inputs can cost at most.

The sum of the single Gaussians' slopes is far too large a bound where weights of opposite sign stand side
by side; here the slope of the whole map is taken on a grid, plus what it can grow between the grid's points.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .solve import exp2_of_minus

__all__ = ["largest_gradient"]

# Of T and of dT/dt: the bound is loose by what a slope grows between them, the time grows with their number
_POINTS = (513, 257)
_STEEPEST = 0.8577638849607068  # largest |d/dx exp(-x²)|, at x = 1/√2
_MOST_CURVED = 2.0  # largest |d²/dx² exp(-x²)|
_LOG2E = 1.4426950408889634  # log2(e)

Floats = NDArray[np.floating[Any]]


def largest_gradient(
    linear: Floats, centers: Floats, inverse_widths: Floats, weights: Floats, low: Floats, high: Floats
) -> NDArray[np.float64]:
    """Upper bounds of |∂f/∂z_T| and |∂f/∂z_r| over a box of normalised inputs, deg/h, shape (2,).

    The same bits on every machine.

    Args:
        linear: Linear part, shape (2,).
        centers: Normalised centers, shape (n, 2).
        inverse_widths: 1/δ, 0 where a width is infinite, shape (n, 2).
        weights: Weights, deg/h, shape (n,).
        low, high: Corners of the box, shape (2,).
    """
    bounds = np.zeros(2)
    for axis in (0, 1):
        other = 1 - axis
        moving = [np.linspace(low[k], high[k], _POINTS[k]) for k in (0, 1)]
        slope = np.full((_POINTS[axis], _POINTS[other]), linear[axis])
        product = np.empty_like(slope)
        for center, inverse, weight in zip(centers, inverse_widths, weights, strict=True):
            a = (moving[axis] - center[axis]) * inverse[axis]
            b = (moving[other] - center[other]) * inverse[other]
            steep = weight * (-2.0 * a * inverse[axis]) * exp2_of_minus(a * a * _LOG2E)
            slope += np.multiply(steep[:, None], exp2_of_minus(b * b * _LOG2E), out=product)
        half = (high - low) / (np.array(_POINTS) - 1.0) / 2.0
        size = np.abs(weights) * inverse_widths[:, axis]
        growth = _MOST_CURVED * half[axis] * size * inverse_widths[:, axis]
        growth = growth + _STEEPEST**2 * half[other] * size * inverse_widths[:, other]
        bounds[axis] = np.max(np.abs(slope, out=slope)) + math.fsum(growth)
    return bounds
