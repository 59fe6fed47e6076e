"""Warnings about recordings: each with its place, its rows, and what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model import Model
from ..recordings.description import exclude_line
from ..recordings.records import Dataset, Mark, Rows, Run
from ..target.front_end import samples_per_block
from .facts import RunFacts, facts_of
from .orientation import orientation_findings
from .outliers import departing_rows, stretches_left_out
from .recorded import (
    coarse_rate_findings,
    contradiction_findings,
    copied_channel_findings,
    counter_findings,
    earth_rate_findings,
    held_findings,
    jump_findings,
    outlier_findings,
    shared_axes_findings,
    shared_rows_findings,
    sign_findings,
    stuck_temperature_findings,
    temperature_findings,
)
from .thermometers import thermometer_findings
from .timing import time_findings

_ADVICE = {
    "coarse_rate": "Record the rate with more digits, in a finer range of the converter, or as pulses.",
    "coarse_temperature": "Record more digits of the thermometer, or one with a finer resolution.",
    "coarse_time": "Number the rows instead of trusting the stamps: gyrotc import FILE --rate-hz R, or record finer "
    "stamps.",
    "constant_channel": "Look whether the sensor was connected; take the column out if it says nothing.",
    "counter_wrapped": "Add the range of the counter behind each such place, or store the counts with their sign.",
    "earth_rate_not_stated": 'Say in dataset.toml what was done about it: earth_rate = "removed", "none" or "compute".',
    "envelope_coverage": "Plan runs for the cells that are empty: gyrotc plan.",
    "envelope_not_reached": "Record a run that goes there, or state the envelope that the product needs.",
    "gaps": "Look at the logger (buffer, disk, cable) at these times. Blocks with fewer than half of their rows are "
    "left out by themselves.",
    "jump_in_temperature": "Look for a loose contact or a change of the thermometer there; leave the stretch out by "
    "exclude, or cut the run by from_s and to_s.",
    "left_out": "Nothing, if it is meant so.",
    "mostly_holds": "Record ramps at several rates, up and down.",
    "no_temperature_information": "Record runs in a chamber, over the temperatures that the product will see.",
    "rate_outliers": "Look for what disturbed the gyro at these times; paste the exclude lines, where offered, "
    "into the run's [[run]] of dataset.toml.",
    "row_periods_differ": "Nothing, if the logger was set so; else look which of the files has a wrong time unit.",
    "runs_contradict": "Compare serial, mounting, mode and software of this run with the others; leave out what is not "
    "the same gyro in the same state. gyrotc diagnose looks for turn-on offsets and ageing.",
    "same_recording_twice": "Keep one of the two.",
    "small_rates": 'Declare the unit: [units] rate = "deg/s" in dataset.toml.',
    "rate_held": "Record at the gyro's own rhythm, or keep every row of it once.",
    "shared_axes": "Look at the wiring of the channels and at the columns of the logger.",
    "stuck_rate": "Look at the logger and the gyro's data line there; leave the stretch out by exclude.",
    "time_drifts": "Find out which clock is right. If the gyro's is: number the rows, gyrotc import FILE --rate-hz R.",
    "time_jumps": "Number the rows instead, gyrotc import FILE --rate-hz R, or cut the file there into two runs by "
    "to_s and from_s.",
    "time_since_epoch": "State power_on_s of the run, or subtract the time of power-on; gyrotc import does that.",
}


def advice_of(id: str) -> str:
    """What to do next; empty where the warning's own text says it."""
    return _ADVICE.get(id, "")


Envelope = tuple[tuple[float, float], tuple[float, float]]
"""Lowest and highest temperature (C), lowest and highest temperature rate (C/min)."""

_COARSE_STEP_C = 0.25  # at 1 C/min a slope over 100 s then rests on fewer than seven steps
_HOLDS = 0.8  # share of the time: beyond it dT/dt is learnt from less than a fifth
_STUCK_S = 60.0  # longer than any thermometer waits between two readings
_STUCK_ROWS = 30  # and not fewer rows, so that slow loggers are not questioned
_LATE_S = 3.0e8  # ten years: a time since some epoch, not since power-on
_SMALL_DPH = 1e-5  # below the noise of any gyro; deg/s or rad/s taken for deg/h
_PERIODS = 0.01  # relative: clocks of loggers differ by less, another sample rate by more
_ENVELOPE_CELLS = (20, 8)  # of T and of dT/dt: 5 C and 1.25 C/min of the paper's range
_ENVELOPE_MARGIN = 0.05  # share of the range: chambers do not reach their ends to the degree
_BLOCK_S = 10.0  # as `fit` has it where nothing else is asked for
_LINES = 20  # that are offered to be pasted: more are a fault of the recording


@dataclass(frozen=True, slots=True)
class CheckWarning:
    """Something suspect: a stable id, where, what, the rows, and the axes that show it."""

    id: str
    where: str
    text: str
    marks: tuple[Mark, ...] = ()
    axes: tuple[str | None, ...] = ()

    @property
    def advice(self) -> str:
        """What to do next; empty where the text says it."""
        return advice_of(self.id)

    def __str__(self) -> str:
        return f"{self.where}: {self.text}"


def where_of(file: str, from_s: float | None) -> str:
    """The run as messages name it."""
    return file if from_s is None else f"{file} from {from_s:.6g} s"


def looked_at(run: Run) -> tuple[RunFacts, list[CheckWarning]]:
    """Facts of a run, and the warnings that its rows alone raise."""
    rows = run.rows()
    f = facts_of(run, rows)
    where = where_of(f.file, f.from_s)
    found = [
        *time_findings(run, rows),
        *coarse_rate_findings(run, rows),
        *copied_channel_findings(run, rows),
        *stuck_temperature_findings(run, rows),
    ]
    warnings = [
        *_of_temperature(f, where),
        *_of_rate(f, rows, where, coarse=any(one["id"] == "coarse_rate" for one in found)),
        *_of_time(f, where),
        *(CheckWarning(one["id"], where, one["text"], one.get("marks", ())) for one in found),
        *_of_counter(f, rows, where),
        *(CheckWarning(one["id"], where, one["text"]) for one in held_findings([f])),
        *_of_outliers(run, rows, f, where),
    ]
    return f, warnings


def _of_counter(f: RunFacts, rows: Rows, where: str) -> Iterator[CheckWarning]:
    for one in counter_findings([f]):
        yield CheckWarning(
            one["id"], where, one["text"], (_mark_at(f.file, rows, one["evidence"]["time_s"]),)
        )


def _mark_at(file: str, rows: Rows, time_s: float) -> Mark:
    """The row of a time, and the one before it."""
    k = int(np.searchsorted(rows.time_s, time_s))
    first, end = max(k - 1, 0), min(k + 1, len(rows) - 1)
    return Mark(file, (first + 1, k + 1), (float(rows.time_s[first]), float(rows.time_s[end])))


def _of_outliers(run: Run, rows: Rows, f: RunFacts, where: str) -> Iterator[CheckWarning]:
    """Spikes and bursts, with the lines that leave them out."""
    wild = departing_rows(rows, run, samples_per_block(_BLOCK_S, run.row_period_s))
    stretches = stretches_left_out(run, rows.time_s[wild])
    texts = [one["text"] for one in outlier_findings([f])]
    if f.outlier is not None and not texts:
        texts = [
            f"{f.outliers} rows depart from those around them by more than 8 times the noise, most at "
            f"{f.outlier.time_s:.10g} s: {f.outlier.rate_dph:.4g} deg/h"
        ]
    if stretches:
        line = exclude_line([(s.from_s, s.to_s) for s in stretches[:_LINES]], "outlier")
        more = f" ({len(stretches) - _LINES} more stretches)" if len(stretches) > _LINES else ""
        texts.append(
            f"{len(wild)} rows in {len(stretches)} stretches are spikes or bursts and do not reach the fit; to leave "
            f"them out of every figure: {line}{more}"
        )
    marks = [_mark(run.file, rows, s.from_s, s.to_s) for s in stretches[:_LINES]]
    if f.outlier is not None and not marks:
        marks = [_mark_at(run.file, rows, f.outlier.time_s)]
    if texts:
        yield CheckWarning(
            "rate_outliers", where, "; ".join(text.rstrip(".") for text in texts), tuple(marks)
        )


def _mark(file: str, rows: Rows, from_s: float, to_s: float) -> Mark:
    first, end = np.searchsorted(rows.time_s, (from_s, to_s))
    return Mark(file, (int(first) + 1, int(max(end, first + 1))), (from_s, to_s))


def warnings_of_data_set(
    dataset: Dataset,
    facts: Sequence[RunFacts],
    envelope: Envelope | None,
    earlier: Mapping[str, Model] | None = None,
) -> Iterator[CheckWarning]:
    """What all runs together raise.

    Args:
        earlier: Models of an earlier calibration, by axis.
    """
    for warning in dataset.warnings:
        where, _, text = warning.partition(": ")
        yield CheckWarning("left_out", where, text)
    isothermal = list(temperature_findings(facts))
    for one in (*isothermal, *jump_findings(facts), *earth_rate_findings(dataset, facts)):
        yield CheckWarning(one["id"], "data set", one["text"], _of_jumps(one))
    for one in (*contradiction_findings(facts), *thermometer_findings(dataset)):
        yield _of_run(one)
    for shared, one in zip(dataset.shared, shared_rows_findings(dataset), strict=True):
        yield CheckWarning(one["id"], shared.file, one["text"], shared.marks)
    for one in shared_axes_findings(dataset):
        yield CheckWarning(one["id"], one["evidence"]["file"], one["text"], (Mark(one["evidence"]["file"]),))
    reversed_files = {one["evidence"]["file"]: one for one in sign_findings(facts)}
    reversed_files |= {one["evidence"]["file"]: one for one in orientation_findings(dataset, earlier)}
    for one in reversed_files.values():
        yield CheckWarning(one["id"], one["evidence"]["file"], one["text"], (Mark(one["evidence"]["file"]),))
    yield from _between_runs(facts)
    training = [f for f in facts if f.role == "train" and len(f.slopes_c_per_min)]
    if training and not isothermal:
        yield from _of_holds(training)
    if envelope is not None:
        yield from _of_coverage(training, envelope)


def _of_run(one: dict[str, Any]) -> CheckWarning:
    evidence = one["evidence"]
    where = where_of(evidence["file"], evidence["from_s"])
    return CheckWarning(one["id"], where, one["text"], (Mark(evidence["file"]),))


def _of_jumps(one: dict[str, Any]) -> tuple[Mark, ...]:
    jumps = one["evidence"].get("jumps", [])[:_LINES]
    return tuple(Mark(j["file"], None, (j["time_s"], j["time_s"])) for j in jumps)


def _of_temperature(f: RunFacts, where: str) -> Iterator[CheckWarning]:
    for column in f.constant:
        yield CheckWarning("constant_channel", where, f"{column} holds one value in all {f.rows} rows")
    step = f.temperature_step_c
    if step >= _COARSE_STEP_C:
        what = "whole degrees" if step % 1.0 == 0.0 else f"steps of {step:.3g} C"
        text = f"temperature comes in {what}: its rate is the difference of two such steps"
        yield CheckWarning("coarse_temperature", where, text)


def _of_rate(f: RunFacts, rows: Rows, where: str, *, coarse: bool) -> Iterator[CheckWarning]:
    if 0.0 < f.largest_dph < _SMALL_DPH:
        text = f"no rate exceeds {f.largest_dph:.3g} deg/h; are they in deg/s or rad/s?"
        yield CheckWarning("small_rates", where, text)
    stuck = f.stuck_s > max(_STUCK_S, _STUCK_ROWS * f.row_period_s)
    if stuck and not coarse and "rate" not in f.constant:
        marks = (_stuck(f.file, rows),)
        yield CheckWarning("stuck_rate", where, f"the rate stays at one value for {f.stuck_s:.4g} s", marks)


def _stuck(file: str, rows: Rows) -> Mark:
    """The longest stretch of one rate in a file."""
    starts = np.flatnonzero(np.r_[True, rows.rate_dph[1:] != rows.rate_dph[:-1]])
    length = np.diff(np.r_[starts, len(rows)])
    k = int(np.argmax(length))
    first, last = int(starts[k]), int(starts[k] + length[k] - 1)
    return Mark(file, (first + 1, last + 1), (float(rows.time_s[first]), float(rows.time_s[last])))


def _of_time(f: RunFacts, where: str) -> Iterator[CheckWarning]:
    if abs(f.first_s) > _LATE_S:
        text = f"time starts at {f.first_s:.10g} s; it should count from power-on"
        yield CheckWarning("time_since_epoch", where, text)


def _between_runs(facts: Sequence[RunFacts]) -> Iterator[CheckWarning]:
    first: dict[str, str] = {}
    for f in facts:
        other = first.setdefault(f.sha256, f.file)
        if other != f.file:
            yield CheckWarning("same_recording_twice", f.file, f"holds the same bytes as {other}")
    periods = [f.row_period_s for f in facts]
    if periods and max(periods) > (1.0 + _PERIODS) * min(periods):
        text = f"row periods from {min(periods):.4g} to {max(periods):.4g} s"
        yield CheckWarning("row_periods_differ", "data set", text)


def _of_holds(facts: Sequence[RunFacts]) -> Iterator[CheckWarning]:
    holds = float(np.average([f.hold_share for f in facts], weights=[len(f.slopes_c_per_min) for f in facts]))
    if holds > _HOLDS:
        text = f"{holds:.0%} of the training time is held at one temperature: little is learnt about its rate"
        yield CheckWarning("mostly_holds", "data set", text)


def _of_coverage(facts: Sequence[RunFacts], envelope: Envelope) -> Iterator[CheckWarning]:
    """What the training runs do not show of the requested envelope."""
    slopes = np.concatenate([f.slopes_c_per_min for f in facts] or [np.zeros(0)])
    temperatures = np.concatenate([f.temperatures_c for f in facts] or [np.zeros(0)])
    for name, unit, values, (low, high) in (
        ("temperature", "C", temperatures, envelope[0]),
        ("temperature rate", "C/min", slopes, envelope[1]),
    ):
        margin = _ENVELOPE_MARGIN * (high - low)
        reached = (float(values.min()), float(values.max())) if len(values) else (np.nan, np.nan)
        if not (reached[0] <= low + margin and reached[1] >= high - margin):
            text = f"{name} covers {reached[0]:.4g} ... {reached[1]:.4g} of {low:.4g} ... {high:.4g} {unit}"
            yield CheckWarning("envelope_not_reached", "data set", text)
    seen, *_ = np.histogram2d(temperatures, slopes, bins=_ENVELOPE_CELLS, range=envelope)
    share = float(np.mean(seen > 0))
    text = f"{share:.0%} of the cells of temperature and its rate hold training data"
    yield CheckWarning("envelope_coverage", "data set", text)
