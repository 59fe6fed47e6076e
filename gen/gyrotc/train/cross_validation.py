"""Stretches of thermal history that are left out in turn, and paired comparisons over them.

`history_folds` is what model selection is chosen by: runs, power-ons, branches, the fastest rate, and the
hottest and the coldest tenth, each with a guard gap; never random samples, which lie between samples that were seen.

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
from ..recordings.records import Run
from ..results.training import SpanLeftOut

__all__ = [
    "Fold",
    "Span",
    "edges_of",
    "history_folds",
    "more_than_error_of_pieces",
    "more_than_its_error",
    "of_pieces",
    "surely_above_0",
    "t_statistic",
    "training_spans",
    "turning_points",
]

_SIGNIFICANCE = 0.05  # of the t test: docs/training.md, section 2


def more_than_its_error(*differences: FloatArray) -> bool:
    """Whether the mean of each of these, one entry a stretch, is above its standard error."""
    return not any(d.mean() <= d.std(ddof=1) / np.sqrt(len(d)) for d in differences)


def more_than_error_of_pieces(pieces: NDArray[np.int64], *differences: FloatArray) -> bool:
    """The same where stretches of one piece of history resemble each other; those of the piece -1 are left out.

    The standard error of a mean over clusters: the sums of deviations within pieces are what scatters independently
    (Liang and Zeger 1986). False with fewer than two pieces.
    """
    used = pieces >= 0
    _, index = np.unique(pieces[used], return_inverse=True)
    count = int(index.max(initial=-1)) + 1
    if count < 2:
        return False
    for d in (difference[used] for difference in differences):
        sums = np.bincount(index, d - d.mean())
        error = np.sqrt(count / (count - 1.0) * (sums**2).sum()) / len(d)
        if d.mean() <= error:
            return False
    return True


def of_pieces(values: FloatArray, pieces: NDArray[np.int64]) -> FloatArray:
    """Means over the independent pieces of history, shape (pieces,); stretches of the piece -1 belong to none."""
    used = pieces >= 0
    _, index = np.unique(pieces[used], return_inverse=True)
    return np.asarray(np.bincount(index, values[used]) / np.bincount(index))


def t_statistic(gains: FloatArray) -> tuple[float, int]:
    """Student's t of a mean against 0, and its degrees of freedom; 0 degrees where nothing can be said."""
    if len(gains) < 2 or not np.all(np.isfinite(gains)):
        return 0.0, 0
    error = float(gains.std(ddof=1)) / float(np.sqrt(len(gains)))
    return float(gains.mean()) / max(error, 1e-12), len(gains) - 1


def surely_above_0(gains: FloatArray, tried: int = 1) -> bool:
    """Whether the mean is above 0 by a t test, one-sided, at 5 % for all that are `tried` alike (Bonferroni)."""
    t, freedom = t_statistic(gains)
    return freedom > 0 and bool(t > stdtrit(freedom, 1.0 - _SIGNIFICANCE / tried))


_ENOUGH_RUNS = 3  # docs/recordings.md: fewer are cut into spans
_EQUAL_PARTS = 5  # docs/training.md, section 2: of a single run without turning points
_SHORTEST_BRANCH_S = 300.0  # docs/recordings.md: branches of at least five minutes
_SMOOTHING_S = 60.0  # a thermometer's noise is averaged, a turn of a chamber stays
_GUARD_S = 100.0  # docs/training.md, section 2: as long as the means that are judged
_SMALLEST_TURN_C = 1.0  # a smaller swing of temperature is noise or control, not a branch
_SMALLEST_TURN_SHARE = 0.05  # of the span: smaller turns are the control of a chamber
_LEAST_SPAN_C = 2.0  # less temperature than this has no branches and no ends
_TAIL_SHARE = 0.1  # of the range of temperature, at either end
_FAST_SHARE = 0.8  # of the largest |dT/dt|
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
class Span:
    """A part of one training run: from_s <= t < to_s on the file's clock.

    Attributes:
        run: Index of the run among the training runs.
        file: Its file.
        kind: "branch" between two turning points of the temperature, or "part" of equal length.
        guard_s: Samples this near outside are not trained on while the span is left out, s.
    """

    run: int
    file: str
    from_s: float
    to_s: float
    kind: Literal["branch", "part"]
    guard_s: float

    def contains(
        self, run: NDArray[np.int64], time_s: FloatArray, *, guard: bool = False
    ) -> NDArray[np.bool_]:
        """Which samples lie in the span, with `guard` also those in the guard gap around it."""
        gap = self.guard_s if guard else 0.0
        return np.asarray((run == self.run) & (time_s >= self.from_s - gap) & (time_s < self.to_s + gap))

    def result(self) -> SpanLeftOut:
        """The span as `training.json` has it."""
        return SpanLeftOut.of_object(self)

    def __str__(self) -> str:
        return f"{self.file} {self.from_s:g} ... {self.to_s:g} s ({self.kind})"


class Rated(Samples, Protocol):
    """Samples with the rate of temperature."""

    @property
    def slope_c_per_min(self) -> FloatArray: ...


@dataclass(frozen=True, slots=True)
class Fold:
    """A stretch of thermal history that is left out.

    Attributes:
        kind: What is left out.
        run: The run that it belongs to, −1 where it is a range of temperatures or rates of all runs.
        power_on: The power-on that it belongs to, −1 likewise.
        held: Indices of the samples that are left out, ascending.
        near: Of these and of the samples within the guard gap of them: none of them is trained on.
    """

    kind: Literal["run", "power_on", "branch", "part", "hottest", "coldest", "fastest"]
    run: int
    power_on: int
    held: NDArray[np.intp]
    near: NDArray[np.intp]


def edges_of(run: NDArray[np.int64]) -> NDArray[np.intp]:
    """First sample of every run, and the number of samples."""
    return np.concatenate([[0], np.flatnonzero(np.diff(run)) + 1, [len(run)]])


def history_folds(samples: Rated, power_on: NDArray[np.int64]) -> tuple[Fold, ...]:
    """Every stretch that can be left out while enough remains; in an order that does not hang on numbers of runs.

    Args:
        samples: In order of time within each run.
        power_on: Number of the power-on of every sample, shape (n,).
    """
    edges = edges_of(samples.run)
    alone = len(edges) == 2
    found: list[Fold] = []

    def add(kind: Any, held: NDArray[np.intp], run: int = -1, of: int = -1) -> None:
        near = _with_guard(samples.time_s, edges, held)
        if len(held) and len(power_on) - len(near) >= _LEAST_REST:
            found.append(Fold(kind, run, of, held, near))

    for begin, end in pairwise(edges.tolist()):
        run, of = int(samples.run[begin]), int(power_on[begin])
        time, t = samples.time_s[begin:end], samples.temperature_c[begin:end]
        if not alone:
            add("run", np.arange(begin, end), run, of)
        for span in _branches(run, time, t, alone=alone):
            add(span.kind, begin + np.flatnonzero(span.contains(samples.run[begin:end], time)), run, of)
    power_ons, number = np.unique(power_on, return_inverse=True)
    if 1 < len(power_ons) < len(edges) - 1:
        together = np.split(np.argsort(number, kind="stable"), np.cumsum(np.bincount(number))[:-1])
        for one, held in zip(power_ons, together, strict=True):
            add("power_on", held, of=int(one))
    t, rate = samples.temperature_c, np.abs(samples.slope_c_per_min)
    low, high = float(t.min()), float(t.max())
    if high - low >= _LEAST_SPAN_C:
        add("hottest", np.flatnonzero(t > high - _TAIL_SHARE * (high - low)))
        add("coldest", np.flatnonzero(t < low + _TAIL_SHARE * (high - low)))
    if rate.max() > 0.0:
        add("fastest", np.flatnonzero(rate > _FAST_SHARE * float(rate.max())))
    return tuple(found)


def _branches(run: int, time_s: FloatArray, temperature_c: FloatArray, *, alone: bool) -> list[Span]:
    """Branches of a run; of the only run parts of equal length where it has none."""
    if np.ptp(temperature_c) < _LEAST_SPAN_C and not alone:
        return []
    spans = _cut(run, "", time_s, temperature_c)
    return spans if alone or spans[0].kind == "branch" else []


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


def training_spans(runs: Sequence[Run], samples: Samples) -> tuple[Span, ...]:
    """Spans of the training runs; none where three runs or more can be left out whole.

    Args:
        runs: The training runs, in the order of `samples.run`.
        samples: Samples of these runs.
    """
    if len(runs) >= _ENOUGH_RUNS:
        return ()
    spans: list[Span] = []
    for index, run in enumerate(runs):
        mine = samples.run == index
        if mine.any():
            spans += _cut(index, run.file, samples.time_s[mine], samples.temperature_c[mine])
    return tuple(spans)


def _cut(index: int, file: str, time_s: FloatArray, temperature_c: FloatArray) -> list[Span]:
    step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    start, end = float(time_s[0]), float(time_s[-1]) + step
    turns = turning_points(time_s, temperature_c)
    edges = _long_enough([start, *turns, end])
    kind: Literal["branch", "part"] = "branch"
    if len(edges) < 3:
        edges = [float(edge) for edge in np.linspace(start, end, _EQUAL_PARTS + 1)]
        kind = "part"
    return [Span(index, file, a, b, kind, min(_GUARD_S, 0.25 * (b - a))) for a, b in pairwise(edges)]


def turning_points(time_s: FloatArray, temperature_c: FloatArray) -> list[float]:
    """Times at which the smoothed temperature turns by more than noise and control make it, s; arrays of shape (n,)."""
    cell = np.floor((time_s - time_s[0]) / _SMOOTHING_S).astype(np.int64)
    _, index = np.unique(cell, return_inverse=True)
    count = np.bincount(index)
    t = np.bincount(index, time_s) / count
    smooth = np.bincount(index, temperature_c) / count
    swing = max(_SMALLEST_TURN_C, _SMALLEST_TURN_SHARE * float(np.ptp(smooth)))
    turns: list[float] = []
    high = low = 0
    going = 0
    for k, value in enumerate(smooth):
        high = k if value > smooth[high] else high
        low = k if value < smooth[low] else low
        if going >= 0 and value < smooth[high] - swing:
            turns += [float(t[high])] * (going > 0)
            going, low = -1, k
        elif going <= 0 and value > smooth[low] + swing:
            turns += [float(t[low])] * (going < 0)
            going, high = 1, k
    return turns


def _long_enough(edges: list[float]) -> list[float]:
    """Edges without those that would end a branch shorter than five minutes; it joins its neighbour."""
    kept = [edges[0]]
    for edge in edges[1:-1]:
        if edge - kept[-1] >= _SHORTEST_BRANCH_S and edges[-1] - edge >= _SHORTEST_BRANCH_S:
            kept.append(edge)
    return [*kept, edges[-1]]
