"""The training history as the Gaussian model sees it, the smooth map over it, and what each candidate leaves unseen.

Samples are averaged over 50 s and standardised; outliers are dropped by what the smooth map leaves. The evidence of a
flexible map can be raised without limit by following every mean and calling the rest noise. So the noise that
differences of neighbouring means show bounds it: the noise is never taken to be less than a quarter of it, outliers
are measured by no less than it, and at most a tenth of the means is dropped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import BoolArray, FloatArray, parts_of
from ..common.metrics import LEAST_SPAN_C, MAD_TO_SIGMA, Averages, median
from .data import Bins, Scaling, TrainingData, average_samples, gather, mean_cells, weighted_mean
from .folds import Fold, edges_of, folds
from .gaussian import COLUMNS, FEW, Basis, GaussianMap, Structure, Sums, VarianceSearch
from .noise import difference_sigma, floor_dph

MEAN_S = 50.0
"""Length of the means of the model: 100 s would smear a ripple of 11 C at 5 C/min."""
# Residuals beyond this are outliers: a normal one in 150,000.
_TRIM_SIGMAS = 4.5
# Rounds of dropping and fitting again.
_TRIMS = 3
# If more than this share would be dropped, the map does not fit, and nothing more is dropped.
_TRIM_SHARE = 0.1
# Of the noise that differences show, less their own scatter: smaller residuals have been followed, not left.
_TRIM_NOISE = 0.8
# Smooth structure makes differences larger than the noise, hardly smaller.
_MIN_NOISE_SHARE = 0.25
# Of the spread: below it the normal equations lose their last digits.
_MIN_SIGMA = 1e-4
# Autocorrelations of what the map leaves are summed up to this lag: longer than the flicker of a gyro is correlated.
_MAX_LAG = 60
# Noise whose long means vary by less than this times that of white noise is taken as white: chance makes 1.05 of it.
_MIN_COLOUR = 1.1
# Steps of the standardised bias, so that the last digit of its unit (deg/h, rad/s) steers nothing.
_GRID = 2.0**24


class MapModel(Protocol):
    """Model of the map in standardised units: the smooth candidate, or a lot with a unit's runs."""

    @property
    def sigma(self) -> float: ...
    @property
    def freedom(self) -> float: ...
    @property
    def scales(self) -> tuple[float, float]: ...
    def mean(self, t: FloatArray, r: FloatArray) -> FloatArray: ...
    def roots(self, t: FloatArray, r: FloatArray) -> FloatArray: ...


class LinearMap(Protocol):
    """Map of the first columns of the model."""

    def without(self, power_on: int, left_out: Sums) -> FloatArray:
        """Return its coefficients without a piece of a power-on."""


@dataclass(frozen=True, slots=True)
class Asked:
    """Places at which corrections will be asked for, as a lot's units or an earlier calibration show them.

    Attributes:
        temperature_c, slope_c_per_min: Places, shape (n,).
        share: Of the time, the same shape.
        between_dph: Standard deviation of the constant from power-on to power-on, deg/h; None: it is not known.
        freedom: Degrees of freedom of it; None: many.
    """

    temperature_c: FloatArray
    slope_c_per_min: FloatArray
    share: FloatArray
    between_dph: float | None
    freedom: int | None = None


@dataclass(frozen=True)
class TrainingHistory:
    """Means of the training runs in standardised units, in order of run and time; a run given twice is in once.

    Attributes:
        samples: The samples that they are of.
        means: The means, in C, C/min and deg/h.
        t, r: Normalised inputs.
        y: Bias in units of the spread: (bias - center)/spread.
        weight: Weights, median 1.
        power_on: Number of the power-on of each mean, from 0 on.
        kept: False for outliers.
        scaling: Normalisation of the inputs.
        center, spread: deg/h.
        white: Noise of a mean of weight 1 as differences show it, in units of the spread; 0 if they show none.
        colour: Variance of long means over that which white noise would have: so many means count as one.
    """

    samples: TrainingData
    means: TrainingData
    t: FloatArray
    r: FloatArray
    y: FloatArray
    weight: FloatArray
    power_on: NDArray[np.int64]
    kept: BoolArray
    scaling: Scaling
    center: float
    spread: float
    white: float
    colour: float = 1.0

    @staticmethod
    def of(data: TrainingData, scaling: Scaling, power_on: NDArray[np.int64] | None) -> TrainingHistory:
        """Average cleaned samples; `power_on`: number of the power-on of each run, by its index."""
        means = _once(average_samples(data, MEAN_S))
        t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
        weight = means.weight / median(means.weight)
        center = weighted_mean(means.bias_dph, weight)
        spread = float(np.sqrt(weighted_mean((means.bias_dph - center) ** 2, weight))) or 1.0
        y = np.round((means.bias_dph - center) / spread * _GRID) / _GRID
        number = means.run if power_on is None else power_on[means.run]
        of = np.asarray(np.unique(number, return_inverse=True)[1], dtype=np.int64)
        kept = np.ones(len(y), dtype=bool)
        white = difference_sigma(means, y, weight)
        return TrainingHistory(data, means, t, r, y, weight, of, kept, scaling, center, spread, white)

    @cached_property
    def basis(self) -> Basis:
        return Basis.over(self.t, self.r)

    @cached_property
    def columns(self) -> FloatArray:
        """Columns of the model at the means, shape (means, columns)."""
        return self.basis.columns(self.t, self.r)

    @property
    def count(self) -> int:
        """Number of power-ons."""
        return int(self.power_on.max()) + 1

    def sums(self, mask: BoolArray) -> Sums:
        """Return the sums over means that are no outliers."""
        own = mask & self.kept
        return Sums.over(self.columns[own], self.y[own], self.weight[own]).times(1.0 / self.colour)

    def fit(self, structure: Structure, start: FloatArray | None = None) -> GaussianMap:
        """Return a candidate with its most probable variances.

        Args:
            structure: Its columns.
            start: Where the search for the variances begins; None: at the two starts of a smooth map.

        Raises:
            TrainingFailed: The equations cannot be solved.
        """
        least = max(_MIN_NOISE_SHARE * self.white, _MIN_SIGMA)
        search = VarianceSearch(structure, self.basis, self.power_ons, max(self.white, 4.0 * _MIN_SIGMA), least)
        return search.best(start)

    @cached_property
    def power_ons(self) -> tuple[Sums, ...]:
        """Sums of every power-on."""
        return tuple(self.sums(self.power_on == g) for g in range(self.count))

    def without_outliers(self, structure: Structure) -> tuple[TrainingHistory, GaussianMap]:
        """Return the history without outliers, and the map by which they were found."""
        history, start = self, None
        for round_ in range(_TRIMS + 1):
            found = history.fit(structure, start)
            residual = np.abs(history.residual(found)) * np.sqrt(self.weight)
            robust = MAD_TO_SIGMA * median(residual[history.kept])
            inside = residual <= _TRIM_SIGMAS * max(robust, _TRIM_NOISE * self.white)
            settled = round_ == _TRIMS or np.array_equal(inside, history.kept)
            if settled or np.count_nonzero(~inside) > _TRIM_SHARE * len(inside):
                break
            history, start = history._with(kept=inside), found.p
        colour = history._colour_of(found)
        if colour > _MIN_COLOUR:
            history = history._with(colour=colour)
            found = history.fit(structure, found.p)
        return history, found

    def _with(self, **changes: Any) -> TrainingHistory:
        changed = replace(self, **changes)
        changed.__dict__["columns"] = self.columns
        return changed

    def _colour_of(self, found: GaussianMap) -> float:
        """Return 1 + 2 times the sum of the autocorrelations of what the map leaves, without outliers.

        The sum ends with the first pair of lags whose correlations do not add up to more than 0 (Geyer, Statistical
        Science 7, 1992).
        """
        residual = np.where(self.kept, self.residual(found) * np.sqrt(self.weight), 0.0)
        parts = [residual[a:b] for a, b in pairwise(edges_of(self.means.run).tolist())]
        total = float(residual @ residual)
        colour = 1.0
        for lag in range(1, _MAX_LAG, 2):
            both = sum(
                float(p[lag:] @ p[:-lag]) + float(p[lag + 1 :] @ p[: -lag - 1]) for p in parts if len(p) > lag + 1
            )
            if both <= 0.0 or total <= 0.0:
                break
            colour += 2.0 * both / total
        return colour

    def residual(self, found: GaussianMap) -> FloatArray:
        """Return the bias less map and what each power-on has of its own, standardised."""
        x, own = self.columns, found.own()
        of_own = np.sum(x[:, : own.shape[1]] * own[self.power_on], axis=1)
        return np.asarray(self.y - x[:, : found.structure.columns] @ found.coefficients - of_own)

    def noise_dph(self, found: GaussianMap, average_s: float) -> float:
        """Return the noise of the averages that `unseen` judges, deg/h.

        It is that of differences of what a map leaves on neighbouring averages. Differences of the bias itself would
        count the change of the map as noise.
        """
        if average_s >= MEAN_S:
            return floor_dph(self.means, self.spread * self.residual(found), average_s)
        samples, n = self.samples, found.structure.columns
        t, r = self.scaling.normalise(samples.temperature_c, samples.slope_c_per_min)
        of_map = [self.basis.columns(t[part], r[part], n) @ found.coefficients for part in parts_of(len(t))]
        return floor_dph(samples, samples.bias_dph - self.spread * np.concatenate(of_map), average_s)

    @cached_property
    def folds(self) -> tuple[Fold, ...]:
        """Pieces that are left out in turn."""
        return folds(self.means, self._power_on_of_runs)

    @property
    def _power_on_of_runs(self) -> NDArray[np.int64]:
        of = np.zeros(int(self.means.run.max()) + 1, dtype=np.int64)
        of[self.means.run] = self.power_on
        return of

    def unseen(self, found: Sequence[LinearMap], average_s: float) -> list[list[Averages]]:
        """Return what maps leave on each piece without having seen it, deg/h: for each piece one entry a map.

        Inputs are limited to the range of the rest, as a table limits them.
        """
        return [self._unseen(fold, found, average_s) for fold in self.folds]

    def _unseen(self, fold: Fold, found: Sequence[LinearMap], average_s: float) -> list[Averages]:
        held = fold.held(self.means)
        near = fold.near(self.means) if fold.guard_s else held
        power_on, rest = int(self.power_on[np.argmax(held)]), ~near
        piece = self.means.select(held) if average_s >= MEAN_S else self.samples.select(fold.held(self.samples))
        inputs = zip(self.scaling.normalise(piece.temperature_c, piece.slope_c_per_min), (self.t, self.r), strict=True)
        t, r = (np.clip(x, seen[rest].min(), seen[rest].max()) for x, seen in inputs)
        flat = float(np.ptp(self.means.temperature_c[rest])) < LEAST_SPAN_C
        x, left_out = self.basis.columns(t, r), self.sums(near)
        results = []
        for one in found:
            b = one.without(power_on, left_out)
            b = np.r_[b[0], np.zeros(len(b) - 1)] if flat else b
            residual = piece.bias_dph - self.center - self.spread * (x[:, : len(b)] @ b)
            cells = mean_cells(piece, average_s)
            at = (cells.mean(v) for v in (piece.time_s, piece.bias_dph, residual, piece.temperature_c))
            results.append(Averages(*at))
        return results


def _once(means: TrainingData) -> TrainingData:
    """Return means without runs that are copies of an earlier one: taken twice, they would vouch for themselves."""
    seen: set[bytes] = set()
    first = np.ones(len(means), dtype=bool)
    for begin, end in pairwise(edges_of(means.run).tolist()):
        content = means.temperature_c[begin:end].tobytes() + means.bias_dph[begin:end].tobytes()
        first[begin:end] = content not in seen
        seen.add(content)
    return means if first.all() else means.select(first)


@dataclass(frozen=True, slots=True)
class Process:
    """The smooth map and the samples that it has seen.

    Attributes:
        model: The map in standardised units.
        bins: The means without outliers, gathered.
        t, r: Normalised inputs of the means.
        y: Standardised bias of the means: (bias - center)/spread.
        weight: Their weights, median 1.
        run: Their runs.
        kept: False for outliers.
        center, spread: deg/h.
        seconds: Length of a mean, s.
        colour: So many means count as one, because their noise is correlated.
        asked: With a prior: where its recordings were; None: where the samples are.
    """

    model: MapModel
    bins: Bins
    t: FloatArray
    r: FloatArray
    y: FloatArray
    weight: FloatArray
    run: NDArray[np.int64]
    kept: BoolArray
    center: float
    spread: float
    seconds: float
    colour: float = 1.0
    asked: Asked | None = None

    @staticmethod
    def of(history: TrainingHistory, model: MapModel) -> Process:
        """Return a map with the history that it has seen."""
        h = history
        k = h.kept
        bins = gather(h.t[k], h.r[k], h.y[k], h.weight[k])
        seconds = median(h.means.duration_s)
        return Process(model, bins, h.t, h.r, h.y, h.weight, h.means.run, k, h.center, h.spread, seconds, h.colour)

    def mean_dph(self, t: FloatArray, r: FloatArray) -> FloatArray:
        """Return the mean map at normalised inputs, deg/h."""
        return self.center + self.spread * self.model.mean(t, r)

    def variance_dph2(self, t: FloatArray, r: FloatArray) -> FloatArray:
        """Return the variance of the map at normalised inputs, (deg/h)^2."""
        return np.asarray(self.spread**2 * np.sum(self.model.roots(t, r) ** 2, axis=1))

    @property
    def noise_dph(self) -> float:
        """Noise of a mean of weight 1, deg/h."""
        return self.spread * self.model.sigma


def smooth(count: int) -> Structure:
    """Return the structure of the smooth candidate with so many power-ons."""
    return Structure(COLUMNS, FEW if count > 1 else 0)


def fit_process(data: TrainingData, scaling: Scaling, power_on: NDArray[np.int64] | None = None) -> Process:
    """Return the smooth map of cleaned samples.

    Args:
        power_on: Number of the power-on of each run, by its index; None: each run is one.

    Raises:
        TrainingFailed: The equations cannot be solved.
    """
    history = TrainingHistory.of(data, scaling, power_on)
    history, found = history.without_outliers(smooth(history.count))
    return Process.of(history, found)
