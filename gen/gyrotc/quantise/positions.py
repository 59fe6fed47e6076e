"""A network over the 16-bit positions of the fixed-point runtime, in float64.

A position x = -2^15 ... 2^15 - 1 stands for the middle of its cell of the envelope. In positions a
Gaussian is 2^-((α_T (x_T - c_T))² + (α_r (x_r - c_r))²), a product of two functions of one input each; so
sums over a grid of the envelope need only functions of one input.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model import Network, Scale
from .solve import exp2_of_minus

__all__ = ["POSITIONS", "InputScale", "Inputs", "Surface", "difference", "position_scale", "surface_of"]

POSITIONS = 65536
_UNITS_PER_C = 65536.0
_GAIN_BITS = 26
_SQRT_LOG2E = 1.2011224087864498
# Largest values of |2y e^{-y²}|, |2 - 4y²| e^{-y²} (y = α x √ln 2 ...), as factors of α and α² in base 2.
_SLOPE = 0.8577638849607068 * 0.8325546111576977
_CURVE = 2.0 * 0.6931471805599453

Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True, slots=True)
class InputScale:
    """position = ((input - zero) · gain) >> 26, minus 2^15; input in 2^-16 C."""

    zero: int
    gain: int

    def position(self, value: float) -> float:
        """Where an input (2^-16 C) lies among the middles of the cells; not rounded."""
        return (value - self.zero) * self.per_unit - 0.5 - POSITIONS / 2

    @property
    def per_unit(self) -> float:
        """Positions per 2^-16 C."""
        return self.gain * 2.0**-_GAIN_BITS


Inputs = tuple[InputScale, InputScale]  # T, slope


def position_scale(low: int, high: int) -> InputScale:
    """Scale that spreads an envelope (2^-16 C) over the positions, rounding inputs to the nearest middle."""
    zero = low - max(1, -(-(high - low) // (2 * POSITIONS)))
    gain = min((POSITIONS * 2**_GAIN_BITS - 1) // (high - zero), 2**32 - 1)
    return InputScale(zero, gain)


@dataclass(frozen=True, slots=True)
class Surface:
    """w0 + linear · x/2^16 + Σ weights · Gaussians, over positions."""

    w0: float
    linear: Floats  # (2,) deg/h over the whole range of positions
    alpha: Floats  # (n, 2)
    center: Floats  # (n, 2)
    weights: Floats  # (n,)

    def factors(self, axis: int, x: Floats) -> Floats:
        """The Gaussians' factors of one input at positions x: shape (len(x), n)."""
        d = (x[:, None] - self.center[None, :, axis]) * self.alpha[None, :, axis]
        return exp2_of_minus(d * d)

    def on_grid(self, x_t: Floats, x_r: Floats) -> Floats:
        """Values at every pair of positions, shape (len(x_t), len(x_r))."""
        scaled = self.linear[0] * x_t[:, None] + self.linear[1] * x_r[None, :]
        total = self.w0 + scaled / POSITIONS
        return _add_products(total, self.weights, self.factors(0, x_t), self.factors(1, x_r))

    def slope_on_grid(self, axis: int, x_t: Floats, x_r: Floats) -> Floats:
        """Derivative by one position, at every pair of positions."""
        total = np.full((len(x_t), len(x_r)), self.linear[axis] / POSITIONS)
        factors = [self.factors(0, x_t), self.factors(1, x_r)]
        x = (x_t, x_r)[axis]
        d = x[:, None] - self.center[None, :, axis]
        factors[axis] = factors[axis] * d * (self.alpha[:, axis] ** 2 * -_CURVE)
        return _add_products(total, self.weights, *factors)

    def steepest(self, axis: int, cells: int) -> float:
        """Bound of the derivative by one position over the whole envelope, from a grid and the curvature."""
        x, half_step = _grid(cells)
        largest = float(np.max(np.abs(self.slope_on_grid(axis, x, x))))
        other = 1 - axis
        size = np.abs(self.weights)
        along = size * _CURVE * self.alpha[:, axis] ** 2
        across = size * _SLOPE**2 * self.alpha[:, axis] * self.alpha[:, other]
        return largest + half_step * float(np.add.accumulate([0.0, *(along + across)])[-1])


def _add_products(total: Floats, weights: Floats, a: Floats, b: Floats) -> Floats:
    for k, weight in enumerate(weights):
        total = total + (weight * a[:, k])[:, None] * b[None, :, k]
    return total


def _grid(cells: int) -> tuple[Floats, float]:
    """Positions that divide the range into equal cells, and half a cell."""
    step = (POSITIONS - 1) / cells
    return -POSITIONS / 2 + np.arange(cells + 1) * step, step / 2.0


def difference(first: Surface, second: Surface, cells: int) -> float:
    """Bound of |first - second| over the whole envelope: largest on a grid, and what may lie between.

    Both must have the same Gaussians in the same order, nearly the same each.
    """
    x, half_step = _grid(cells)
    largest = float(np.max(np.abs(first.on_grid(x, x) - second.on_grid(x, x))))
    between = np.abs(first.linear - second.linear) / POSITIONS
    size = np.abs(first.weights)[:, None]
    change = np.abs(first.weights - second.weights)[:, None]
    alpha = np.maximum(first.alpha, second.alpha)
    spread = np.abs(first.alpha - second.alpha)
    shift = np.abs(first.center - second.center) * alpha
    # Derivative of the difference: changed weight, changed width and center of this input, and of the other.
    own = _SLOPE * alpha * change + size * (2.0 * spread + _CURVE * alpha * shift)
    others = np.divide(spread, alpha, out=np.zeros_like(alpha), where=alpha > 0.0) + _SLOPE * shift
    mixed = size * _SLOPE * alpha * others[:, ::-1]
    for row in own + mixed:
        between = between + row
    return largest + half_step * float(between[0] + between[1])


def surface_of(network: Network, scale: Scale, per_block: float, inputs: Inputs) -> Surface:
    """The model's network over positions; `per_block` is minutes per block."""
    center_t, half_t = scale.temperature_c
    halves = (half_t, scale.slope_c_per_min * per_block)
    zeros = (center_t, 0.0)
    units = [half * _UNITS_PER_C * i.per_unit for half, i in zip(halves, inputs, strict=True)]
    middle = [i.position(zero * _UNITS_PER_C) for zero, i in zip(zeros, inputs, strict=True)]
    linear = np.array([network.linear[k] * POSITIONS / units[k] for k in (0, 1)])
    alpha = np.zeros((len(network.weights), 2))
    center = np.zeros_like(alpha)
    for n, ((c_t, c_r), widths) in enumerate(zip(network.centers, network.widths, strict=True)):
        for k, (c, width) in enumerate(zip((c_t, c_r * per_block), widths, strict=True)):
            if width is not None:
                alpha[n, k] = _SQRT_LOG2E / (width * units[k])
                center[n, k] = inputs[k].position(c * _UNITS_PER_C)
    return Surface(
        w0=network.w0 - (linear[0] * middle[0] + linear[1] * middle[1]) / POSITIONS,
        linear=linear,
        alpha=alpha,
        center=center,
        weights=np.array(network.weights, dtype=np.float64),
    )
