"""Say in findings what happened to the rows of a run, with its times and what to do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ..recordings.records import Mark, Run
from ..results.base import Finding
from ..results.rows import STATED, LeftOutRows, RowsCount, RowsUsed
from .change_findings import change_findings
from .findings import ValueWithLimits, finding
from .judgement import Judged, Judgement, LeftOut
from .odds import Event

# Stretches that a result lists; beyond, they are counted only.
_LISTED = 200


def row_findings(judgement: Judgement) -> Iterator[Finding]:
    """Yield what the rows of a run show by themselves: one finding for each kind of event and column."""
    of_kind: dict[tuple[str, str], list[Event]] = {}
    for event in judgement.events:
        if event.kind not in _SAID_ELSEWHERE:
            of_kind.setdefault((event.kind, event.column), []).append(event)
    for key, events in of_kind.items():
        yield _SAYS[key](judgement, events)
    yield from change_findings(judgement)


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
    text = (
        f"The rates of {run.file} pile up at {values} deg/h: the sensor or its converter was at an end stop, or wrote "
        f"this value for readings that it did not have. The stretches with such rows, {rows} rows in all, do not reach "
        "the fit."
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


# Gaps are findings of `timing` and `events`, changes that last are those of `change_findings`.
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
