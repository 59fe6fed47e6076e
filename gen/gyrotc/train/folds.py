"""Pieces of thermal history that are left out in turn: power-ons, of one power-on its runs, of one run its branches.

Samples between two samples that were seen are interpolated by anything, so a fold is never a random choice of samples.
No two folds overlap: a stretch of history that is left out twice would count twice. A run is cut at the turning points
of its temperature into branches; a run that never turns is cut into five equal parts. Samples within a guard gap of a
branch or part are not trained on while it is left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import BoolArray, FloatArray
from ..recordings.records import Run
from ..results.training import SpanLeftOut

FoldKind = Literal["power-on", "run", "branch", "part"]

# A run without turning points is cut into so many parts.
_EQUAL_PARTS = 5
# Shorter branches join their neighbour.
_SHORTEST_BRANCH_S = 300.0
# The temperature is averaged over this time before turning points are sought: noise is removed, turns stay.
_SMOOTHING_S = 60.0
# A smaller swing of the temperature is noise or the control of a chamber, not a branch: C, and share of the whole span.
_SMALLEST_TURN_C = 1.0
_SMALLEST_TURN_SHARE = 0.05
# Guard gap on either side of a branch or part: as long as the means that are judged.
_GUARD_S = 100.0
# Largest guard gap, as a share of the branch.
_MAX_GUARD_SHARE = 0.25
# Samples that must remain to train on.
_MIN_REMAINING = 8


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
    """Part of a run: from_s <= t < to_s on the clock of its file; `run` is the index among the training runs."""

    run: int
    from_s: float
    to_s: float

    def contains(self, samples: Samples, margin_s: float = 0.0) -> BoolArray:
        """Return which samples are in the span, or within a margin of it."""
        time = samples.time_s
        inside = (time >= self.from_s - margin_s) & (time < self.to_s + margin_s)
        return np.asarray((samples.run == self.run) & inside)


@dataclass(frozen=True, slots=True)
class Fold:
    """A piece of thermal history that is left out.

    Attributes:
        kind: What is left out.
        spans: Its parts of runs: one, or the runs of a power-on.
        guard_s: Samples this near outside are not trained on, s.
    """

    kind: FoldKind
    spans: tuple[Span, ...]
    guard_s: float = 0.0

    def held(self, samples: Samples) -> BoolArray:
        """Return which samples are left out and judged."""
        return np.asarray(np.any([span.contains(samples) for span in self.spans], axis=0))

    def near(self, samples: Samples) -> BoolArray:
        """Return which samples are not trained on: those left out, and those in the guard gap."""
        return np.asarray(np.any([span.contains(samples, self.guard_s) for span in self.spans], axis=0))

    def results(self, runs: Sequence[Run]) -> Iterator[SpanLeftOut]:
        """Yield the spans as `training.json` has them; `runs`: the training runs."""
        for span in self.spans:
            yield SpanLeftOut(
                file=runs[span.run].file, from_s=span.from_s, to_s=span.to_s, kind=self.kind, guard_s=self.guard_s
            )


def folds(samples: Samples, power_on: NDArray[np.int64] | None = None) -> tuple[Fold, ...]:
    """Return the pieces of history that are left out in turn.

    Args:
        samples: In order of run and time.
        power_on: Number of the power-on of each run, by the run's index; None: each run is one.
    """
    spans = [Span(run, *ends) for run, ends in _ends(samples).items()]
    if len(spans) == 1:
        own = samples.run == spans[0].run
        found = [*_cut(spans[0], samples.time_s[own], samples.temperature_c[own])]
    else:
        number = {span.run: span.run if power_on is None else int(power_on[span.run]) for span in spans}
        if len(set(number.values())) == 1:
            found = [Fold("run", (span,)) for span in spans]
        else:
            found = [
                Fold("run" if len(own) == 1 else "power-on", own)
                for own in (tuple(s for s in spans if number[s.run] == n) for n in dict.fromkeys(number.values()))
            ]
    total = len(samples.run)
    return tuple(f for f in found if f.held(samples).any() and total - f.near(samples).sum() >= _MIN_REMAINING)


def edges_of(run: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return the first sample of every run, and the number of samples."""
    return np.concatenate([[0], np.flatnonzero(np.diff(run)) + 1, [len(run)]])


def _ends(samples: Samples) -> dict[int, tuple[float, float]]:
    """Return where every run begins and ends, s."""
    found = {}
    for begin, end in pairwise(edges_of(samples.run).tolist()):
        time = samples.time_s[begin:end]
        step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
        found[int(samples.run[begin])] = (float(time[0]), float(time[-1]) + step)
    return found


def _cut(whole: Span, time_s: FloatArray, temperature_c: FloatArray) -> Iterator[Fold]:
    edges = _long_enough([whole.from_s, *turning_points(time_s, temperature_c), whole.to_s])
    kind: FoldKind = "branch"
    if len(edges) < 3:
        edges = [float(edge) for edge in np.linspace(whole.from_s, whole.to_s, _EQUAL_PARTS + 1)]
        kind = "part"
    for a, b in pairwise(edges):
        yield Fold(kind, (Span(whole.run, a, b),), min(_GUARD_S, _MAX_GUARD_SHARE * (b - a)))


def turning_points(time_s: FloatArray, temperature_c: FloatArray) -> list[float]:
    """Return times at which the smoothed temperature turns by more than noise and control make it, s.

    The temperature is averaged over time about each sample, so turns depend neither on where a record begins nor on
    the distance of its rows.
    """
    edges = np.append(time_s, time_s[-1] + _SMOOTHING_S)
    area = np.append(0.0, np.cumsum(temperature_c * np.diff(edges)))
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * _SMOOTHING_S
    span = np.clip([middle - half, middle + half], edges[0], edges[-1])
    smooth = np.diff(np.interp(span, edges, area), axis=0)[0] / np.diff(span, axis=0)[0]
    swing = max(_SMALLEST_TURN_C, _SMALLEST_TURN_SHARE * float(np.ptp(smooth)))
    turns: list[float] = []
    high = low = 0
    direction = 0
    for k, value in enumerate(smooth):
        high = k if value > smooth[high] else high
        low = k if value < smooth[low] else low
        if direction >= 0 and value < smooth[high] - swing:
            turns += [float(time_s[high])] * (direction > 0)
            direction, low = -1, k
        elif direction <= 0 and value > smooth[low] + swing:
            turns += [float(time_s[low])] * (direction < 0)
            direction, high = 1, k
    return turns


def _long_enough(edges: list[float]) -> list[float]:
    """Drop edges that would end a branch that is too short."""
    kept = [edges[0]]
    for edge in edges[1:-1]:
        if edge - kept[-1] >= _SHORTEST_BRANCH_S and edges[-1] - edge >= _SHORTEST_BRANCH_S:
            kept.append(edge)
    return [*kept, edges[-1]]
