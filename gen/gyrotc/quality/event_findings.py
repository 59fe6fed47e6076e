"""Say in findings what happened to the rows of a run, with its times and what to do.

Each event has its time and size with 95 % limits where they can be known, and the `exclude` line that leaves it out.
If a change lasts, its shorter side may be left out. A step or a burst that is left in looks like several causes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ..recordings.records import Dataset, Mark, Run, joined_runs
from ..results.base import Finding
from ..results.rows import STATED, LeftOutRows, RowsCount, RowsUsed
from .changes import Change, paired
from .curves import curve_findings
from .findings import ValueWithLimits, finding, run_facts
from .judgement import Judged, Judgement, LeftOut, judge
from .odds import Event

# Stretches that a result lists; beyond, they are counted only.
_LISTED = 200


def found_events(dataset: Dataset, judged: Judged | None = None) -> list[Finding]:
    """Return the events of the training runs, those of whole runs first; of such a run nothing else is said.

    Args:
        judged: Judgement of the rows of the runs; None: they are judged here.
    """
    judged = judged or judge(dataset)
    runs = [run for run in joined_runs(dataset.runs) if run.role == "train"]
    facts = [run_facts(run, run.rows()) for run in runs]
    training = {run.file for run in runs}
    of_runs = [found for found in curve_findings(dataset, facts) if found.file in training]
    files = {found.file for found in of_runs}
    return of_runs + [event for run in runs if run.file not in files for event in _events(judged.of(run))]


def _events(judgement: Judgement) -> list[Finding]:
    """Return the events of a run, in order of time."""
    return sorted([*row_findings(judgement), *_gaps(judgement)], key=_at)


def _at(event: Finding) -> float:
    """Return when an event happened."""
    assert event.time_s is not None
    return event.time_s.value


def _gaps(judgement: Judgement) -> Iterator[Finding]:
    """Yield the times without rows, other than those after which the gyro was restarted."""
    run = judgement.run
    restarts = [change for change in judgement.changes if change.restarts]
    for event in judgement.events:
        start, length = event.time_s[0], event.size
        if event.kind == "gap" and not any(change.falls_into(event.time_s) for change in restarts):
            text = f"{run.file} has no rows for {length:g} s from {start:g} s on."
            limits = (start, start, start + run.row_period_s)
            yield finding("dropout", text, run, time_s=limits, size=((length,) * 3, "s"))


def row_findings(judgement: Judgement) -> Iterator[Finding]:
    """Yield what the rows of a run show by themselves: one finding for each kind of event and column."""
    of_kind: dict[tuple[str, str], list[Event]] = {}
    for event in judgement.events:
        if event.kind not in _SAID_ELSEWHERE:
            of_kind.setdefault((event.kind, event.column), []).append(event)
    for key, events in of_kind.items():
        yield _SAYS[key](judgement, events)
    yield from _changes(judgement)


def _largest(events: Sequence[Event]) -> Event:
    return max(events, key=lambda one: abs(one.size))


def _longest(events: Sequence[Event]) -> Event:
    return max(events, key=lambda one: one.rows[1] - one.rows[0])


def _spans(run: Run, events: Sequence[Event | LeftOut]) -> list[tuple[float, float]]:
    """Return the times of stretches of rows, the end exclusive."""
    return [(one.time_s[0], round(one.time_s[1] + 0.5 * run.row_period_s, 6)) for one in events]


def _marks(run: Run, events: Sequence[Event]) -> list[Mark]:
    return [Mark(run.file, (one.rows[0] + 1, one.rows[1]), one.time_s) for one in events]


def _limits(run: Run, events: Sequence[Event], at: float) -> ValueWithLimits:
    """Return when it happened; a row may be a mean over the time before it."""
    spans = _spans(run, events)
    return at, min(span[0] for span in spans) - 2.0 * run.row_period_s, max(span[1] for span in spans)


def _found(id: str, text: str, run: Run, events: Sequence[Event], worst: Event, **given: Any) -> Finding:
    """Return a finding about events of one kind, with the time of the worst of them."""
    return finding(id, text, run, marks=_marks(run, events), time_s=_limits(run, events, worst.time_s[0]), **given)


def _count(events: Sequence[Event]) -> int:
    """Return how many rows the events have."""
    return sum(one.rows[1] - one.rows[0] for one in events)


def _rows(count: int) -> str:
    return f"{count} row" + "s" * (count != 1)


def _outliers(judgement: Judgement, events: Sequence[Event]) -> Finding:
    run, worst = judgement.run, _largest(events)
    rows = _count(events)
    text = (
        f"{_rows(rows)} of {run.file} outside the level of those around them, most at "
        f"{worst.time_s[0]:.10g} s: by {abs(worst.size):.4g} deg/h, where the noise is {worst.sigma:.2g} deg/h "
        f"({len(events)} stretches). They do not reach the fit."
    )
    return _found(
        "rate_outliers",
        text,
        run,
        events,
        worst,
        size=((abs(worst.size),) * 3, "deg/h"),
        leave_out=_spans(run, events),
        stretches=len(events),
        rows=rows,
    )


def _end_stop(judgement: Judgement, events: Sequence[Event]) -> Finding:
    run = judgement.run
    stretches = [one for one in judgement.left_out if one.reason == "rate at end stop"]
    rows = sum(one.end - one.first for one in stretches)
    values = " and ".join(f"{one.size:.6g}" for one in events)
    fate = (
        f"The stretches with such rows, {_rows(rows)} in all, do not reach the fit."
        if rows
        else "Such rows are too few to shift the mean, and stay in the fit."
    )
    text = (
        f"The rates of {run.file} pile up at {values} deg/h: the sensor or its converter was at an end stop, or wrote "
        f"this value for readings that it did not have. {fate}"
    )
    return _found(
        "end_stop",
        text,
        run,
        events,
        events[0],
        leave_out=_spans(run, stretches),
        values_dph=[one.size for one in events],
        rows=rows,
    )


def _stuck_rate(judgement: Judgement, events: Sequence[Event]) -> Finding:
    run, longest = judgement.run, _longest(events)
    rows = _count(events)
    text = (
        f"The rate of {run.file} stays at one value for {longest.size:.4g} s from {longest.time_s[0]:.10g} s on "
        f"({len(events)} stretches, {_rows(rows)}), longer than chance repeats it. They do not reach the fit."
    )
    return _found(
        "stuck_rate",
        text,
        run,
        events,
        longest,
        size=((longest.size,) * 3, "s"),
        leave_out=_spans(run, events),
        rows=rows,
    )


def _stuck_temperature(judgement: Judgement, events: Sequence[Event]) -> Finding:
    run, longest = judgement.run, _longest(events)
    text = (
        f"The temperature of {run.file} stays at one value for {longest.size:g} s from {longest.time_s[0]:g} s on and "
        f"then steps as it does nowhere else, or its noise does not come back ({len(events)} places): the temperature "
        "sensor was stuck, or its record. These rows do not reach the fit."
    )
    return _found(
        "stuck_temperature",
        text,
        run,
        events,
        longest,
        size=((longest.size,) * 3, "s"),
        leave_out=_spans(run, events),
    )


def _jumps(judgement: Judgement, events: Sequence[Event]) -> Finding:
    run, worst = judgement.run, _largest(events)
    at, size = worst.time_s[0], worst.size
    text = (
        f"The temperature of {run.file} jumps by {size:+.4g} C at {at:.10g} s and stays there, faster than it changes "
        f"around it ({len(events)} places)."
    )
    return finding(
        "jump_in_temperature",
        text,
        run,
        marks=_marks(run, events),
        time_s=(at, worst.time_s[0] - run.row_period_s, worst.time_s[1]),
        size=((size, size - 2.0 * worst.sigma, size + 2.0 * worst.sigma), "C"),
    )


def _temperature_outliers(judgement: Judgement, events: Sequence[Event]) -> Finding:
    run, worst = judgement.run, _largest(events)
    rows = _count(events)
    text = (
        f"{_rows(rows)} of {run.file} with a temperature outside the course of the others, most at "
        f"{worst.time_s[0]:.10g} s: by {worst.size:+.4g} C ({len(events)} stretches). Their rates do not reach the fit."
    )
    return _found(
        "temperature_outliers",
        text,
        run,
        events,
        worst,
        size=((worst.size,) * 3, "C"),
        leave_out=_spans(run, events),
        rows=rows,
    )


def _noise(judgement: Judgement, events: Sequence[Event]) -> Finding:
    run, longest = judgement.run, _longest(events)
    left_out = [one for one in events if one.left_out]
    text = (
        f"The noise of {run.file} changes: from {longest.time_s[0]:.10g} to {longest.time_s[1]:.10g} s it is "
        f"{longest.size:.3g} times that of the rest ({len(events)} stretches)."
    )
    if left_out:
        rows = _count(left_out)
        text += f" {_rows(rows)} that are too noisy to say anything do not reach the fit."
    return _found(
        "noise_changes",
        text,
        run,
        events,
        longest,
        size=((longest.size, longest.size - 2.0 * longest.sigma, longest.size + 2.0 * longest.sigma), "times"),
        leave_out=_spans(run, left_out),
    )


# Gaps are findings of `timing` and `found_events`, changes that last those of `_changes`.
_SAID_ELSEWHERE = ("gap", "step", "transition", "drift", "gain", "restart", "displaced")
_SAYS = {
    ("outlier", "rate"): _outliers,
    ("end_stop", "rate"): _end_stop,
    ("stuck", "rate"): _stuck_rate,
    ("stuck", "temperature"): _stuck_temperature,
    ("jump", "temperature"): _jumps,
    ("outlier", "temperature"): _temperature_outliers,
    ("noise", "rate"): _noise,
}


def rows_used(judged: Judged, runs: Sequence[Run]) -> RowsUsed:
    """Return the count of rows of some runs, and the stretches that are left out because of what they show."""
    judgements = list({id(one): one for one in map(judged.of, runs)}.values())
    counts = [row_count(one) for one in judgements]
    left_out: dict[str, int] = {}
    for count in counts:
        for reason, rows in count.left_out.items():
            left_out[reason] = left_out.get(reason, 0) + rows
    stretches = [found for one in judgements for found in _stretches(one)]
    return RowsUsed(
        read=sum(count.read for count in counts),
        kept=sum(count.kept for count in counts),
        left_out=left_out,
        stretches=tuple(stretches[:_LISTED]),
    )


def row_count(judgement: Judgement) -> RowsCount:
    """Return the count of rows of a run."""
    return RowsCount(read=judgement.read, kept=judgement.kept, left_out=judgement.count())


def _stretches(judgement: Judgement) -> Iterator[LeftOutRows]:
    for one in judgement.left_out:
        if one.reason not in STATED:
            [(from_s, to_s)] = _spans(judgement.run, [one])
            rows = one.end - one.first
            yield LeftOutRows(file=judgement.run.file, from_s=from_s, to_s=to_s, rows=rows, reason=one.reason)


def _changes(judgement: Judgement) -> Iterator[Finding]:
    """Yield a finding for each change; a step that comes back is one."""
    run, (first_s, last_s) = judgement.run, judgement.span_s
    end_s = last_s + run.row_period_s
    for one, back in paired(judgement.changes):
        if back is not None:
            out = (one.time_s[1], back.time_s[2] + run.row_period_s)
            text = (
                f"The rate of {run.file} steps by {one.size[0]:+.3g} deg/h at {one.time_s[0]:g} s and comes back at "
                f"{back.time_s[0]:g} s, whatever the temperature is. What lies between ({_hours(*out)}) does not reach "
                "the fit: find out what happened then."
            )
            yield finding("step_and_recover", text, run, time_s=one.time_s, size=(one.size, "deg/h"), leave_out=[out])
        elif one.restarts:
            yield _restart(run, one, first_s, end_s)
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


def _restart(run: Run, step: Change, first_s: float, end_s: float) -> Finding:
    """Report rows that stop and go on at another level."""
    time, back = step.time_s[1:]
    out = (first_s, time + run.row_period_s) if back - first_s < end_s - back else (back, end_s)
    text = (
        f"{run.file} has no rows for {back - time:g} s from {time:g} s on, and goes on {step.size[0]:+.3g} deg/h "
        f"away ({step.sigmas:.1f} times what noise makes there), as after a power-on: what follows is "
        f"trained on as a power-on of its own. State it (from_s = {back!r}, with its power_on_s), or leave out "
        f"{_hours(*out)}."
    )
    time_s = (back, time, back)
    return finding("restart", text, run, time_s=time_s, size=(step.size, "deg/h"), leave_out=[out])


def _hours(from_s: float, to_s: float) -> str:
    return f"{from_s / 3600.0:.2f}-{to_s / 3600.0:.2f} h"
