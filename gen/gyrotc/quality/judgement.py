"""Judge the rows of runs: which may be used, why the others are left out, and what happened.

This is the one judgement of rows. `check` prints it; training, diagnosis, evaluation and fleets read it. Training and
test runs are treated alike.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import BoolArray, FloatArray, masked, parts_of, steps_where
from ..common.metrics import quantile_of_parts
from ..common.statistics import NORMAL_95
from ..recordings.records import Dataset, Rows, Run, joined_runs
from ..recordings.records import inside as in_limits
from .changes import Change, cell_length, changes_in_cells, paired
from .curves import curve_findings
from .fits import RowArrays, RunCells, cells_of_means
from .jumps import jumps
from .noise import noise_parts
from .odds import CELL_S, GAP_S, MIN_JUMP_C, USELESS_NOISE, Column, Event, EventKind, cost_of
from .outlying import outlying
from .repeats import piles, resolution, stuck
from .smooth_rate import cell_length_of, smooth_rate

# Reasons for which a row is left out, in the order in which they are tried; each row has one.
REASONS = (
    "excluded", "no rate", "no temperature", "rate stuck", "rate at end stop", "temperature stuck",
    "temperature outlier", "rate outlier", "rate too noisy", "rate displaced",
)  # fmt: skip
# Steps of the temperature from row to row at their 95 % quantile, times this: an outlier of it is larger.
_ABOVE_STEPS = 3.0
_ON_RAMPS = 0.95
# The steps from row to row by which a temperature goes and comes back, as shares of the size of its outlier.
_STEP = 0.5
# Row periods between two rows that follow each other, at most.
_TOGETHER = 1.5


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
    """Judgement of the rows of a run.

    Attributes:
        run: The run; spans of one file that touch are one.
        read: Rows of the file between the start and the end of the run.
        absent: How many of these the file has no whole reading of, by the reason.
        span_s: Times of the first and of the last of these rows, s.
        left_out: Stretches of these rows that are left out, in order.
        events: What happened, in order of time.
        changes: Changes of the rate that last, in order of time; they are among the events.
    """

    run: Run
    read: int
    span_s: tuple[float, float]
    left_out: tuple[LeftOut, ...]
    events: tuple[Event, ...]
    changes: tuple[Change, ...] = ()
    absent: Mapping[str, int] = field(default_factory=dict)

    def count(self) -> dict[str, int]:
        """Return how many rows are left out, by reason."""
        count = Counter(dict.fromkeys(REASONS, 0))
        for one in self.left_out:
            count[one.reason] += one.end - one.first
        count.update(self.absent)
        return {reason: rows for reason, rows in count.items() if rows}

    @property
    def power_ons_s(self) -> tuple[float, ...]:
        """Times at which the gyro was switched on anew within the run, s."""
        return tuple(change.time_s[2] for change in self.changes if change.restarts)

    @property
    def kept(self) -> int:
        """Rows that may be used."""
        return self.read - sum(self.count().values())


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
        return judge_runs([run]).runs[0]

    def cut(self, runs: Sequence[Run]) -> tuple[Run, ...]:
        """Return the runs, joined where spans of a file touch and cut where the gyro was switched on anew.

        Training, diagnosis and the comparison of methods number these.
        """
        found: list[Run] = []
        for run in joined_runs(runs):
            rest = run
            for time_s in self.of(run).power_ons_s:
                if (run.from_s is None or run.from_s < time_s) and (run.to_s is None or time_s < run.to_s):
                    found.append(replace(rest, to_s=time_s))
                    rest = replace(rest, from_s=time_s, power_on_s=time_s)
            found.append(rest)
        return tuple(found)

    def usable(self, run: Run, rows: Rows) -> BoolArray:
        """Return which rows of the file of a run may be used for it."""
        usable = run.in_span(rows.time_s) & np.isfinite(rows.rate_dph)
        for one in self.of(run).left_out:
            usable[one.first : one.end] = False
        return np.asarray(usable)


def judge(dataset: Dataset) -> Judged:
    """Judge the rows of all runs of a gyro; the rows of one run are in memory at a time."""
    strange = {found.file for found in curve_findings(dataset, ()) if found.file is not None}
    return judge_runs(dataset.runs, strange)


def judge_runs(runs: Sequence[Run], strange: Collection[str] = ()) -> Judged:
    """Judge the rows of runs.

    Args:
        strange: Files whose rates are not those of the gyro in the other files, such as with another sign: changes
            that last are not looked for in them, nor are the others compared with them.
    """
    whole = joined_runs(runs)
    cell_s = cell_length(sum(run.n_rows * run.row_period_s for run in whole))
    judgements, cells = list[Judgement](), list[RunCells]()
    for run in whole:
        columns = _Columns(run, run.rows())
        columns.judge()
        judgements.append(columns.judgement())
        cells.append(columns.cells(cell_s if run.file not in strange else np.inf))
        del columns  # before the rows of the next run are read

    def rows_of(number: int) -> RowArrays:
        one, rows = judgements[number], whole[number].rows()
        usable = Judged((one,)).usable(one.run, rows)
        return rows.time_s[usable], rows.temperature_c[usable], rows.rate_dph[usable]

    changes = changes_in_cells(cells, rows_of)
    for number in sorted({change.run for change in changes}):
        of_run = tuple(change for change in changes if change.run == number)
        judgements[number] = _with_changes(judgements[number], of_run, whole[number].rows().time_s)
    return Judged(tuple(judgements))


def _with_changes(judgement: Judgement, changes: tuple[Change, ...], time_s: FloatArray) -> Judgement:
    """Return the judgement with changes that last; what comes back is left out."""
    reason = np.zeros(len(time_s), dtype=np.uint8)
    for one in judgement.left_out:
        reason[one.first : one.end] = REASONS.index(one.reason) + 1
    events = list(judgement.events)
    gaps = [event.time_s for event in events if event.kind == "gap"]
    changes = tuple(
        replace(one, restarts=one.kind == "step" and any(one.falls_into(gap) for gap in gaps)) for one in changes
    )
    for change, back in paired(changes):
        low, high = change.time_s[1], change.time_s[2] if back is None else back.time_s[2]
        first, end = np.searchsorted(time_s, (low, high), side="left").tolist()
        end = min(end + 1, len(time_s))
        kind: EventKind = "restart" if change.restarts else change.kind
        sigma = (change.size[2] - change.size[1]) / (2.0 * NORMAL_95)
        odds = 0.5 * change.sigmas**2 - cost_of(float(judgement.read))
        if back is not None:
            kind = "displaced"
            _mark(reason, slice(first, end), "rate displaced")
        why = "rate displaced" if back is not None else ""
        span = (float(time_s[first]), float(time_s[end - 1]))
        events.append(Event(kind, "rate", (first, end), span, change.size[0], sigma, odds, why))
    return replace(
        judgement,
        left_out=tuple(_stretches(reason, time_s)),
        events=tuple(sorted(events, key=lambda one: (one.rows, one.kind))),
        changes=changes,
    )


def _mark(reasons: NDArray[np.uint8], rows: BoolArray | slice, reason: str) -> None:
    """Give rows a reason for which they are left out, unless they have one."""
    part = reasons[rows]
    reasons[rows] = np.where(part == 0, REASONS.index(reason) + 1, part)


class _Columns:
    """The columns of a run while they are judged.

    Attributes:
        reason: Index of the reason of each row of the file plus one; 0: it may be used, 255: it is not of the run.
    """

    def __init__(self, run: Run, rows: Rows) -> None:
        self._run, self._rows = run, rows
        self.reason = np.zeros(len(rows), dtype=np.uint8)
        _mark(self.reason, ~run.in_span(rows.time_s), "excluded")
        _mark(self.reason, ~np.isfinite(rows.rate_dph), "no rate")
        _mark(self.reason, ~np.isfinite(rows.temperature_c), "no temperature")
        self.reason[~in_limits(rows.time_s, run.from_s, run.to_s, ())] = 255
        self.events: list[Event] = []

    def _usable(self) -> _Chosen:
        return _Chosen(self.reason == 0)

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
            _mark(self.reason, slice(first, end), reason)

    def judge(self) -> None:
        """Look for events of every kind."""
        if self._usable().count < 2:
            return
        self._gaps()
        self._stuck("temperature")
        self._temperature()
        self._stuck("rate")
        self._piles()
        self._rate()

    def _gaps(self) -> None:
        """Times without rows, other than those that are excluded."""
        inside, period = _Chosen(self.reason != 255), self._run.row_period_s
        time, least = inside.of(self._rows.time_s), max(GAP_S, 3.0 * period)
        for k in np.flatnonzero(steps_where(time, lambda step: step > least)).tolist():
            self._event("gap", "time", inside.span(k, k + 2), float(time[k + 1] - time[k]), period, np.inf)

    def _stuck(self, column: Column) -> None:
        """Stretches in which a column is stuck."""
        usable, time = self._usable(), self._rows.time_s
        values = usable.of(self._rows.rate_dph if column == "rate" else self._rows.temperature_c)
        for one in stuck(values, needs_release=column == "temperature"):
            rows = usable.span(one.first, one.end)
            length = float(time[rows[1] - 1] - time[rows[0]]) + self._run.row_period_s
            self._event("stuck", column, rows, length, self._run.row_period_s, one.log_odds, f"{column} stuck")

    def _piles(self) -> None:
        """Rates at an end stop."""
        usable = self._usable()
        for pile, stretches in piles(usable.of(self._rows.rate_dph)):
            rows = usable.span(pile.first, pile.end)
            self._event("end_stop", "rate", rows, pile.value, 0.0, pile.log_odds)  # only some of these rows hold it
            for first, end in stretches.tolist():
                _mark(self.reason, slice(*usable.span(first, end)), "rate at end stop")

    def _temperature(self) -> None:
        """Temperatures that leave the course of the others, for a time or for good."""
        usable = self._usable()
        temperature = usable.of(self._rows.temperature_c)
        if len(temperature) < 2 or np.ptp(temperature) == 0.0:
            return

        def steps() -> Iterator[FloatArray]:
            return (np.abs(np.diff(temperature[p.start : p.stop + 1])) for p in parts_of(len(temperature) - 1))

        least = max(MIN_JUMP_C, _ABOVE_STEPS * quantile_of_parts(steps, _ON_RAMPS))
        found = [one for one in outlying(temperature, 1) if abs(one.size) > least]
        if found:
            temperature = temperature.copy()
        for one in found:
            step = np.diff(temperature[max(one.first - 1, 0) : one.end + 1])
            there, back = float(step.max()), -float(step.min())
            inside = one.first > 0 and one.end < len(temperature)
            if (min(there, back) if inside else max(there, back)) < _STEP * abs(one.size):
                continue  # it bends
            rows = usable.span(one.first, one.end)
            self._event("outlier", "temperature", rows, one.size, one.sigma, one.log_odds, "temperature outlier")
            ends = temperature[max(one.first - 1, 0)], temperature[min(one.end, len(temperature) - 1)]
            temperature[one.first : one.end] = np.linspace(*ends, one.end - one.first)
        for jump in jumps(temperature, self._run.row_period_s):
            first, end = usable.span(jump.first, jump.end)
            # Where rows are missing or left out the temperature went on meanwhile
            together = float(self._rows.time_s[end - 1] - self._rows.time_s[first]) / (jump.end - jump.first)
            if together < _TOGETHER * self._run.row_period_s:
                self._event("jump", "temperature", (first, end), jump.size, jump.sigma, jump.log_odds)

    def _rate(self) -> None:
        """Rates that leave the level around them and come back, and parts that are noisier or quieter than usual."""
        usable = self._usable()
        if usable.count < 2:
            return
        rest = np.array(usable.of(self._rows.rate_dph))
        step = resolution(rest)
        t, smooth = smooth_rate(*self._means(cell_length_of(self._rows.time_s)))
        for part in parts_of(len(rest)) if len(smooth) else ():
            rest[part] -= np.interp(usable.of(self._rows.time_s, part), t, smooth)
        for one in outlying(rest, max(int(CELL_S / self._run.row_period_s), 1)):
            rows = usable.span(one.first, one.end)
            self._event("outlier", "rate", rows, one.size, one.sigma, one.log_odds, "rate outlier")
            ends = rest[max(one.first - 1, 0)], rest[min(one.end, len(rest) - 1)]
            rest[one.first : one.end] = np.linspace(*ends, one.end - one.first)
        for noise in noise_parts(rest, step):
            reason = "rate too noisy" if noise.factor > USELESS_NOISE else ""
            rows = usable.span(noise.first, min(noise.end, usable.count))
            self._event("noise", "rate", rows, noise.factor, noise.sigma, noise.log_odds, reason)

    def cells(self, cell_s: float) -> RunCells:
        """Return means of the usable rows over cells; none for an infinite length."""
        length = max(cell_s, self._run.row_period_s)
        if np.isinf(length):
            return RunCells(np.zeros(0), np.zeros(0), np.zeros(0), CELL_S, ())
        return cells_of_means(*self._means(length), length)

    def _means(self, length_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the means of time, temperature and rate of the usable rows over cells, part by part."""
        columns = (self._rows.time_s, self._rows.temperature_c, self._rows.rate_dph)
        numbers, sums = list[FloatArray](), list[FloatArray]()
        for part in parts_of(len(self.reason)):
            use = self.reason[part] == 0
            if use.any():
                time, *others = (masked(column[part], use) for column in columns)
                number = np.floor((time - columns[0][0]) / length_s + 1e-9)
                begun = np.flatnonzero(np.diff(number, prepend=-1.0))
                numbers.append(number[begun])
                counted = (np.ones(len(time)), time, *others)
                sums.append(np.stack([np.add.reduceat(column, begun) for column in counted]))
        if not numbers:
            return np.zeros(0), np.zeros(0), np.zeros(0)
        number = np.concatenate(numbers)
        begun = np.flatnonzero(np.diff(number, prepend=-1.0))  # a cell may lie in two parts
        count, time, temperature, rate = np.add.reduceat(np.concatenate(sums, axis=1), begun, axis=1)
        return time / count, temperature / count, rate / count

    def judgement(self) -> Judgement:
        """Return what was found."""
        time, inside = self._rows.time_s, self.reason != 255
        first, last = int(np.argmax(inside)), len(inside) - 1 - int(np.argmax(inside[::-1]))
        run = self._run
        absent = {
            reason: int(np.count_nonzero(in_limits(times_s, run.from_s, run.to_s, ())))
            for reason, times_s in self._rows.absent_s.items()
        }
        return Judgement(
            run=run,
            read=int(np.count_nonzero(inside)) + sum(absent.values()),
            absent=absent,
            span_s=(float(time[first]), float(time[last])),
            left_out=tuple(_stretches(self.reason, time)),
            events=tuple(sorted(self.events, key=lambda one: (one.rows, one.kind))),
        )


class _Chosen:
    """Some rows of a file, in order; nothing is copied if these are all."""

    def __init__(self, chosen: BoolArray) -> None:
        self._rows = None if chosen.all() else np.flatnonzero(chosen).astype(np.int32)
        self.count = len(chosen) if self._rows is None else len(self._rows)

    def of(self, values: FloatArray, part: slice = slice(None)) -> FloatArray:
        """Return the values of these rows, or of a part of them."""
        return values[part] if self._rows is None else values[self._rows[part]]

    def span(self, first: int, end: int) -> tuple[int, int]:
        """Return the first row of the file, and the row after the last, of a stretch of these rows."""
        return (first, end) if self._rows is None else (int(self._rows[first]), int(self._rows[end - 1]) + 1)


def _stretches(reason: NDArray[np.uint8], time_s: FloatArray) -> Iterator[LeftOut]:
    """Yield the stretches of rows of one reason."""
    starts = np.flatnonzero(np.r_[True, reason[1:] != reason[:-1]]) if len(reason) else np.zeros(0, dtype=np.int64)
    ends = np.r_[starts[1:], len(reason)]
    for first, end in zip(starts.tolist(), ends.tolist(), strict=True):
        code = int(reason[first])
        if 0 < code < 255:
            yield LeftOut(first, end, (float(time_s[first]), float(time_s[end - 1])), REASONS[code - 1])
