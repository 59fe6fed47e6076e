"""Training samples: what comes in, what is refused, how it is gathered for the solvers, what is left out in turn.

`pieces` is what model selection is chosen by: whole runs, of a single run its branches; never random samples, which lie
between samples that were seen, and no two that overlap, which would count one stretch of history twice.

`training_spans` is what a model of few runs is judged by: with fewer than three runs, whole runs are too few to learn
from the rest. A run is cut at the turning points of its temperature (where smoothed dT/dt changes sign: the branches
of a cycle, at least 5 minutes each), or, where it has none, into five parts of equal length. Samples within a guard
gap of a span are not trained on while it is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.metrics import median
from ..recordings.records import Run
from ..results.training import SpanLeftOut

# Floors of the scale, so that a constant input is not divided by 0.
MIN_HALF_RANGE_C = 1.0
MIN_HALF_RANGE_C_PER_MIN = 0.05  # rates of a chamber at rest must not be blown up to a whole range
_MOST_PLACES = 2**16  # of a table by cell: more, of inputs far beyond the range, are sorted instead
_BINS_PER_HALF_RANGE = 50  # 1 C x 0.1 C/min over the paper's envelope


@dataclass(frozen=True, slots=True)
class TrainingData:
    """Samples of one axis, all arrays of shape (n,).

    Attributes:
        temperature_c: Temperature in force during the sample, C.
        slope_c_per_min: Temperature rate in force, C/min.
        bias_dph: Mean measured bias over the sample, deg/h.
        weight: Relative weight, > 0 (for example the number of rows behind it).
        run: Index of the run that it belongs to.
        time_s: Start of the sample on the run's clock, s.
        duration_s: Length of the sample, s.
    """

    temperature_c: FloatArray
    slope_c_per_min: FloatArray
    bias_dph: FloatArray
    weight: FloatArray
    run: NDArray[np.int64]
    time_s: FloatArray
    duration_s: FloatArray

    def __len__(self) -> int:
        return len(self.bias_dph)

    def select(self, mask: NDArray[np.bool_] | NDArray[np.intp]) -> TrainingData:
        """The samples of a mask or of indices."""
        return TrainingData(**{name: getattr(self, name)[mask] for name in self.__slots__})


@dataclass(frozen=True, slots=True)
class Scaling:
    """Normalisation of the inputs and the range that they had in training."""

    center_c: float
    half_range_c: float
    half_range_c_per_min: float
    temperature_c: tuple[float, float]
    slope_c_per_min: tuple[float, float]

    def normalise(self, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(z_T, z_r) of inputs in C and C/min, not clamped."""
        return (temperature_c - self.center_c) / self.half_range_c, slope_c_per_min / self.half_range_c_per_min


@dataclass(frozen=True, slots=True)
class Bins:
    """Samples gathered into cells of the normalised input plane; arrays of shape (bins,)."""

    t: FloatArray
    r: FloatArray
    count: FloatArray
    mean: FloatArray
    within: float
    samples: float


def joined(parts: Sequence[TrainingData]) -> TrainingData:
    """Samples of several parts as one, in their order."""
    names = TrainingData.__slots__
    return TrainingData(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def cleaned_samples(data: TrainingData) -> TrainingData:
    """Checks, sorts by run and time, drops exact duplicates; slopes and temperatures keep their values.

    Raises:
        InputError: Lengths differ, nothing is there, a value is not finite, a weight or duration is not
            positive.
    """
    columns = _checked(data)
    run, time = np.diff(columns["run"]), np.diff(columns["time_s"])
    if np.all((run > 0) | ((run == 0) & (time > 0))):  # in order as it is
        run_of = columns.pop("run").astype(np.int64)
        return TrainingData(run=run_of, **columns)
    keys = ("run", "time_s", "temperature_c", "slope_c_per_min", "bias_dph")  # the first counts most
    order = np.lexsort([columns[name] for name in reversed(keys)])
    same = np.all([np.diff(columns[name][order]) == 0 for name in keys], axis=0)
    first = np.r_[True, ~same]
    kept = {name: column[order][first] for name, column in columns.items() if name != "run"}
    return TrainingData(run=columns["run"][order][first].astype(np.int64), **kept)


def _checked(data: TrainingData) -> dict[str, FloatArray]:
    """Columns by name, after the checks of `cleaned_samples`."""
    columns = {name: np.asarray(getattr(data, name), dtype=np.float64) for name in data.__slots__}
    if len({c.shape for c in columns.values()}) != 1 or columns["run"].ndim != 1:
        raise InputError("training data", "arrays differ in length", "one value of each kind for every sample")
    if len(columns["run"]) == 0:
        raise InputError("training data", "no samples", "at least one valid sample of a training run")
    for name, column in columns.items():
        wrong = ~np.isfinite(column)
        if wrong.any():
            where = f"training data, {name}, sample {int(np.argmax(wrong))}"
            raise InputError(where, repr(float(column[np.argmax(wrong)])), "a finite number")
    for name in ("weight", "duration_s"):
        if columns[name].min() <= 0.0:
            raise InputError(f"training data, {name}", repr(float(columns[name].min())), "a number above 0")
    return columns


def scaling_of(data: TrainingData) -> Scaling:
    """Centre and half range of the samples, with the floors of 1 C and 0.05 C/min."""
    t0, t1 = float(data.temperature_c.min()), float(data.temperature_c.max())
    r0, r1 = float(data.slope_c_per_min.min()), float(data.slope_c_per_min.max())
    return Scaling(
        center_c=0.5 * (t0 + t1),
        half_range_c=max(0.5 * (t1 - t0), MIN_HALF_RANGE_C),
        half_range_c_per_min=max(-r0, r1, MIN_HALF_RANGE_C_PER_MIN),
        temperature_c=(t0, t1),
        slope_c_per_min=(r0, r1),
    )


def average_samples(data: TrainingData, length_s: float) -> TrainingData:
    """Weighted means over `length_s` within each run, in cells of the run's clock; longer samples stay as they are.

    Args:
        data: Samples as `cleaned_samples` returns them.
        length_s: Length of a mean, s.

    Returns:
        One sample for each cell that holds any: means of inputs and bias, summed weight and duration.
    """
    cells = mean_cells(data, length_s)
    if cells.edges is None:
        return data
    return TrainingData(
        temperature_c=cells.mean(data.temperature_c),
        slope_c_per_min=cells.mean(data.slope_c_per_min),
        bias_dph=cells.mean(data.bias_dph),
        weight=cells.weight,
        run=data.run[cells.edges],
        time_s=data.time_s[cells.edges],
        duration_s=np.add.reduceat(data.duration_s, cells.edges),
    )


@dataclass(frozen=True, slots=True)
class MeanCells:
    """Which samples make a mean: those from an edge to the next; None: each sample is its own.

    Attributes:
        edges: First sample of each mean.
        of: Weights of the samples.
        weight: Weights of the means.
    """

    edges: NDArray[np.intp] | None
    of: FloatArray
    weight: FloatArray

    def mean(self, x: FloatArray) -> FloatArray:
        """Weighted means of what samples have, shape (means,)."""
        if self.edges is None:
            return x
        return np.asarray(np.add.reduceat(x * self.of, self.edges) / self.weight)


def mean_cells(data: TrainingData, length_s: float) -> MeanCells:
    """Cells of `average_samples`."""
    if _mostly_above(data.duration_s, 0.5 * length_s):
        return MeanCells(None, data.weight, data.weight)
    next_run = data.run[1:] != data.run[:-1]
    starts = np.concatenate([[0], next_run.nonzero()[0] + 1])
    origin = np.repeat(data.time_s[starts], np.diff(starts, append=len(data)))
    cell = np.floor((data.time_s - origin) / length_s + 1e-9)
    edges = np.concatenate([[0], (next_run | (cell[1:] != cell[:-1])).nonzero()[0] + 1])
    return MeanCells(edges, data.weight, np.add.reduceat(data.weight, edges))


def _mostly_above(values: FloatArray, bound: float) -> bool:
    """Whether the median is above a bound; most often all values are one."""
    if values.min() > bound:
        return True
    return bool(values.max() > bound and median(values) > bound)


def weighted_mean(values: FloatArray, weight: FloatArray) -> float:
    """That of `np.average`, whose checks cost more than it; the weights add up to more than 0."""
    return float((values * weight).sum() / weight.sum())


def bin_of(t: FloatArray, r: FloatArray) -> NDArray[np.int64]:
    """Cells of 1/50 of each half range that hold samples, numbered in order of T, then of dT/dt: that of each."""
    cell_t = np.floor(t * _BINS_PER_HALF_RANGE + 0.5).astype(np.int64)
    cell_r = np.floor(r * _BINS_PER_HALF_RANGE + 0.5).astype(np.int64)
    first_t, first_r = int(cell_t.min()), int(cell_r.min())
    width = int(cell_r.max()) - first_r + 1
    places = (int(cell_t.max()) - first_t + 1) * width
    place = (cell_t - first_t) * width + (cell_r - first_r)
    if places > _MOST_PLACES:
        return np.asarray(np.unique(place, return_inverse=True)[1], dtype=np.int64)
    there = np.zeros(places, dtype=bool)
    there[place] = True
    return np.asarray((np.cumsum(there) - 1)[place])


def gather(t: FloatArray, r: FloatArray, y: FloatArray, weight: FloatArray) -> Bins:
    """Gathers samples at normalised inputs into cells of 1/50 of each half range.

    `weight` is in units of one sample: the noise variance of a sample of weight w is σ²/w.
    """
    index = bin_of(t, r)
    count = np.asarray(np.bincount(index, weight), dtype=np.float64)
    mean = np.bincount(index, weight * y) / count
    return Bins(
        t=np.bincount(index, weight * t) / count,
        r=np.bincount(index, weight * r) / count,
        count=count,
        mean=mean,
        within=float(np.dot(weight, (y - mean[index]) ** 2)),
        samples=float(len(y)),
    )


MIN_LOG_LIKELIHOOD_GAIN = 3.0  # of log-likelihoods on unseen means: twenty to one for what is richer

_SIGNIFICANCE = 0.025  # of the t test: docs/training.md, section 2


def more_than_its_error(*differences: FloatArray) -> bool:
    """Whether the mean of each of these, one entry a stretch, is above its standard error."""
    return not any(d.mean() <= d.std(ddof=1) / np.sqrt(len(d)) for d in differences)


def t_statistic(gains: FloatArray) -> tuple[float, int]:
    """Student's t of a mean against 0, and its degrees of freedom; 0 degrees where nothing can be said."""
    if len(gains) < 2 or not np.all(np.isfinite(gains)):
        return 0.0, 0
    error = float(gains.std(ddof=1)) / float(np.sqrt(len(gains)))
    return float(gains.mean()) / max(error, 1e-12), len(gains) - 1


def surely_above_0(gains: FloatArray, tried: int = 1, significance: float = _SIGNIFICANCE) -> bool:
    """Whether the mean is above 0 by a t test, one-sided, at 2.5 % for all that are `tried` alike (Bonferroni)."""
    t, freedom = t_statistic(gains)
    return freedom > 0 and bool(t > stdtrit(freedom, 1.0 - significance / tried))


def unseen_log_likelihood(square: FloatArray, means: FloatArray, white: float) -> float | None:
    """Of pieces under white noise; None where more than noise is left on any of them.

    Pieces then differ by that noise alone, and what is known about it says more than they do.

    Args:
        square: Mean square left on each piece, shape (pieces,).
        means: Number of means in each, shape (pieces,).
        white: Standard deviation of a mean, in the unit of the root of `square`.
    """
    if len(square) == 0 or not square.max() < 2.0 * white**2:
        return None
    return -0.5 * float(means @ square) / white**2


_MOST_RUNS = 12  # left out whole, each a fit: the RMS over twelve is known to a tenth
_ENOUGH_RUNS = 3  # docs/recordings.md: fewer are cut into spans
_EQUAL_PARTS = 5  # docs/training.md, section 2: of a single run without turning points
_SHORTEST_BRANCH_S = 300.0  # docs/recordings.md: branches of at least five minutes
_SMOOTHING_S = 60.0  # a thermometer's noise is averaged, a turn of a chamber stays
_GUARD_S = 100.0  # docs/training.md, section 2: as long as the means that are judged
_SMALLEST_TURN_C = 1.0  # a smaller swing of temperature is noise or control, not a branch
_SMALLEST_TURN_SHARE = 0.05  # of the span: smaller turns are the control of a chamber
_LEAST_REST = 8  # samples that must remain to train on


class Samples(Protocol):
    """Training samples in order of time within each run; arrays of one length."""

    @property
    def temperature_c(self) -> FloatArray: ...
    @property
    def time_s(self) -> FloatArray: ...
    @property
    def run(self) -> NDArray[np.int64]: ...


@dataclass(frozen=True, slots=True)
class RunSpan:
    """A part of one training run: from_s <= t < to_s on the file's clock.

    Attributes:
        run: Index of the run among the training runs.
        file: Its file.
        kind: "branch" between two turning points of the temperature, "part" of equal length, or the whole "run".
        guard_s: Samples this near outside are not trained on while the span is left out, s.
    """

    run: int
    file: str
    from_s: float
    to_s: float
    kind: Literal["branch", "part", "run"]
    guard_s: float

    def contains(self, run: NDArray[np.int64], time_s: FloatArray, *, guard: bool = False) -> NDArray[np.bool_]:
        """Which samples lie in the span, with `guard` also those in the guard gap around it."""
        gap = self.guard_s if guard else 0.0
        return np.asarray((run == self.run) & (time_s >= self.from_s - gap) & (time_s < self.to_s + gap))

    def result(self) -> SpanLeftOut:
        """The span as `training.json` has it."""
        return SpanLeftOut.of_object(self)

    def __str__(self) -> str:
        return f"{self.file} {self.from_s:g} ... {self.to_s:g} s ({self.kind})"


@dataclass(frozen=True, slots=True)
class Fold:
    """A piece of thermal history that is left out.

    Attributes:
        kind: What is left out.
        run: The run that it belongs to.
        held: Indices of the samples that are left out, ascending.
        near: Of these and of the samples within the guard gap of them: none of them is trained on.
    """

    kind: Literal["run", "branch", "part"]
    run: int
    held: NDArray[np.intp]
    near: NDArray[np.intp]


def edges_of(run: NDArray[np.int64]) -> NDArray[np.intp]:
    """First sample of every run, and the number of samples."""
    return np.concatenate([[0], np.flatnonzero(np.diff(run)) + 1, [len(run)]])


def pieces(samples: Samples) -> tuple[Fold, ...]:
    """Whole runs; of a single run its branches, of one that never turns five equal parts. No two of them overlap.

    Args:
        samples: In order of time within each run.
    """
    edges = edges_of(samples.run)
    found: list[Fold] = []
    for begin, end in pairwise(edges.tolist()):
        run, time = int(samples.run[begin]), samples.time_s[begin:end]
        held: list[tuple[Any, NDArray[np.intp]]] = [("run", np.arange(begin, end))]
        if len(edges) == 2:
            spans = _cut(run, "", time, samples.temperature_c)
            held = [(s.kind, np.flatnonzero(s.contains(samples.run, time))) for s in spans]
        for kind, own in held:
            near = _with_guard(samples.time_s, edges, own)
            if len(own) and edges[-1] - len(near) >= _LEAST_REST:
                found.append(Fold(kind, run, own, near))
    return tuple(found)


def _with_guard(time_s: FloatArray, edges: NDArray[np.intp], held: NDArray[np.intp]) -> NDArray[np.intp]:
    """`held` and what lies within the guard gap of it in the same run; runs without any of it cost no time."""
    of_run = np.searchsorted(held, edges)
    near = [held[:0]]
    for k in np.flatnonzero(np.diff(of_run)):
        begin, end = edges[k], edges[k + 1]
        inside = held[of_run[k] : of_run[k + 1]]
        if len(inside) < end - begin:
            time, of = time_s[begin:end], time_s[inside]
            after = np.searchsorted(of, time)
            gap = np.minimum(
                np.abs(time - of[np.minimum(after, len(of) - 1)]), np.abs(time - of[np.maximum(after - 1, 0)])
            )
            inside = begin + np.flatnonzero(gap < _GUARD_S)
        near.append(inside)
    return np.concatenate(near)


def training_spans(runs: Sequence[Run], samples: Samples) -> tuple[RunSpan, ...]:
    """Spans of the training runs; none where three runs or more can be left out whole.

    Args:
        runs: The training runs, in the order of `samples.run`.
        samples: Samples of these runs.
    """
    if len(runs) >= _ENOUGH_RUNS:
        return ()
    spans: list[RunSpan] = []
    for index, run in enumerate(runs):
        mine = samples.run == index
        if mine.any():
            spans += _cut(index, run.file, samples.time_s[mine], samples.temperature_c[mine])
    return tuple(spans)


def whole_runs(runs: Sequence[Run], samples: Samples) -> tuple[RunSpan, ...]:
    """Whole training runs to be left out in turn; of many runs some of them, evenly chosen.

    Args:
        runs: The training runs, in the order of `samples.run`.
        samples: Samples of these runs.
    """
    some = np.unique(np.linspace(0, len(runs) - 1, min(len(runs), _MOST_RUNS)).round().astype(int)).tolist()
    mine = {index: samples.time_s[samples.run == index] for index in some}
    return tuple(
        RunSpan(index, runs[index].file, float(time[0]), float(time[-1]) + runs[index].row_period_s, "run", 0.0)
        for index, time in mine.items()
        if time.size
    )


def _cut(index: int, file: str, time_s: FloatArray, temperature_c: FloatArray) -> list[RunSpan]:
    step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    start, end = float(time_s[0]), float(time_s[-1]) + step
    turns = turning_points(time_s, temperature_c)
    edges = _long_enough([start, *turns, end])
    kind: Literal["branch", "part"] = "branch"
    if len(edges) < 3:
        edges = [float(edge) for edge in np.linspace(start, end, _EQUAL_PARTS + 1)]
        kind = "part"
    return [RunSpan(index, file, a, b, kind, min(_GUARD_S, 0.25 * (b - a))) for a, b in pairwise(edges)]


def turning_points(time_s: FloatArray, temperature_c: FloatArray) -> list[float]:
    """Times at which the smoothed temperature turns by more than noise and control make it, s; arrays of shape (n,).

    Means over time about each sample smooth it, so that turns depend neither on where a record begins nor on its rows.
    """
    edges = np.append(time_s, time_s[-1] + _SMOOTHING_S)
    area = np.append(0.0, np.cumsum(temperature_c * np.diff(edges)))
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * _SMOOTHING_S
    span = np.clip([middle - half, middle + half], edges[0], edges[-1])
    smooth = np.diff(np.interp(span, edges, area), axis=0)[0] / np.diff(span, axis=0)[0]
    swing = max(_SMALLEST_TURN_C, _SMALLEST_TURN_SHARE * float(np.ptp(smooth)))
    turns: list[float] = []
    high = low = 0
    going = 0
    for k, value in enumerate(smooth):
        high = k if value > smooth[high] else high
        low = k if value < smooth[low] else low
        if going >= 0 and value < smooth[high] - swing:
            turns += [float(time_s[high])] * (going > 0)
            going, low = -1, k
        elif going <= 0 and value > smooth[low] + swing:
            turns += [float(time_s[low])] * (going < 0)
            going, high = 1, k
    return turns


def _long_enough(edges: list[float]) -> list[float]:
    """Edges without those that would end a branch shorter than five minutes; it joins its neighbour."""
    kept = [edges[0]]
    for edge in edges[1:-1]:
        if edge - kept[-1] >= _SHORTEST_BRANCH_S and edges[-1] - edge >= _SHORTEST_BRANCH_S:
            kept.append(edge)
    return [*kept, edges[-1]]
