"""Corrections without a search: constant, linear, cubic in T, and cubic in T with a slope in dT/dt, by least squares.

A table knows Gaussians, so a cubic is written as a constant, a linear part and three or four Gaussians in T so wide
that they reproduce it to 2.4e-4 of its coefficients.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..common.arrays import FloatArray
from ..recordings.fit_options import SIMPLE
from .data import Scaling, TrainingData, average_samples
from .gaussian import FEW, Sums, sum_of
from .networks import NetworkEntry, network
from .noise import floor_dph
from .result import Outcome

FLAT = 1e3  # width over dT/dt, in half ranges, of a map of T alone
_POWERS = ((0, 0), (1, 0), (2, 0), (3, 0), (0, 1))  # of T and dT/dt

# Number, width and outermost center of Gaussians, in half ranges. Largest error of z² and z³ over |z| <= 1, and sum of
# their |weights|: 5.2e-4 and 15; 2.4e-4 and 25. Closer ones cancel one another so much that fixed point loses more.
_GAUSSIANS = ((3, 1.5, 1.5), (4, 1.5, 2.0))
_TOLERANCE = 0.01  # of the noise floor
_GRID = 201  # points at which Gaussians are compared with powers, at a hundredth of a half range


def without_rate(fitted: NetworkEntry) -> dict[str, Any]:
    """A network that was fitted where dT/dt is 0 everywhere, flat in dT/dt: a map of T alone."""
    return {
        **fitted,
        "linear": [fitted["linear"][0], 0.0],
        "centers": [[center, 0.0] for center, _ in fitted["centers"]],
        "widths": [[width, FLAT] for width, _ in fitted["widths"]],
    }


def design(name: str, t: FloatArray, r: FloatArray) -> FloatArray:
    """Columns of a correction at normalised inputs, shape (n, powers)."""
    of_t = np.ones(len(t)), t, t * t, t * t * t
    return np.stack([of_t[a] * r if b else of_t[a] for a, b in SIMPLE[name]], axis=1)


def powers_of(t: FloatArray, r: FloatArray) -> FloatArray:
    """The powers that corrections are made of, in an order in which those of each come first, shape (n, 5)."""
    columns = np.empty((len(t), 5), order="F")
    columns[:, 0], columns[:, 1], columns[:, 4] = 1.0, t, r
    np.multiply(t, t, out=columns[:, 2])
    np.multiply(columns[:, 2], t, out=columns[:, 3])
    return columns


def solve_least_squares(columns: FloatArray, y: FloatArray, weight: FloatArray) -> FloatArray:
    """Weights of columns, shape (n, powers), by weighted least squares; of equally good ones the smallest."""
    root = np.sqrt(weight / weight.max())
    return np.asarray(np.linalg.lstsq(columns * root[:, None], y * root, rcond=None)[0], dtype=np.float64)


# Columns of `gaussian.Basis` in the order of `_POWERS`.
_OF_BASIS = {power: k for k, power in enumerate(_POWERS)}


def powers_of_method(name: str) -> tuple[int, ...]:
    """Return the columns of the Gaussian model that a correction by least squares has."""
    return tuple(sorted(_OF_BASIS[power] for power in SIMPLE[name]))


@dataclass(frozen=True, slots=True)
class LeastSquares:
    """A correction by least squares, from sums of products.

    Attributes:
        power_ons: Sums of every power-on.
        columns: Columns of the Gaussian model that it has.
    """

    power_ons: Sequence[Sums]
    columns: tuple[int, ...]

    def without(self, power_on: int, left_out: Sums) -> FloatArray:
        """Return its coefficients of the first columns without a piece of a power-on."""
        total = sum_of(self.power_ons) - left_out
        at = list(self.columns)
        found = np.zeros(FEW)
        found[at] = np.linalg.lstsq(total.products[np.ix_(at, at)], total.moments[at], rcond=1e-12)[0]
        return found


def fit_simple(name: str, data: TrainingData, scaling: Scaling, average_s: float) -> Outcome:
    """One of `SIMPLE` on cleaned samples, as a network."""
    t, r = scaling.normalise(data.temperature_c, data.slope_c_per_min)
    center = float(np.average(data.bias_dph, weights=data.weight))
    found = solve_least_squares(design(name, t, r), data.bias_dph - center, data.weight)
    weights = np.zeros(len(_POWERS))
    weights[[_POWERS.index(power) for power in SIMPLE[name]]] = found
    weights[0] += center
    return outcome_of(weights, data, scaling, average_s)


def outcome_of(weights: FloatArray, data: TrainingData, scaling: Scaling, average_s: float) -> Outcome:
    """Weights of `powers_of`, deg/h, as a network."""
    began = time.process_time()
    w0, linear = float(weights[0]), [float(weights[1]), float(weights[4])]
    centers, widths, of_gaussians = np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)
    if weights[2] != 0.0 or weights[3] != 0.0:
        t, r = scaling.normalise(data.temperature_c, data.slope_c_per_min)
        floor = floor_dph(data, data.bias_dph - powers_of(t, r) @ weights, average_s)
        extra, z, width, of_gaussians = _as_gaussians(weights[2], weights[3], _TOLERANCE * floor)
        w0, linear[0] = w0 + extra[0], linear[0] + extra[1]
        centers = np.stack([scaling.center_c + scaling.half_range_c * z, np.zeros(len(z))], axis=1)
        widths = np.stack([np.full(len(z), width), np.full(len(z), FLAT)], axis=1)
    means = len(average_samples(data, average_s))
    return Outcome(
        networks=(network(w0, linear, centers, widths, of_gaussians),),
        curves={
            "sizes": [],
            "chosen": len(of_gaussians),
            "samples": len(data),
            "means": means,
            "seconds": {"total": time.process_time() - began},
        },
        withheld="a correction without a process predicts nothing",
    )


def _as_gaussians(square: float, cube: float, tolerance: float) -> tuple[FloatArray, FloatArray, float, FloatArray]:
    """(constant and linear part, centers, width, weights) of square · z² + cube · z³ over |z| <= 1."""
    z = np.linspace(-1.0, 1.0, _GRID)
    target = square * z**2 + cube * z**3
    trials = []
    for number, width, reach in _GAUSSIANS:
        centers = np.linspace(-reach, reach, number)
        bells = np.exp(-(((z[:, None] - centers) / width) ** 2))
        columns = np.concatenate([np.ones((_GRID, 1)), z[:, None], bells], axis=1)
        found = np.linalg.lstsq(columns, target, rcond=1e-12)[0]
        error = float(np.abs(columns @ found - target).max())
        trials.append((error, (found[:2], centers, width, found[2:])))
        if error <= tolerance:
            return trials[-1][1]
    return min(trials, key=lambda trial: trial[0])[1]
