"""Cuts a few training runs into spans, so that each can be left out in turn.

With fewer than three runs, whole runs are too few to learn from the rest. A run is cut at the turning points
of its temperature (where smoothed dT/dt changes sign: the branches of a cycle, at least 5 minutes each), or,
where it has none, into five parts of equal length. Samples within a guard gap of a span are not trained on
while it is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ..dataset import Run

__all__ = ["Span", "training_spans"]

Floats = NDArray[np.float64]

_ENOUGH_RUNS = 3  # docs/recordings.md: fewer are cut into spans
_EQUAL_PARTS = 5
_SHORTEST_BRANCH_S = 300.0  # docs/recordings.md: branches of at least five minutes
_SMOOTHING_S = 60.0
_GUARD_S = 100.0
_SMALLEST_TURN_C = 1.0  # a smaller swing of temperature is noise or control, not a branch
_SMALLEST_TURN_SHARE = 0.05


class Samples(Protocol):
    """Training samples in order of time within each run; arrays of one length."""

    @property
    def temperature_c(self) -> Floats: ...
    @property
    def time_s(self) -> Floats: ...
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

    def contains(self, run: NDArray[np.int64], time_s: Floats, *, guard: bool = False) -> NDArray[np.bool_]:
        """Which samples lie in the span, with `guard` also those in the guard gap around it."""
        gap = self.guard_s if guard else 0.0
        return np.asarray((run == self.run) & (time_s >= self.from_s - gap) & (time_s < self.to_s + gap))

    def to_dict(self) -> dict[str, Any]:
        """For `training.json`."""
        return {name: getattr(self, name) for name in ("file", "from_s", "to_s", "kind", "guard_s")}

    def __str__(self) -> str:
        return f"{self.file} {self.from_s:g} ... {self.to_s:g} s ({self.kind})"


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


def _cut(index: int, file: str, time_s: Floats, temperature_c: Floats) -> list[Span]:
    step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
    start, end = float(time_s[0]), float(time_s[-1]) + step
    turns = _turning_points(time_s, temperature_c)
    edges = _long_enough([start, *turns, end])
    kind: Literal["branch", "part"] = "branch"
    if len(edges) < 3:
        edges = [float(edge) for edge in np.linspace(start, end, _EQUAL_PARTS + 1)]
        kind = "part"
    return [Span(index, file, a, b, kind, min(_GUARD_S, 0.25 * (b - a))) for a, b in pairwise(edges)]


def _turning_points(time_s: Floats, temperature_c: Floats) -> list[float]:
    """Times at which the smoothed temperature turns by more than noise and control make it."""
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
