"""Choose regressors beside the map, such as recorded channels, by history that was left out.

The bias is map(T, dT/dt) + sum of columns times weights + noise. The weights are those of generalised least squares
with the map, and what each power-on has of its own, integrated out (partial linear models; Speckman, J. Royal
Statistical Society B 50, 1988). A piece of history is left out by subtraction, as for the map; after that any set of
regressors costs a small linear system.

Regressors are added one after the other, the best first; `choice` decides how many of them are taken.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import BoolArray, FloatArray
from .choice import CandidateChoice, choose, expected_square
from .data import Scaling, TrainingData, average_samples, mean_cells
from .gaussian import GaussianMap
from .noise import floor_dph
from .process import MEAN_S, TrainingHistory, smooth

# Map and weights are found in turn so many times: a third round moves weights of simulated gyros by less than 1 %.
_ROUNDS = 2


@dataclass(frozen=True)
class Regressors:
    """Groups of columns at every sample.

    Attributes:
        columns: By name, shape (samples, k) each.
        rivals: For a name those that are never taken beside it.
    """

    columns: Mapping[str, FloatArray]
    rivals: Mapping[str, frozenset[str]] = field(default_factory=dict)


@dataclass(frozen=True)
class RegressorChoice:
    """The regressors that are taken.

    Attributes:
        chosen: Names in the order in which they were taken.
        weights: Of the columns of each, deg/h per unit.
        left_out_rms_dph: RMS expected on the pieces left out, all counting alike, with none, one, two, ... of them.
        choice: The decision on their number; candidates are "0", "1", "2", ...
        pieces: Number of pieces.
    """

    chosen: tuple[str, ...]
    weights: dict[str, FloatArray]
    left_out_rms_dph: tuple[float, ...]
    choice: CandidateChoice
    pieces: int


@dataclass(frozen=True)
class _Piece:
    """A piece of history: normal equations of the rest, and what the map of the rest leaves of each column on it."""

    normal: FloatArray
    left: FloatArray


def choose_regressors(
    samples: TrainingData,
    scaling: Scaling,
    power_on: NDArray[np.int64] | None,
    regressors: Regressors,
    average_s: float,
    most: int,
) -> RegressorChoice:
    """Add regressors one after the other.

    Args:
        samples: Cleaned samples.
        scaling: Their scaling.
        power_on: Number of the power-on of each run, by its index; None: each run is one.
        regressors: Columns at these samples.
        average_s: Averaging of what is judged, s.
        most: Largest number that is taken.

    Raises:
        TrainingFailed: The map cannot be fitted.
    """
    weights: dict[str, FloatArray] = {}
    for _ in range(_ROUNDS):
        beside = Beside.of(samples, scaling, power_on, regressors, weights, average_s)
        pieces = beside.pieces()
        chosen, choice = _forward(beside, pieces, regressors, most)
        weights = beside.weights(chosen)
    path = [beside.squares(pieces, chosen[:k]) for k in range(len(chosen) + 1)]
    rms = tuple(float(np.sqrt(square.mean())) for square in path) if pieces else ()
    return RegressorChoice(tuple(chosen), weights, rms, choice, len(pieces))


def enrich(
    samples: TrainingData,
    scaling: Scaling,
    power_on: NDArray[np.int64] | None,
    regressors: Regressors,
    plain: RegressorChoice,
    richer: Mapping[str, Sequence[str]],
    average_s: float,
) -> RegressorChoice:
    """Put behind chosen regressors one more each, if left-out history shows that it is better.

    Args:
        samples, scaling, power_on, average_s: As for `choose_regressors`.
        regressors: The chosen ones, and those that may stand behind them.
        plain: What was chosen.
        richer: For every chosen one those of which one may stand behind it, the simplest first.

    Raises:
        TrainingFailed: The map cannot be fitted.
    """
    beside = Beside.of(samples, scaling, power_on, regressors, plain.weights, average_s)
    pieces = beside.pieces()
    chosen = list(plain.chosen)
    for name in plain.chosen:
        others = richer[name]
        place = chosen.index(name) + 1
        sets = [chosen, *([*chosen[:place], other, *chosen[place:]] for other in others)]
        found = choose([name, *others], np.array([beside.squares(pieces, one) for one in sets]).T)
        chosen = sets[[name, *others].index(found.chosen)]
    if tuple(chosen) == plain.chosen:
        return plain
    weights = beside.weights(chosen)
    path = [beside.squares(pieces, chosen[:k]) for k in range(len(chosen) + 1)]
    rms = tuple(float(np.sqrt(square.mean())) for square in path)
    return replace(plain, chosen=tuple(chosen), weights=weights, left_out_rms_dph=rms)


def _forward(
    beside: Beside, pieces: Sequence[_Piece], regressors: Regressors, most: int
) -> tuple[list[str], CandidateChoice]:
    """Return the regressors that are taken, the best first, and the decision on their number."""
    taken: list[str] = []
    path = [beside.squares(pieces, taken)]
    while len(taken) < most and len(pieces) > 1:
        closed = set(taken).union(*(regressors.rivals.get(name, frozenset()) for name in taken))
        trials = {n: beside.squares(pieces, [*taken, n]) for n in regressors.columns if n not in closed}
        if not trials:
            break
        taken.append(min(trials, key=lambda n: float(np.log(trials[n]).mean())))
        path.append(trials[taken[-1]])
    choice = choose([str(k) for k in range(len(path))], np.array(path).T)
    return taken[: int(choice.chosen)], choice


@dataclass(frozen=True)
class Beside:
    """The map and regressors on one history.

    Attributes:
        history: The means, without outliers of what the weights so far leave.
        map: The smooth map.
        table: Measured bias and all columns at the means, shape (means, 1 + k).
        place: Columns of each regressor in `table`.
        average_s: Averaging of what is judged, s.
    """

    history: TrainingHistory
    map: GaussianMap
    table: FloatArray
    place: Mapping[str, NDArray[np.int64]]
    average_s: float

    @staticmethod
    def of(
        samples: TrainingData,
        scaling: Scaling,
        power_on: NDArray[np.int64] | None,
        regressors: Regressors,
        weights: Mapping[str, FloatArray],
        average_s: float,
    ) -> Beside:
        """Fit the smooth map beside regressors of known weights."""
        added = sum((regressors.columns[n] @ beta for n, beta in weights.items()), np.zeros(len(samples)))
        history = TrainingHistory.of(replace(samples, bias_dph=samples.bias_dph - added), scaling, power_on)
        history, found = history.without_outliers(smooth(history.count))
        columns, place, at = [samples.bias_dph - history.center], {}, 1
        for name, values in regressors.columns.items():
            columns += list(values.T)
            place[name] = np.arange(at, len(columns))
            at = len(columns)
        cells = mean_cells(samples, MEAN_S)
        table = np.stack([cells.mean(column) for column in columns], axis=1)
        first = _places(average_samples(samples, MEAN_S), history.means)
        return Beside(history, found, table[first], place, average_s)

    def residuals(self) -> FloatArray:
        """Return what the map leaves of the bias and of every column, shape (means, 1 + k)."""
        precision, n = self._precision(np.ones(len(self.history.y), dtype=bool)), self.map.structure.columns
        return self._left(self.history.columns[:, :n], self.table, self._smoothed(precision))

    def pieces(self) -> list[_Piece]:
        """Leave out every piece of history."""
        h, found = self.history, []
        for fold in h.folds:
            held, near = fold.held(h.means), fold.near(h.means)
            precision = self._precision(~near)
            smoothed = self._smoothed(precision)
            t, r = (np.clip(v[held], v[~near].min(), v[~near].max()) for v in (h.t, h.r))
            x = h.basis.columns(t, r, self.map.structure.columns)
            left, cells = self._left(x, self.table[held], smoothed), mean_cells(h.means.select(held), self.average_s)
            averaged = np.stack([cells.mean(column) for column in left.T], axis=1)
            found.append(_Piece(self._normal(precision, smoothed), averaged))
        return found

    def squares(self, pieces: Sequence[_Piece], chosen: Sequence[str]) -> FloatArray:
        """Return the mean square that is expected on every piece with some regressors, (deg/h)^2."""
        left = (piece.left @ self._mix(piece.normal, chosen) for piece in pieces)
        return np.array([expected_square(residual, self._noise_dph) for residual in left])

    def weights(self, chosen: Sequence[str]) -> dict[str, FloatArray]:
        """Return the weights of regressors from the whole history."""
        mix = self._whole_mix(chosen)
        return {name: -mix[self.place[name]] for name in chosen}

    @cached_property
    def _noise_dph(self) -> float:
        """Noise of an average on a piece, by what map and all regressors leave, as what these explain is no noise."""
        left = self.residuals() @ self._whole_mix(list(self.place))
        return floor_dph(self.history.means, left, max(self.average_s, MEAN_S))

    def _whole_mix(self, chosen: Sequence[str]) -> FloatArray:
        """Return the mix of the whole history."""
        precision = self._precision(np.ones(len(self.history.y), dtype=bool))
        return self._mix(self._normal(precision, self._smoothed(precision)), chosen)

    def _precision(self, mask: BoolArray) -> FloatArray:
        """Return products of map columns, bias and regressors, with what power-ons have of their own integrated out."""
        h, one = self.history, self.map
        n, own, noise = one.structure.columns, one.structure.own, one.sigma**2
        total = np.zeros((n + self.table.shape[1],) * 2)
        for g in range(h.count):
            mine = mask & h.kept & (h.power_on == g)
            both = np.hstack([h.columns[mine, :n], self.table[mine]])
            products = (both * h.weight[mine, None]).T @ both
            if own:
                inner = np.diag(noise / one.scatter) + products[:own, :own]
                products -= products[:, :own] @ np.linalg.solve(inner, products[:own])
            total += products
        return total

    def _smoothed(self, precision: FloatArray) -> FloatArray:
        """Return the coefficients of the map for the bias and for every regressor, shape (columns, 1 + k)."""
        n, one = self.map.structure.columns, self.map
        root = np.sqrt(one.structure.variances(one.p, one.basis)[0])
        scaled = root[:, None] * precision[:n, :n] * root + one.sigma**2 * np.eye(n)
        return np.asarray(root[:, None] * np.linalg.solve(scaled, root[:, None] * precision[:n, n:]))

    def _normal(self, precision: FloatArray, smoothed: FloatArray) -> FloatArray:
        """Return the normal equations of bias and regressors with the map projected out."""
        n = self.map.structure.columns
        normal = precision[n:, n:] - precision[n:, :n] @ smoothed
        return np.asarray(0.5 * (normal + normal.T))

    def _left(self, x: FloatArray, table: FloatArray, smoothed: FloatArray) -> FloatArray:
        return np.asarray(table - x @ smoothed)

    def _mix(self, normal: FloatArray, chosen: Sequence[str]) -> FloatArray:
        """Return 1 for the bias and minus the weights for the columns of regressors, shape (1 + k,)."""
        mix = np.zeros(len(normal))
        mix[0] = 1.0
        at = np.concatenate([self.place[name] for name in chosen]) if chosen else np.zeros(0, dtype=np.int64)
        if at.size:
            own = normal[np.ix_(at, at)]
            size = np.sqrt(np.maximum(np.diag(own), np.finfo(np.float64).tiny))
            solved = np.linalg.lstsq(own / np.outer(size, size), normal[at, 0] / size, rcond=1e-10)[0]
            mix[at] = -solved / size
        return mix


def _places(means: TrainingData, kept: TrainingData) -> NDArray[np.intp]:
    """Return the places of means in a series from which copies of runs were dropped."""
    if len(means) == len(kept):
        return np.arange(len(means))
    return np.flatnonzero(np.isin(means.run, np.unique(kept.run)))
