"""Events: what happened to a recording at a time, reported before any cause is searched for.

Each has its run, its time and size with 95 % limits where they can be known, what it means, and the `exclude` line that
leaves it out. A step or a burst that is left in looks like several causes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..common.arrays import FloatArray, steps_are, those
from ..recordings.records import Dataset, Exclusion, Rows, Run, joined_runs
from ..results.base import Finding
from .changes import Change, changes_of
from .curves import curve_findings
from .event_findings import row_findings
from .findings import finding, run_facts
from .judgement import Judged, judge

_LOST_S = 60.0  # no rows for longer


def found_events(dataset: Dataset, judged: Judged | None = None) -> list[Finding]:
    """Return the events of the training runs, those of whole runs first; of such a run nothing else is said.

    Args:
        judged: Judgement of the rows of the runs; None: they are judged here.
    """
    judged = judged or judge(dataset.runs)
    whole = [run for run in joined_runs(dataset.runs) if run.role == "train"]
    facts = [run_facts(run, run.rows()) for run in whole]
    training = {run.file for run in whole}
    of_runs = [found for found in curve_findings(dataset, facts) if found.file in training]
    files = {found.file for found in of_runs}
    return [*of_runs, *(event for event in events_of(whole, judged, files) if event.file not in files)]


def events_of(runs: Sequence[Run], judged: Judged, without: Collection[str | None] = ()) -> list[Finding]:
    """Events of training runs, by run in order of time.

    Args:
        without: Files whose rates are not those of the gyro: changes of the others are not judged against them.
    """
    found = [list(row_findings(judged.of(run))) + list(_dropouts(run, run.rows())) for run in runs]
    rows = _UsableRows(runs, judged, without)
    changes = changes_of(rows)
    for number, run in enumerate(runs):
        its_changes = [change for change in changes if change.run == number]
        if its_changes:
            time = rows[number][0]
            found[number] += _of_changes(run, its_changes, float(time[0]), float(time[-1]) + run.row_period_s)
        again = {_at(event)[1] for event in found[number] if event.id == "restart"}
        found[number] = [e for e in found[number] if e.id != "dropout" or _at(e)[0] not in again]
    return [event for of_run in found for event in sorted(of_run, key=_at)]


def _at(event: Finding) -> tuple[float, float]:
    """When an event happened, and the earliest time at which it may have."""
    assert event.time_s is not None
    assert event.time_s.low is not None
    return event.time_s.value, event.time_s.low


class _UsableRows(Sequence[tuple[FloatArray, FloatArray, FloatArray]]):
    """Time, temperature and rate of the usable rows of each run; one run is in memory at a time."""

    def __init__(self, runs: Sequence[Run], judged: Judged, without: Collection[str | None]) -> None:
        self._runs, self._judged, self._without = runs, judged, without
        self._read: tuple[int, tuple[FloatArray, FloatArray, FloatArray]] | None = None

    def __len__(self) -> int:
        return len(self._runs)

    def __getitem__(self, number: Any) -> Any:
        if not 0 <= number < len(self._runs):
            raise IndexError(number)
        if self._read is None or self._read[0] != number:
            self._read = None
            rows = self._runs[number].rows()
            good = self._judged.usable(self._runs[number], rows) & np.isfinite(rows.temperature_c)
            good &= self._runs[number].file not in self._without
            columns = [rows.time_s, rows.temperature_c, rows.rate_dph]
            del rows  # each column goes as its own rows are chosen: a long recording is not held twice
            for k in range(3):
                columns[k] = those(columns[k], good)
            part = (columns[0], columns[1], columns[2])
            self._read = number, part if len(part[0]) > 1 else (np.zeros(2),) * 3
        return self._read[1]


def without_events(dataset: Dataset, events: Sequence[Finding]) -> Dataset:
    """The data set without what the events say to leave out."""
    whole = {event.file for event in events if event.whole_run}
    kept = [run for run in dataset.runs if run.role != "train" or run.file not in whole]

    def without(run: Run) -> Run:
        of_run = [e for e in events if not e.whole_run and (e.file, e.from_s) == (run.file, run.from_s)]
        gaps = tuple(Exclusion(*span, e.id) for e in of_run for span in e.leave_out_s)
        return replace(run, exclude=(*run.exclude, *gaps)) if run.role == "train" else run

    return replace(dataset, runs=tuple(map(without, kept)))


def _of_changes(run: Run, changes: Sequence[Change], first_s: float, end_s: float) -> Iterator[Finding]:
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
            yield finding("step_and_recover", text, run, time_s=one.time_s, size=(one.size, "deg/h"), leave_out=[out])
            k += 1
        else:
            yield _lasting(run, one, first_s, end_s)


_EVENTS = {
    "step": ("step", "deg/h"),
    "transition": ("transition", "deg/h"),
    "drift": ("ramp", "deg/h/h"),
    "gain": ("gain_changed", "times"),
}


def _lasting(run: Run, one: Change, first_s: float, end_s: float) -> Finding:
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
    return finding(id, text, run, time_s=one.time_s, size=(one.size, unit), leave_out=[out])


def _excluded(run: Run, span_s: tuple[float, float]) -> bool:
    """Whether rows are missing because the description leaves them out."""
    return any(gap.from_s <= span_s[0] + run.row_period_s and gap.to_s >= span_s[1] for gap in run.exclude)


def _restart(run: Run, step: Change, first_s: float, end_s: float) -> Finding:
    """Rows that stop and go on at another level."""
    time, back = step.time_s[1:]
    out = (first_s, time + run.row_period_s) if back - first_s < end_s - back else (back, end_s)
    text = (
        f"{run.file} has no rows for {back - time:g} s from {time:g} s on, and goes on {step.size[0]:+.3g} deg/h "
        f"away ({step.sigmas:.1f} times what noise makes there), as after a power-on: make the rows behind it a run of "
        f"their own (from_s = {back!r}, with its power_on_s), or leave out {_hours(*out)}."
    )
    time_s = (back, time, back)
    return finding("restart", text, run, time_s=time_s, size=(step.size, "deg/h"), leave_out=[out])


def _undoes(one: Change, back: Change) -> bool:
    """Whether the second step takes the first one back, by their intervals."""
    if {one.kind, back.kind} - {"step", "transition"}:
        return False
    low, high = sorted((-back.size[1], -back.size[2]))
    own_low, own_high = sorted(one.size[1:])
    return one.size[0] * back.size[0] < 0.0 and low <= own_high and own_low <= high


def _hours(from_s: float, to_s: float) -> str:
    return f"{from_s / 3600.0:.2f}-{to_s / 3600.0:.2f} h"


def _dropouts(run: Run, rows: Rows) -> Iterator[Finding]:
    """Times without rows."""
    time = those(rows.time_s, run.in_span(rows.time_s))
    lost_s = max(_LOST_S, 10.0 * run.row_period_s)
    for k in np.flatnonzero(steps_are(time, lambda step: step > lost_s)):
        start, length = float(time[k]), float(time[k + 1] - time[k])
        if not _excluded(run, (start, start + length)):
            text = f"{run.file} has no rows for {length:g} s from {start:g} s on."
            yield finding(
                "dropout", text, run, time_s=(start, start, start + run.row_period_s), size=((length,) * 3, "s")
            )
