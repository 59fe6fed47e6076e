"""A cubic in T with a slope in dT/dt whose coefficients are shrunk by how much they differ from power-on to power-on.

Least squares takes what one power-on shows for what all have in common. Here each has coefficients of its own about
the common ones, a drift, and white noise; how large each of them is follows from the recordings, and the common
coefficients are those that are most probable (a linear mixed model: Laird and Ware, Biometrics 38, 1982;
`gen/core/mixed.hpp`). Of a single power-on the branches stand in place of power-ons.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..common.arrays import FloatArray
from ..common.metrics import median
from .cross_validation import edges_of, turning_points
from .data import Scaling, TrainingData, average, cells_of
from .evidence import MEAN_S, TrainingFailed

_CELLS = 500  # means in all: more of them move the coefficients by less than a tenth of their own error
_LEAST_WHITE = 1e-3  # of the spread: a drift is known no better
_GRID = (
    2.0**24
)  # of the standardised bias, as of the evidence process: the last digit of a unit steers nothing


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
            [
                self.center + one - 0.5 * square,
                line - 0.75 * cube,
                1.5 * square,
                1.25 * cube,
                rate / self.rate,
            ]
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
    cells = average(means, length)
    first = numbered[np.r_[True, np.diff(of) > 0]]
    order = np.lexsort((cells.run, cells.time_s, power_on[first]))
    place = np.empty(len(order), dtype=np.intp)
    place[order] = np.arange(len(order))
    cells, on = cells.select(order), power_on[first][order]
    of_runs = np.array([means.bias_dph[a:b].mean() for a, b in pairwise(edges.tolist())])
    center, spread = float(of_runs.mean()), float(cells.bias_dph.std())
    if not spread > 0.0:
        raise TrainingFailed("the bias is the same everywhere")
    y = np.round((cells.bias_dph - center) / spread * _GRID) / _GRID
    x, r = scaling.normalise(cells.temperature_c, cells.slope_c_per_min)
    rate = max(float(np.sqrt(np.mean(r**2))), 1e-6)
    columns = np.stack(
        [np.ones_like(x), x, (3.0 * x**2 - 1.0) / 2.0, (5.0 * x**3 - 3.0 * x) / 4.0, r / rate], axis=1
    )
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
    """Number of the cell of `average` that each of the means belongs to."""
    edges = cells_of(means, length_s).edges
    if edges is None:
        return np.arange(len(means))
    return np.repeat(np.arange(len(edges)), np.diff(edges, append=len(means)))


def _branches(time_s: FloatArray, temperature_c: FloatArray) -> NDArray[np.int32]:
    """Number of the branch between turning points of the temperature, of a single power-on."""
    return np.searchsorted(turning_points(time_s, temperature_c), time_s).astype(np.int32)
