"""Corrections without a search, and parts beside the map, chosen by thermal history that was left out.

The samples are y = map(T, dT/dt) + Σ columns β + noise. With the map as a Gaussian process of known parameters the
weights are those of generalised least squares, β = (Uᵀ E U + Λ)⁻¹ Uᵀ E y, E v = v less the process conditioned on v
(partial linear models; Speckman, J. Royal Statistical Society B 50, 1988). E is applied to every column once for each
stretch that is left out; after that any set of parts costs a small linear system.

Choice: forward, then the fewest parts that are not worse than the best number of them by more than one standard error
of the paired difference over pieces of history, in score and in mean square; and with these the correction must be
better than without any by a t test over pieces, or, where only noise is left, by the likelihood of what was not seen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from .data import (
    MIN_LOG_LIKELIHOOD_GAIN,
    Fold,
    Scaling,
    TrainingData,
    average_samples,
    more_than_its_error,
    pieces,
    surely_above_0,
    unseen_log_likelihood,
)
from .evidence import MEAN_S, Process, conditioned, difference_sigma, fit_process

_ROUNDS = 2  # of process and weights in turn: a third moves the weights of simulated gyros by less than 1 %


@dataclass(frozen=True)
class Parts:
    """Candidates: groups of columns at every sample, shape (n, k) each, and the ridge on the weights of each.

    A column of a ridge 0 is free; else the prior variance of its weight is 1/ridge, in noise variances.
    `rivals` of a part are never taken beside it.
    """

    columns: Mapping[str, FloatArray]
    ridge: Mapping[str, float] = field(default_factory=dict)
    rivals: Mapping[str, frozenset[str]] = field(default_factory=dict)


@dataclass(frozen=True)
class PartsTrial:
    """What was chosen.

    Attributes:
        chosen: Names in the order in which they were taken.
        weights: Of the columns of each chosen part, deg/h per unit.
        left_out_rms_dph: RMS over the stretches left out (all counting alike) with none, one, two, ... of them.
        gain_dph2: For every part that was tried beside the chosen ones: by how much the mean square would fall.
        stretches: Number of stretches.
    """

    chosen: tuple[str, ...]
    weights: dict[str, FloatArray]
    left_out_rms_dph: tuple[float, ...]
    gain_dph2: dict[str, float]
    stretches: int


@dataclass(frozen=True)
class _Fold:
    """Of a stretch: normal equations of the rest, and what the process leaves of each column on the stretch."""

    normal: FloatArray  # Uᵀ E U with y as its first column, shape (1 + k, 1 + k)
    left: FloatArray  # shape (means, 1 + k)
    weight: FloatArray


def chosen_parts(samples: TrainingData, scaling: Scaling, parts: Parts, average_s: float, most: int) -> PartsTrial:
    """Chooses parts one after the other.

    Args:
        samples: Samples as `cleaned` returns them.
        scaling: Scaling of them.
        parts: Candidates at these samples.
        average_s: Averaging of what is judged, s.
        most: Largest number of parts.

    Raises:
        TrainingFailed: The process cannot be fitted.
    """
    course = _Course.of(samples, scaling, parts, average_s)
    return _settled(course, lambda folds: course.choose(folds, most))


def bent_parts(
    samples: TrainingData,
    scaling: Scaling,
    parts: Parts,
    plain: PartsTrial,
    richer: Mapping[str, Sequence[str]],
    average_s: float,
) -> PartsTrial:
    """Chosen parts, each with one more behind it where that is earned; else `plain`.

    Earned: better by more than a standard error, as in `chosen_parts`, and by a t test over independent pieces of
    history at 5 % for all that are tried together.

    Args:
        samples: Samples as `cleaned` returns them.
        scaling: Scaling of them.
        parts: The chosen parts and all that may stand behind them, at these samples.
        plain: What was chosen.
        richer: For every chosen part those of which one may stand behind it, the simplest first.
        average_s: Averaging of what is judged, s.

    Raises:
        TrainingFailed: The process cannot be fitted.
    """
    course = _Course.of(samples, scaling, parts, average_s)
    trial = _settled(course, lambda folds: course.bent(folds, plain.chosen, richer), plain)
    return plain if trial.chosen == plain.chosen else replace(trial, gain_dph2=plain.gain_dph2)


def _settled(
    course: _Course, choose: Callable[[Sequence[_Fold]], list[str]], start: PartsTrial | None = None
) -> PartsTrial:
    """Process, choice and weights in turn, until what there was at the start is chosen again."""
    samples, scaling, parts = course.samples, course.scaling, course.parts
    chosen: list[str] = []
    weights = dict(start.weights) if start else {}
    for _ in range(_ROUNDS):
        added = course.added(weights)
        process = fit_process(replace(samples, bias_dph=samples.bias_dph - added), scaling)
        folds = [course.fold(process, one) for one in course.folds]
        chosen = choose(folds)
        if start and tuple(chosen) == start.chosen:
            return start
        weights = course.weights(process, chosen)
    path = [course.squares(folds, chosen[:k]) for k in range(len(chosen) + 1)]
    last = path[-1].mean() if len(course.folds) else 0.0
    gain = {
        name: float(last - course.squares(folds, [*chosen, name]).mean())
        for name in parts.columns
        if name not in chosen and len(course.folds)
    }
    rms = tuple(float(np.sqrt(square.mean())) for square in path) if len(course.folds) else ()
    return PartsTrial(tuple(chosen), weights, rms, gain, len(course.folds))


@dataclass(frozen=True)
class _Course:
    """Means of samples and columns, and the stretches."""

    samples: TrainingData
    means: TrainingData
    scaling: Scaling
    parts: Parts
    names: tuple[str, ...]
    table: FloatArray  # bias and all columns as means, shape (m, 1 + k)
    where: Mapping[str, NDArray[np.int64]]  # columns of each part in `table`
    folds: Sequence[Fold]
    average_s: float
    noise_dph: float

    @classmethod
    def of(cls, samples: TrainingData, scaling: Scaling, parts: Parts, average_s: float) -> _Course:
        means = average_samples(samples, MEAN_S)
        columns, where, at = [means.bias_dph], {}, 1
        for name, values in parts.columns.items():
            columns += [average_samples(replace(samples, bias_dph=column), MEAN_S).bias_dph for column in values.T]
            where[name] = np.arange(at, len(columns))
            at = len(columns)
        folds = pieces(means)
        judged = average_samples(means, average_s)
        noise = difference_sigma(judged, judged.bias_dph, judged.weight / np.median(judged.weight))
        table = np.stack(columns, axis=1)
        names = tuple(parts.columns)
        return cls(samples, means, scaling, parts, names, table, where, folds, average_s, noise)

    def added(self, weights: Mapping[str, FloatArray]) -> FloatArray:
        """What parts add to every sample, deg/h, shape (n,)."""
        total = np.zeros(len(self.samples))
        for name, beta in weights.items():
            total = total + self.parts.columns[name] @ beta
        return total

    def fold(self, process: Process, fold: Fold) -> _Fold:
        """Normal equations without a stretch, and what is left on it."""
        rest, held = np.ones(len(self.means), dtype=bool), np.zeros(len(self.means), dtype=bool)
        rest[fold.near], held[fold.held] = False, True
        inside, left = self._less_map(process, rest, held)
        weight = self.means.weight[rest] / np.median(self.means.weight)
        normal = (self.table[rest] * weight[:, None]).T @ inside
        return _Fold(0.5 * (normal + normal.T), self._averaged(held, left), self._weight(held))

    def _less_map(
        self, process: Process, rest: NDArray[np.bool_], held: NDArray[np.bool_]
    ) -> tuple[FloatArray, FloatArray]:
        """All columns less the process that has seen them on `rest`, there and on `held`."""
        t, r = self.scaling.normalise(self.means.temperature_c, self.means.slope_c_per_min)
        low, high = (f([t[rest], r[rest]], axis=1) for f in (np.min, np.max))
        at = np.clip(t[held], low[0], high[0]), np.clip(r[held], low[1], high[1])
        inside, left = [], []
        for column in self.table.T:
            # The process has the spread of the bias: a column in other units is brought to it, and back.
            size = float(np.std(column[rest])) / process.spread or 1.0
            mean = conditioned(process, t[rest], r[rest], column[rest] / size, self.means.weight[rest])
            inside.append(column[rest] - size * mean(t[rest], r[rest]))
            left.append(column[held] - size * mean(*at))
        return np.stack(inside, axis=1), np.stack(left, axis=1)

    def _averaged(self, held: NDArray[np.bool_], columns: FloatArray) -> FloatArray:
        of = self.means.select(held)
        return np.stack([average_samples(replace(of, bias_dph=c), self.average_s).bias_dph for c in columns.T], axis=1)

    def _weight(self, held: NDArray[np.bool_]) -> FloatArray:
        return average_samples(self.means.select(held), self.average_s).weight

    def squares(self, folds: Sequence[_Fold], chosen: Sequence[str]) -> FloatArray:
        """Mean square on every stretch with some parts, (deg/h)², shape (folds,)."""
        return np.array(
            [np.average((fold.left @ self._mix(fold.normal, chosen)) ** 2, weights=fold.weight) for fold in folds]
        )

    def _mix(self, normal: FloatArray, chosen: Sequence[str]) -> FloatArray:
        """1 for the bias and −β for the columns, shape (1 + k,)."""
        mix = np.zeros(len(normal))
        mix[0] = 1.0
        at = np.concatenate([self.where[name] for name in chosen]) if chosen else np.zeros(0, dtype=np.int64)
        if at.size:
            own = normal[np.ix_(at, at)] + np.diag(self._ridge(chosen))
            size = np.sqrt(np.maximum(np.diag(own), np.finfo(np.float64).tiny))
            solved = np.linalg.lstsq(own / np.outer(size, size), normal[at, 0] / size, rcond=1e-10)[0]
            mix[at] = -solved / size
        return mix

    def _ridge(self, chosen: Sequence[str]) -> FloatArray:
        return np.concatenate([np.full(len(self.where[n]), self.parts.ridge.get(n, 0.0)) for n in chosen])

    def choose(self, folds: Sequence[_Fold], most: int) -> list[str]:
        """Parts by forward selection; of the way so found the shortest that is not clearly worse than the best."""
        taken: list[str] = []
        if len(folds) < 2:
            return taken
        way = [self.squares(folds, taken)]
        while len(taken) < most:
            tried = {n: self.squares(folds, [*taken, n]) for n in self._open(taken)}
            if not tried:
                break
            taken.append(min(tried, key=lambda n: float(self._score(tried[n]).mean())))
            way.append(tried[taken[-1]])
        best = min(way, key=lambda square: float(self._score(square).mean()))
        count = next(k for k, square in enumerate(way) if not self._clearly_worse(square, best))
        return taken[:count] if self._surely_better(way[count], way[0]) else []

    def bent(self, folds: Sequence[_Fold], plain: Sequence[str], richer: Mapping[str, Sequence[str]]) -> list[str]:
        """These parts, the most earned first with one more behind: the simplest not clearly worse than the best."""
        chosen, left, count = list(plain), dict(richer), sum(map(len, richer.values()))
        while left and len(folds) >= 2:
            now = self.squares(folds, chosen)
            tried = {n: self.squares(folds, [*chosen, n]) for others in left.values() for n in others}
            earned = {n: square for n, square in tried.items() if self._earned(square, now, count)}
            if not earned:
                break
            best = min(earned, key=lambda n: float(self._score(earned[n]).mean()))
            name = next(name for name, others in left.items() if best in others)
            own = [n for n in left.pop(name) if n in earned]
            simplest = next(n for n in own if not self._clearly_worse(earned[n], earned[best]))
            chosen.insert(chosen.index(name) + 1, simplest)
        return chosen

    def _earned(self, beside: FloatArray, without: FloatArray, tried: int) -> bool:
        """Of one of as many that are tried."""
        gain = self._score(without) - self._score(beside)
        return self._clearly_worse(without, beside) and surely_above_0(gain, tried)

    def _open(self, taken: Sequence[str]) -> list[str]:
        """Parts that may still be taken."""
        closed = set(taken).union(*(self.parts.rivals.get(name, frozenset()) for name in taken))
        return [name for name in self.names if name not in closed]

    def _score(self, square: FloatArray) -> FloatArray:
        return np.asarray(0.5 * np.log(square + self.noise_dph**2))

    def _clearly_worse(self, square: FloatArray, best: FloatArray) -> bool:
        """By more than a standard error of the paired difference over pieces, in score and in mean square."""
        return more_than_its_error(self._score(square) - self._score(best), square - best)

    def _surely_better(self, beside: FloatArray, without: FloatArray) -> bool:
        """By a t test over pieces; where only noise is left, by the likelihood of what was not seen."""
        count = np.array([float(self._averaged_count(fold)) for fold in self.folds])
        likely = [unseen_log_likelihood(square, count, self.noise_dph) for square in (beside, without)]
        if likely[0] is not None:
            return likely[1] is None or likely[0] > likely[1] + MIN_LOG_LIKELIHOOD_GAIN
        return surely_above_0(self._score(without) - self._score(beside))

    def _averaged_count(self, fold: Fold) -> int:
        return len(average_samples(self.means.select(fold.held), self.average_s))

    def weights(self, process: Process, chosen: Sequence[str]) -> dict[str, FloatArray]:
        """Weights of the chosen parts from all means."""
        everything = np.ones(len(self.means), dtype=bool)
        inside, _ = self._less_map(process, everything, everything)
        weight = self.means.weight / np.median(self.means.weight)
        normal = (self.table * weight[:, None]).T @ inside
        mix = self._mix(0.5 * (normal + normal.T), chosen)
        return {name: -mix[self.where[name]] for name in chosen}
