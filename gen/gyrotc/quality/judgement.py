"""Judge the rows of runs: which may be used, why the others are left out, and what happened.

This is the one judgement of rows. `check` prints it; training, diagnosis, evaluation and fleets read it. Training and
test runs are treated alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import BoolArray, FloatArray, IntArray, steps_are, those
from ..common.metrics import MAD_TO_SIGMA, median
from ..recordings.records import Rows, Run, joined_runs
from .jumps import jumps
from .noise import noise_parts
from .odds import CELL_S, GAP_S, MIN_JUMP_C, USELESS_NOISE, Column, Event, EventKind
from .outlying import outlying
from .repeats import piles, resolution, stuck
from .smooth_rate import smooth_rate

_T = TypeVar("_T", bound=np.generic)
# Reasons for which a row is left out, in the order in which they are tried; each row has one.
REASONS = (
    "excluded", "no rate", "no temperature", "rate stuck", "rate at end stop", "temperature stuck",
    "temperature outlier", "rate outlier", "rate too noisy",
)  # fmt: skip
# Steps of the temperature from row to row at their 95 % quantile, times this: an outlier of it is larger.
_ABOVE_STEPS = 3.0
_ON_RAMPS = 0.95
# The steps at both ends of an outlier of the temperature, as shares of its size, at least.
_EDGES = 0.5
# Differences of neighbouring rates that the noise of a row is estimated from.
_NOISE_ROWS = 2**18


class LeftOut(NamedTuple):
    """A stretch of rows that are left out.

    First row of the file (0 is the first), row after the last, times of the first and of the last row (s), reason.
    """

    first: int
    end: int
    time_s: tuple[float, float]
    reason: str


@dataclass(frozen=True, slots=True)
class Judgement:
    """What is known of the rows of one run.

    Attributes:
        run: The run; spans of one file that touch are one.
        read: Rows of the file between the start and the end of the run.
        left_out: Stretches of these rows that are left out, in order.
        events: What happened, in order of time.
        noise_dph: Noise of a row, deg/h; 0 for fewer than three rows.
    """

    run: Run
    read: int
    left_out: tuple[LeftOut, ...]
    events: tuple[Event, ...]
    noise_dph: float

    def count(self) -> dict[str, int]:
        """Return how many rows are left out, by reason."""
        count = dict.fromkeys(REASONS, 0)
        for one in self.left_out:
            count[one.reason] += one.end - one.first
        return {reason: rows for reason, rows in count.items() if rows}

    @property
    def kept(self) -> int:
        """Rows that may be used."""
        return self.read - sum(one.end - one.first for one in self.left_out)


@dataclass(frozen=True, slots=True)
class Judged:
    """The judgements of all runs of a data set."""

    runs: tuple[Judgement, ...]

    def of(self, run: Run) -> Judgement:
        """Return the judgement of the run that has the rows of this one."""
        start = -np.inf if run.from_s is None else run.from_s
        for one in self.runs:
            if (one.run.file, one.run.role) != (run.file, run.role):
                continue
            first = -np.inf if one.run.from_s is None else one.run.from_s
            if first <= start and (one.run.to_s is None or start < one.run.to_s):
                return one
        return judge([run]).runs[0]

    def usable(self, run: Run, rows: Rows) -> BoolArray:
        """Return which rows of the file of a run may be used for it."""
        usable = run.in_span(rows.time_s) & np.isfinite(rows.rate_dph)
        for one in self.of(run).left_out:
            usable[one.first : one.end] = False
        return np.asarray(usable)


def judge(runs: Sequence[Run]) -> Judged:
    """Judge the rows of all runs of a gyro; the rows of one run are in memory at a time."""
    return Judged(tuple(_judgement(run) for run in joined_runs(runs)))


def _judgement(run: Run) -> Judgement:
    rows = run.rows()
    column = _Columns(run, rows)
    column.judge()
    return column.judgement()


class _Columns:
    """The columns of a run while they are judged.

    Attributes:
        reason: Index of the reason of each row of the file plus one; 0: it may be used, 255: it is not of the run.
    """

    def __init__(self, run: Run, rows: Rows) -> None:
        self._run, self._rows = run, rows
        self.reason = np.zeros(len(rows), dtype=np.uint8)
        time = rows.time_s
        in_span = np.ones(len(rows), dtype=bool)
        if run.from_s is not None:
            in_span &= time >= run.from_s
        if run.to_s is not None:
            in_span &= time < run.to_s
        self._mark(~run.in_span(time), "excluded")
        self._mark(~np.isfinite(rows.rate_dph), "no rate")
        self._mark(~np.isfinite(rows.temperature_c), "no temperature")
        self.reason[~in_span] = 255
        self.events: list[Event] = []

    def _mark(self, rows: BoolArray | slice, reason: str) -> None:
        part = self.reason[rows]
        self.reason[rows] = np.where(part == 0, REASONS.index(reason) + 1, part)

    def _usable(self) -> IntArray:
        return np.flatnonzero(self.reason == 0)

    def _event(
        self,
        kind: EventKind,
        column: Column,
        rows: tuple[int, int],
        size: float,
        sigma: float,
        odds: float,
        reason: str = "",
    ) -> None:
        first, end = rows
        time = self._rows.time_s
        span = float(time[first]), float(time[min(end, len(time)) - 1])
        self.events.append(Event(kind, column, rows, span, size, sigma, odds, reason))
        if reason:
            self._mark(slice(first, end), reason)

    def judge(self) -> None:
        """Look for events of every kind."""
        if len(self._usable()) < 2:
            return
        self._gaps()
        self._stuck("temperature")
        self._temperature()
        self._stuck("rate")
        self._piles()
        self._rate()

    def _gaps(self) -> None:
        """Times without rows, other than those that are excluded."""
        time, period = self._rows.time_s, self._run.row_period_s
        inside = np.flatnonzero(self.reason != 255)
        least = max(GAP_S, 3.0 * period)
        for k in np.flatnonzero(steps_are(those(time, self.reason != 255), lambda step: step > least)).tolist():
            first, end = int(inside[k]), int(inside[k + 1])
            self._event("gap", "time", (first, end + 1), float(time[end] - time[first]), period, np.inf)

    def _stuck(self, column: Column) -> None:
        """Stretches in which a column is stuck."""
        usable, time = self._usable(), self._rows.time_s
        values = _taken(self._rows.rate_dph if column == "rate" else self._rows.temperature_c, usable)
        for one in stuck(values, needs_release=column == "temperature"):
            rows = int(usable[one.first]), int(usable[one.end - 1]) + 1
            length = float(time[rows[1] - 1] - time[rows[0]]) + self._run.row_period_s
            self._event("stuck", column, rows, length, self._run.row_period_s, one.log_odds, f"{column} stuck")

    def _piles(self) -> None:
        """Rates at an end stop."""
        usable = self._usable()
        for pile, stretches in piles(_taken(self._rows.rate_dph, usable)):
            rows = int(usable[pile.first]), int(usable[pile.end - 1]) + 1
            self._event("end_stop", "rate", rows, pile.value, 0.0, pile.log_odds)  # only some of these rows hold it
            for first, end in stretches.tolist():
                self._mark(slice(int(usable[first]), int(usable[end - 1]) + 1), "rate at end stop")

    def _temperature(self) -> None:
        """Temperatures that leave the course of the others, for a time or for good."""
        usable = self._usable()
        if len(usable) < 2:
            return
        temperature = _taken(self._rows.temperature_c, usable)
        if np.ptp(temperature) == 0.0:
            return
        steps = np.abs(np.diff(temperature))
        least = max(MIN_JUMP_C, _ABOVE_STEPS * float(np.quantile(steps, _ON_RAMPS)))
        found = [one for one in outlying(temperature, 1) if abs(one.size) > least]
        if found:
            temperature = temperature.copy()
        for one in found:
            edges = [temperature[k] - temperature[k - 1] for k in (one.first, one.end) if 0 < k < len(temperature)]
            if min(map(abs, edges)) < _EDGES * abs(one.size):
                continue  # it bends
            rows = int(usable[one.first]), int(usable[one.end - 1]) + 1
            self._event("outlier", "temperature", rows, one.size, one.sigma, one.log_odds, "temperature outlier")
            ends = temperature[max(one.first - 1, 0)], temperature[min(one.end, len(temperature) - 1)]
            temperature[one.first : one.end] = np.linspace(*ends, one.end - one.first)
        for jump in jumps(temperature, _taken(self._rows.time_s, usable), self._run.row_period_s):
            rows = int(usable[jump.first]), int(usable[jump.end - 1]) + 1
            if rows[1] - rows[0] > jump.end - jump.first:
                continue  # rows between are left out: the temperature went on meanwhile
            self._event("jump", "temperature", rows, jump.size, jump.sigma, jump.log_odds)

    def _rate(self) -> None:
        """Rates that leave the level around them and come back, and parts that are noisier or quieter than usual."""
        usable = self._usable()
        if len(usable) < 2:
            return
        rate = _taken(self._rows.rate_dph, usable)
        smooth = smooth_rate(_taken(self._rows.time_s, usable), _taken(self._rows.temperature_c, usable), rate)
        rate = rate if smooth is None else rate - smooth
        del smooth
        longest = max(int(CELL_S / self._run.row_period_s), 1)
        kept = np.ones(len(rate), dtype=bool)
        for one in outlying(rate, longest):
            rows = int(usable[one.first]), int(usable[one.end - 1]) + 1
            self._event("outlier", "rate", rows, one.size, one.sigma, one.log_odds, "rate outlier")
            kept[one.first : one.end] = False
        usable, rate = _taken(usable, np.flatnonzero(kept)), _taken(rate, np.flatnonzero(kept))
        for part in noise_parts(rate, resolution(_taken(self._rows.rate_dph, usable))):
            rows = int(usable[part.first]), int(usable[min(part.end, len(usable)) - 1]) + 1
            reason = "rate too noisy" if part.factor > USELESS_NOISE else ""
            self._event("noise", "rate", rows, part.factor, part.sigma, part.log_odds, reason)

    def judgement(self) -> Judgement:
        """Return what was found."""
        usable = self._usable()
        rate = self._rows.rate_dph[usable[:_NOISE_ROWS]]
        noise = MAD_TO_SIGMA * median(np.abs(np.diff(rate, 2))) / np.sqrt(6.0) if len(rate) > 2 else 0.0
        return Judgement(
            run=self._run,
            read=int(np.count_nonzero(self.reason != 255)),
            left_out=tuple(_stretches(self.reason, self._rows.time_s)),
            events=tuple(sorted(self.events, key=lambda one: (one.rows, one.kind))),
            noise_dph=float(noise),
        )


def _taken(values: NDArray[_T], rows: IntArray) -> NDArray[_T]:
    """Return the values of some rows; the same array if these are all."""
    return values if len(rows) == len(values) else values[rows]


def _stretches(reason: NDArray[np.uint8], time_s: FloatArray) -> Iterator[LeftOut]:
    """Yield the stretches of rows of one reason."""
    starts = np.flatnonzero(np.r_[True, reason[1:] != reason[:-1]]) if len(reason) else np.zeros(0, dtype=np.int64)
    ends = np.r_[starts[1:], len(reason)]
    for first, end in zip(starts.tolist(), ends.tolist(), strict=True):
        code = int(reason[first])
        if 0 < code < 255:
            yield LeftOut(first, end, (float(time_s[first]), float(time_s[end - 1])), REASONS[code - 1])


def count_of(judgements: Sequence[Judgement]) -> Mapping[str, int]:
    """Return how many rows of several runs are left out, by reason."""
    total = dict.fromkeys(REASONS, 0)
    for one in judgements:
        for reason, rows in one.count().items():
            total[reason] += rows
    return {reason: rows for reason, rows in total.items() if rows}
