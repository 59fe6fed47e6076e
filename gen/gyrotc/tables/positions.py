"""A network over the 16-bit positions of the fixed-point runtime, in float64.

A position x = 0 ... 2^16 - 1 stands for the middle of its cell of the envelope. In positions a
Gaussian is 2^-((α_T (x_T - c_T))² + (α_r (x_r - c_r))²), a product of two functions of one input each; so
sums over a grid of the envelope need only functions of one input.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model import Network, Scale
from .common import STEEPEST
from .gradient import largest_gradient
from .solve import exp2_of_minus

__all__ = ["POSITIONS", "InputScale", "Inputs", "Surface", "difference", "position_scale", "surface_of"]

POSITIONS = 65536  # 16 bits of an input: docs/numerics.md, section 3
_UNITS_PER_C = 65536.0  # fixed point holds a temperature in 2^-16 C: docs/FORMAT.md
_GAIN_BITS = 27  # position = offset · gain · 2^-27: docs/numerics.md, section 3
_SQRT_LOG2E = 1.2011224087864498  # √(log2 e)
_SQRT_LN2 = 0.8325546111576977  # √(ln 2)
# Largest |d/dx| and |d²/dx²| of 2^-(α x)², as factors of α and α².
_SLOPE = STEEPEST * _SQRT_LN2
_CURVE = 2.0 * 0.6931471805599453  # 2 ln 2

Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True, slots=True)
class InputScale:
    """position = ((input - low) · gain) >> 27; input in 2^-16 C."""

    low: int
    gain: int

    def position(self, value: float) -> float:
        """Where an input (2^-16 C) lies among the middles of the cells; not rounded."""
        return (value - self.low) * self.per_unit - 0.5

    @property
    def per_unit(self) -> float:
        """Positions per 2^-16 C."""
        return self.gain * 2.0**-_GAIN_BITS


Inputs = tuple[InputScale, InputScale]  # T, slope


def position_scale(low: int, high: int) -> InputScale:
    """Scale that spreads an envelope (2^-16 C) over the positions."""
    gain = (POSITIONS * 2**_GAIN_BITS - 1) // max(high - low, 1)
    return InputScale(low, min(gain, 2**31 - 1))


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

    def steepest(self) -> Floats:
        """Bounds of the derivatives by one position over the whole envelope, shape (2,)."""
        low, high = np.zeros(2), np.full(2, float(POSITIONS))
        inverse = self.alpha * _SQRT_LN2
        return largest_gradient(self.linear / POSITIONS, self.center, inverse, self.weights, low, high)


def _add_products(total: Floats, weights: Floats, a: Floats, b: Floats) -> Floats:
    product = np.empty_like(total)
    for k, weight in enumerate(weights):
        total += np.multiply((weight * a[:, k])[:, None], b[None, :, k], out=product)
    return total


def difference(first: Surface, second: Surface, cells: int) -> float:
    """Bound of |first - second| over the whole envelope: largest on a grid, and what may lie between.

    Both must have the same Gaussians in the same order, nearly the same each.
    """
    step = POSITIONS / cells
    x = np.arange(cells + 1) * step
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
    return largest + step / 2.0 * float(between[0] + between[1])


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
