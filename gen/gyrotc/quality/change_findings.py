"""Say in findings which changes of a rate last: their times and sizes, and the shorter side, which may be left out."""

from __future__ import annotations

from collections.abc import Iterator

from ..recordings.records import Run
from ..results.base import Finding
from .changes import Change, paired
from .findings import finding
from .judgement import Judgement


def change_findings(judgement: Judgement) -> Iterator[Finding]:
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
