"""Events: what happened to a recording at a time, reported before any cause is searched for.

Each has its run, its time and size with 95 % limits where they can be known, what it means, and the `exclude` line that
leaves it out. A step or a burst that is left in looks like several causes.

A unit with hysteresis or a late temperature has another curve on every branch. A branch that ends looks like a gain
that changed, and a run with few branches does not separate the two; evidence does, where they can be distinguished.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..recordings.description import exclude_line
from ..recordings.records import Dataset, Exclusion, Rows, Run
from ..results.diagnosed import Estimate, EventSize, FoundEvent
from ..target.front_end import samples_per_block
from ..target.recursions import first_order, play
from .changes import Change, changes_of
from .facts import facts_of
from .outliers import departing_rows
from .thermometers import stuck_stretches

Limits = tuple[float, float, float]

_BURST_ROWS = 10  # fewer are outliers
_JOINED = 1.5  # row periods between rows of one burst
_LOST_S = 60.0  # no rows for longer
_JUMP_S = 120.0  # about a place at which a thermometer moves as nowhere else: two cells of a minute
_BLOCK_S = 10.0  # over which the level around a burst is taken


@dataclass(frozen=True)
class Event:
    """One event.

    Attributes:
        id: step, step_and_recover, ramp, restart, gain_changed, burst, dropout, thermometer_jump,
            thermometer_lost, or of a run as a whole sign_reversed, axes_exchanged, gain_changed.
        run: Number of its run among the training runs.
        file: Of that run.
        time_s: Value, and the limits between which it lies, s on the file's clock.
        size: Value and limits; `unit` is theirs.
        text: What it is.
        leave_out: What to leave out, from and to, s; None: nothing has to be, the front end sees to it.
        whole_run: Whether it is about a run as a whole, which then is left out as such.
    """

    id: str
    run: int
    file: str
    time_s: Limits
    size: Limits
    unit: str
    text: str
    leave_out: tuple[float, float] | None
    whole_run: bool = False

    def result(self) -> FoundEvent:
        """For the result."""
        out = None if self.whole_run else self.leave_out
        time, size = (dict(zip(("value", "low", "high"), x, strict=True)) for x in (self.time_s, self.size))
        return FoundEvent.of_object(
            self,
            time_s=Estimate(**time),
            size=EventSize(**size, unit=self.unit),
            exclude=exclude_line([out], self.id) if out else None,
        )


def events_of(dataset: Dataset, without: Collection[str] = ()) -> list[Event]:
    """Events of the training runs, by run in order of time.

    Args:
        without: Files whose rates are not those of the gyro: changes of the others are not judged against them.
    """
    runs = [run for run in dataset.runs if run.role == "train"]
    found: list[Event] = []
    departing: list[NDArray[np.int64]] = []
    for number, run in enumerate(runs):
        of_run, wild = _of_rows(number, run)
        found += of_run
        departing.append(wild)
    judged = _Judged(runs, departing, without)
    changes = changes_of(judged)
    for number, run in enumerate(runs):
        its_changes = [change for change in changes if change.run == number]
        if its_changes:
            time = judged[number][0]
            found += _of_changes(run, its_changes, float(time[0]), float(time[-1]) + run.row_period_s)
    again = {(e.run, e.time_s[1]) for e in found if e.id == "restart"}
    found = [e for e in found if e.id != "dropout" or (e.run, e.time_s[0]) not in again]
    return sorted(found, key=lambda event: (event.run, event.time_s[0]))


def _of_rows(number: int, run: Run) -> tuple[list[Event], NDArray[np.int64]]:
    """Events that a run's rows show by themselves, and its rows that are spikes or parts of bursts."""
    rows = run.rows()
    wild = departing_rows(rows, run, samples_per_block(_BLOCK_S, run.row_period_s))
    of_thermometer = list(_thermometer(number, run, rows))
    found = [*_bursts(number, run, rows, wild), *of_thermometer, *_dropouts(number, run, rows)]
    lost = [np.zeros(0, dtype=np.int64)]
    for event in of_thermometer:  # what a rate does is not judged where its temperature is not known
        if event.leave_out is not None:
            low, high = np.searchsorted(rows.time_s, event.leave_out)
            lost.append(np.arange(low, high))
    return found, np.union1d(wild, np.concatenate(lost))


class _Judged(Sequence[tuple[FloatArray, FloatArray, FloatArray]]):
    """Time, temperature and rate of the rows of each run that count; one run is in memory at a time."""

    def __init__(
        self, runs: Sequence[Run], departing: Sequence[NDArray[np.int64]], without: Collection[str]
    ) -> None:
        self._runs, self._departing, self._without = runs, departing, without
        self._read: tuple[int, tuple[FloatArray, FloatArray, FloatArray]] | None = None

    def __len__(self) -> int:
        return len(self._runs)

    def __getitem__(self, number: Any) -> Any:
        if not 0 <= number < len(self._runs):
            raise IndexError(number)
        if self._read is None or self._read[0] != number:
            self._read = None
            rows = self._runs[number].rows()
            good = self._runs[number].in_span(rows.time_s)
            good &= np.isfinite(rows.rate_dph) & np.isfinite(rows.temperature_c)
            good[self._departing[number]] = False
            good &= self._runs[number].file not in self._without
            part = tuple(
                column if good.all() else column[good]
                for column in (rows.time_s, rows.temperature_c, rows.rate_dph)
            )
            self._read = number, part if len(part[0]) > 1 else (np.zeros(2),) * 3
        return self._read[1]


def accepted(dataset: Dataset, events: Sequence[Event]) -> Dataset:
    """The data set without what the events say to leave out."""
    training = [run for run in dataset.runs if run.role == "train"]
    whole = {event.file for event in events if event.whole_run}
    kept = [run for run in dataset.runs if run.role != "train" or run.file not in whole]

    def without(run: Run) -> Run:
        of_run = [e for e in events if e.leave_out is not None and not e.whole_run and training[e.run] is run]
        gaps = tuple(Exclusion(*e.leave_out, e.id) for e in of_run if e.leave_out is not None)
        return replace(run, exclude=(*run.exclude, *gaps))

    return replace(dataset, runs=tuple(map(without, kept)))


def _of_changes(run: Run, changes: Sequence[Change], first_s: float, end_s: float) -> Iterator[Event]:
    """Steps that come back, as pairs, and what lasts: of that the shorter side is to be left out."""
    k = 0
    while k < len(changes):
        one, back = changes[k], changes[k + 1] if k + 1 < len(changes) else None
        k += 1
        if one.gap_s > 0.0 and one.kind == "step":
            if not _excluded(run, one.time_s[1:]):
                yield _restart(run, one, first_s, end_s)
        elif back is not None and back.gap_s == 0.0 and _undoes(one, back):
            out = (one.time_s[1], back.time_s[2] + run.row_period_s)
            text = (
                f"The rate of {run.file} steps by {one.size[0]:+.3g} deg/h at {one.time_s[0]:g} s and comes back "
                f"at {back.time_s[0]:g} s, whatever the temperature is: leave out {_hours(*out)}, and find out what "
                "happened then."
            )
            yield Event("step_and_recover", one.run, run.file, one.time_s, one.size, "deg/h", text, out)
            k += 1
        else:
            yield _lasting(run, one, first_s, end_s)


_EVENTS = {
    "step": ("step", "deg/h"),
    "transition": ("transition", "deg/h"),
    "drift": ("ramp", "deg/h/h"),
    "gain": ("gain_changed", "times"),
}


def _lasting(run: Run, one: Change, first_s: float, end_s: float) -> Event:
    before = one.time_s[0] - first_s < end_s - one.time_s[0] and one.kind != "drift"
    out = (first_s, one.time_s[2]) if before else (one.time_s[1], end_s)
    at, size, clear = one.time_s[0], one.size[0], f"({one.sigmas:.1f} times what noise makes there)"
    what = {
        "step": f"steps by {size:+.3g} deg/h at {at:g} s {clear} and stays",
        "transition": f"changes by {size:+.3g} deg/h within {one.duration_s:g} s about {at:g} s {clear} and stays",
        "drift": f"begins to drift by {size:+.3g} deg/h each hour at {at:g} s {clear}",
        "gain": f"over temperature is from {at:g} s on {size:.3g} times what it was before (95 % {one.size[1]:.3g} ... "
        f"{one.size[2]:.3g}): its scale changed",
    }[one.kind]
    id, unit = _EVENTS[one.kind]
    text = f"The rate of {run.file} {what}: leave out {_hours(*out)}, or start a new run there."
    return Event(id, one.run, run.file, one.time_s, one.size, unit, text, out)


def _excluded(run: Run, span_s: tuple[float, float]) -> bool:
    """Whether rows are missing because the description leaves them out."""
    return any(gap.from_s <= span_s[0] + run.row_period_s and gap.to_s >= span_s[1] for gap in run.exclude)


def _restart(run: Run, step: Change, first_s: float, end_s: float) -> Event:
    """Rows that stop and go on at another level."""
    time, back = step.time_s[1:]
    out = (first_s, time + run.row_period_s) if back - first_s < end_s - back else (back, end_s)
    text = (
        f"{run.file} has no rows for {back - time:g} s from {time:g} s on, and goes on {step.size[0]:+.3g} deg/h "
        f"away ({step.sigmas:.1f} times what noise makes there), as after a power-on: make the rows behind it a run of "
        f"their own (from_s = {back!r}, with its power_on_s), or leave out {_hours(*out)}."
    )
    return Event("restart", step.run, run.file, (back, time, back), step.size, "deg/h", text, out)


def _undoes(one: Change, back: Change) -> bool:
    """Whether the second step takes the first one back, by their intervals."""
    if {one.kind, back.kind} - {"step", "transition"}:
        return False
    low, high = sorted((-back.size[1], -back.size[2]))
    own_low, own_high = sorted(one.size[1:])
    return one.size[0] * back.size[0] < 0.0 and low <= own_high and own_low <= high


def _hours(from_s: float, to_s: float) -> str:
    return f"{from_s / 3600.0:.2f}-{to_s / 3600.0:.2f} h"


def _bursts(number: int, run: Run, rows: Rows, wild: NDArray[np.int64]) -> Iterator[Event]:
    """Stretches of rows that no noise of the gyro makes."""
    if len(wild) < _BURST_ROWS:
        return
    times = rows.time_s[wild]
    first = np.flatnonzero(np.diff(times, prepend=-np.inf) > _JOINED * run.row_period_s)
    for a, b in zip(first, np.r_[first[1:], len(wild)], strict=True):
        if b - a < _BURST_ROWS:
            continue
        part = rows.rate_dph[wild[a:b]]
        near = rows.rate_dph[max(wild[a] - (b - a), 0) : wild[b - 1] + (b - a)]
        size = float(np.max(np.abs(part - np.nanmedian(near))))
        start, end = float(times[a]), float(times[b - 1]) + run.row_period_s
        text = f"{b - a} rows of {run.file} from {start:g} s on depart by up to {size:.3g} deg/h: they are left out."
        yield Event(
            "burst", number, run.file, (start, start, start), (size, size, size), "deg/h", text, (start, end)
        )


def _thermometer(number: int, run: Run, rows: Rows) -> Iterator[Event]:
    """Jumps of the temperature, and stretches in which it stands still."""
    for jump in facts_of(run, rows).jumps:
        size, at, end = jump.to_c - jump.from_c, jump.time_s, float(rows.time_s[-1]) + run.row_period_s
        text = (
            f"The temperature of {run.file} jumps from {jump.from_c:.2f} to {jump.to_c:.2f} C at {jump.time_s:g} s, "
            "faster than a gyro can: look at the sensor's contact."
        )
        limits, out = (at, at, at), None
        if jump.lasting:
            limits, out = (at, at - _JUMP_S, at + _JUMP_S), (at - _JUMP_S, end)
            text = (
                f"The temperature of {run.file} moves from {jump.from_c:.2f} to {jump.to_c:.2f} C about {at:g} s, as "
                "nowhere else in the run: the thermometer shifted or lost contact. Leave out what lies behind."
            )
        yield Event("thermometer_jump", number, run.file, limits, (size, size, size), "C", text, out)
    inside = run.in_span(rows.time_s)
    time, temperature = rows.time_s[inside], rows.temperature_c[inside]
    for first, rows_still in stuck_stretches(time, temperature, run.row_period_s):
        start = float(time[first])
        end = float(time[first + rows_still - 1]) + run.row_period_s
        text = (
            f"The temperature of {run.file} stands still to the last digit for {end - start:g} s from {start:g} s on: "
            "the thermometer was lost, or its record."
        )
        begin, lost = (start, start, start), (end - start, end - start, end - start)
        yield Event("thermometer_lost", number, run.file, begin, lost, "s", text, (start, end))


def _dropouts(number: int, run: Run, rows: Rows) -> Iterator[Event]:
    """Times without rows."""
    time = rows.time_s[run.in_span(rows.time_s)]
    for k in np.flatnonzero(np.diff(time) > max(_LOST_S, 10.0 * run.row_period_s)):
        start, length = float(time[k]), float(time[k + 1] - time[k])
        if _excluded(run, (start, start + length)):
            continue
        text = f"{run.file} has no rows for {length:g} s from {start:g} s on."
        yield Event("dropout", number, run.file, (start, start, start), (length,) * 3, "s", text, None)


_WIDTHS_C = (0.7, 1.5, 3.0, 6.0, 12.0, 24.0)  # of plays: octaves over what `causes.hysteresis` looks through
_LAGS_S = (200.0, 600.0, 1800.0, 5400.0)  # over what its lags look through, by factors of three
_RANK = 1e-3  # of the strongest direction: weaker ones are rounding, or a play that is never pushed


def evidence_beside_memories(
    means: tuple[FloatArray, FloatArray, FloatArray],
    used: NDArray[np.bool_],
    change: FloatArray,
    known: FloatArray,
) -> float:
    """How much better a change explains a run than any memory, as a difference of Schwarz's criterion (BIC).

    The memories are plays, lags, and both, each beside a level, the temperature's rate and what is `known`, free in all
    their amplitudes. Twice the logarithm of the odds; 10 is very strong (Kass and Raftery, J. Am. Stat. Assoc. 90
    (1995) 773). Means that resemble their neighbours count for less, as of a first-order process.

    Args:
        means: Time (s), temperature (C) and rate of the run, shape (n,) each, with what came before the means used.
        used: Means that count, shape (n,).
        change: Columns that explain the run by a change, shape (n, k); its place counts as one more.
        known: Columns that the memories stand beside, shape (n, k).
    """
    t, x, y = means
    left, rank, alike = _left(change[used], y[used])
    independent = float(used.sum()) * (1.0 - alike) / (1.0 + alike)
    plain = [np.ones_like(t), np.gradient(x, t), *known.T]
    plays = [play(width, x) - x for width in _WIDTHS_C]
    lags = [first_order(tau, t, x) - x for tau in _LAGS_S]
    found = []
    for memories in (plays, lags, plays + lags):
        remains, columns, _ = _left(np.column_stack(plain + memories)[used], y[used])
        better = independent * float(np.log(max(remains, 1e-300) / max(left, 1e-300)))
        found.append(better - (rank + 1 - columns) * float(np.log(max(independent, 1.0))))
    return min(found)


def _left(columns: FloatArray, y: FloatArray) -> tuple[float, int, float]:
    """Squares that a fit leaves, its rank, and the correlation of neighbours in what it leaves, 0 at least."""
    q, size, _ = np.linalg.svd(
        columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), full_matrices=False
    )
    q = q[:, size > _RANK * size[0]]
    rest = y - q @ (q.T @ y)
    left = float(rest @ rest)
    return left, q.shape[1], min(max(float(rest[1:] @ rest[:-1]) / max(left, 1e-300), 0.0), 0.95)
