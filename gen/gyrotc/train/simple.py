"""Corrections without a search: constant, linear, cubic in T, and cubic in T with a slope in dT/dt.

Each is least squares on the samples. A table knows Gaussians, so a cubic is written as a constant, a linear part and
three or four Gaussians in T so wide that they reproduce it to 2.4e-4 of its coefficients.

`mixed` is a cubic in T with a slope in dT/dt whose coefficients are shrunk by how much they differ from power-on to
power-on. Least squares takes what one power-on shows for what all have in common. Here each has coefficients of its own
about the common ones, a drift, and white noise; how large each of them is follows from the recordings, and the common
coefficients are those that are most probable (a linear mixed model: Laird and Ware, Biometrics 38, 1982;
`gen/core/mixed.hpp`). Of a single power-on the branches stand in place of power-ons.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..common.arrays import FloatArray
from ..common.metrics import median
from ..recordings.fit_options import SIMPLE
from .data import Scaling, TrainingData, average_samples, edges_of, mean_cells, turning_points
from .evidence import GRID, MEAN_S, TrainingFailed, floor_dph
from .networks import NetworkEntry, network
from .result import Outcome

FLAT = 1e3  # width over dT/dt, in half ranges, of a map of T alone
_POWERS = ((0, 0), (1, 0), (2, 0), (3, 0), (0, 1))  # of T and dT/dt
_FIRST = {"constant": 1, "linear": 2, "cubic": 4, "cubic_slope": 5}
"""How many of `powers_of` each has."""
_DEPENDENT = 1e-8
"""Of a triangle's diagonal: only a singular value decomposition tells how far such columns depend on each other."""

# Number, width and outermost center of Gaussians, in half ranges. Largest error of z² and z³ over |z| <= 1, and sum of
# their |weights|: 5.2e-4 and 15; 2.4e-4 and 25. Closer ones cancel one another so much that fixed point loses more.
_GAUSSIANS = ((3, 1.5, 1.5), (4, 1.5, 2.0))
_TOLERANCE = 0.01  # of the noise floor
_GRID = 201  # points at which Gaussians are held against powers, at a hundredth of a half range


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


def triangle_of(rows: FloatArray) -> FloatArray:
    """Triangle of an orthogonal factorisation, shape (columns, columns) or with fewer rows; that of triangles of parts
    one below the other is that of the whole."""
    factor: Any = np.linalg.qr(rows, mode="r")
    return np.asarray(factor, dtype=np.float64)


def all_solved(triangle: FloatArray, samples: int) -> dict[str, FloatArray]:
    """Return the weights of `powers_of` for each of `SIMPLE`, 0 for powers that it does without.

    One orthogonal factor serves all: the first columns of a triangle are the triangle of the first columns.

    Args:
        triangle: `triangle_of` the powers and the bias behind them, each row times the root of its weight.
        samples: Number of rows.
    """
    size = np.abs(np.diagonal(triangle)[:-1])
    found = {}
    for name, columns in _FIRST.items():
        weights = np.zeros(triangle.shape[1] - 1)
        of, by = triangle[:columns, :columns], triangle[:columns, -1]
        if size[:columns].min() > _DEPENDENT * size[:columns].max():
            weights[:columns] = np.linalg.solve(of, by)
        else:
            cut = max(samples, columns) * np.finfo(np.float64).eps  # as for the rows themselves
            weights[:columns] = np.linalg.lstsq(of, by, rcond=cut)[0]
        found[name] = weights
    return found


def solve_least_squares(columns: FloatArray, y: FloatArray, weight: FloatArray) -> FloatArray:
    """Weights of columns, shape (n, powers), by weighted least squares; of equally good ones the smallest."""
    root = np.sqrt(weight / weight.max())
    return np.asarray(np.linalg.lstsq(columns * root[:, None], y * root, rcond=None)[0], dtype=np.float64)


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


_CELLS = 500  # means in all: more of them move the coefficients by less than a tenth of their own error
_LEAST_WHITE = 1e-3  # of the spread: a drift is known no better


@dataclass(frozen=True, slots=True)
class Mixed:
    """The model with the parameters of the whole record.

    Attributes:
        model: In standardised units.
        cell: Which of its means each of the means that it was made of belongs to, shape (means,).
        cells: Number of its means.
        center, spread: Of the bias, deg/h.
        rate: Typical dT/dt, in units of the normalised one.
    """

    model: _core.MixedModel
    cell: NDArray[np.intp]
    cells: int
    center: float
    spread: float
    rate: float

    def powers(self, out: NDArray[np.intp] | None = None) -> FloatArray:
        """Weights of 1, T, T², T³ and dT/dt, normalised (`simple.powers_of`), without some of the means; deg/h.

        Raises:
            TrainingFailed: The equations cannot be solved.
        """
        kept = np.ones(self.cells, dtype=bool)
        if out is not None:
            kept[self.cell[out]] = False
        try:
            one, line, square, cube, rate = self.spread * self.model.weights(kept)
        except RuntimeError as error:
            raise TrainingFailed(f"the mixed model cannot be solved ({error})") from error
        return np.array(
            [self.center + one - 0.5 * square, line - 0.75 * cube, 1.5 * square, 1.25 * cube, rate / self.rate]
        )


def fit_mixed_model(means: TrainingData, scaling: Scaling, power_on: NDArray[np.int64]) -> Mixed:
    """The most probable parameters.

    Args:
        means: Samples, or means of them, in order of run and time.
        scaling: Normalisation of the inputs.
        power_on: Number of the power-on of each of them, shape (n,).

    Raises:
        TrainingFailed: There is no spread to be explained.
    """
    edges = edges_of(means.run)
    length = max(MEAN_S, float(means.duration_s.sum()) / _CELLS)
    numbered = np.arange(len(means))
    of = _cell_of(means, length)
    cells = average_samples(means, length)
    first = numbered[np.r_[True, np.diff(of) > 0]]
    order = np.lexsort((cells.run, cells.time_s, power_on[first]))
    place = np.empty(len(order), dtype=np.intp)
    place[order] = np.arange(len(order))
    cells, on = cells.select(order), power_on[first][order]
    of_runs = np.array([means.bias_dph[a:b].mean() for a, b in pairwise(edges.tolist())])
    center, spread = float(of_runs.mean()), float(cells.bias_dph.std())
    if not spread > 0.0:
        raise TrainingFailed("the bias is the same everywhere")
    y = np.round((cells.bias_dph - center) / spread * GRID) / GRID
    x, r = scaling.normalise(cells.temperature_c, cells.slope_c_per_min)
    rate = max(float(np.sqrt(np.mean(r**2))), 1e-6)
    columns = np.stack([np.ones_like(x), x, (3.0 * x**2 - 1.0) / 2.0, (5.0 * x**3 - 3.0 * x) / 4.0, r / rate], axis=1)
    numbers = np.unique(on, return_inverse=True)[1].astype(np.int32)
    group = numbers if numbers[-1] > 0 else _branches(cells.time_s, cells.temperature_c)
    differences = np.diff(y)[np.diff(cells.run) == 0]
    white = float(np.sqrt(np.mean(differences**2) / 2.0)) if len(differences) else _LEAST_WHITE
    longest = max(float(means.time_s[b - 1] - means.time_s[a]) for a, b in pairwise(edges.tolist()))
    model = _core.MixedModel(
        columns,
        y,
        cells.weight / median(cells.weight),
        cells.time_s - cells.time_s.min(),
        numbers,
        group,
        white=max(white, _LEAST_WHITE),
        length_s=max(longest, length),
    )
    model.optimise()
    return Mixed(model, place[of], len(cells), center, spread, rate)


def _cell_of(means: TrainingData, length_s: float) -> NDArray[np.intp]:
    """Number of the cell of `average_samples` that each of the means belongs to."""
    edges = mean_cells(means, length_s).edges
    if edges is None:
        return np.arange(len(means))
    return np.repeat(np.arange(len(edges)), np.diff(edges, append=len(means)))


def _branches(time_s: FloatArray, temperature_c: FloatArray) -> NDArray[np.int32]:
    """Number of the branch between turning points of the temperature, of a single power-on."""
    return np.searchsorted(turning_points(time_s, temperature_c), time_s).astype(np.int32)
