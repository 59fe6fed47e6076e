# long: every doubt about recordings is told here
"""`gyrotc check`: everything that is wrong with recordings, and everything that is doubtful, at once.

A problem is what `fit` refuses. A doubt is what it takes and a person should look at. A recording that still grows
can be checked: its unfinished last line is left out, and that is a doubt.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import __version__
from ..dataset import Applied, Dataset, Run, RunFacts, axes_of, facts_of, survey
from ..dataset.problems import Problems
from ..errors import InputError
from ..frontend import departing_rows, samples_per_block
from ..results.check import Checked, CheckedRun, Doubted, Problem
from ..train.outliers import stretches_left_out
from .findings import (
    contradiction_findings,
    counter_findings,
    earth_rate_findings,
    jump_findings,
    outlier_findings,
    temperature_findings,
)
from .recorded import copied_channel_findings, shared_rows_findings, sign_findings, stuck_temperature_findings

__all__ = ["CheckResult", "Doubt", "Envelope", "check", "envelope_of"]

Envelope = tuple[tuple[float, float], tuple[float, float]]
"""Lowest and highest temperature (C), lowest and highest temperature rate (C/min)."""

_COARSE_STEP_C = 0.25
_HOLDS = 0.8
_STUCK_S = 60.0
_STUCK_ROWS = 30
_LATE_S = 3.0e8  # ten years: a time since some epoch, not since power-on
_SMALL_DPH = 1e-5  # below the noise of any gyro; deg/s or rad/s taken for deg/h
_PERIODS = 0.01
_ENVELOPE_CELLS = (20, 8)
_ENVELOPE_MARGIN = 0.05
_BLOCK_S = 10.0  # as `fit` has it where nothing else is asked for
_LINES = 20


@dataclass(frozen=True, slots=True)
class Doubt:
    """Something doubtful: a stable id, where, what."""

    id: str
    where: str
    text: str

    def __str__(self) -> str:
        return f"{self.where}: {self.text}"


@dataclass(frozen=True, slots=True)
class CheckResult:
    """What `check` found.

    Attributes:
        serial: The stated one; None if that could not be read.
        axis: The one that was asked for.
        problems: What `fit` refuses.
        doubts: What a person should look at.
        facts: Axis and facts of every run that could be read.
    """

    serial: str | None
    axis: str | None
    problems: tuple[InputError, ...]
    doubts: tuple[Doubt, ...]
    facts: tuple[tuple[str | None, RunFacts], ...]

    def lines(self) -> Iterator[str]:
        """For a person: one line for each problem, doubt and run, and a last one that sums up."""
        for problem in self.problems:
            yield f"problem: {problem}"
        for doubt in self.doubts:
            yield f"doubt: {doubt}"
        for axis, f in self.facts:
            yield _run_line(axis, f)
        verdict = "fit refuses these recordings" if self.problems else "fit takes these recordings"
        yield f"{len(self.problems)} problems, {len(self.doubts)} doubts: {verdict}"

    def result(self) -> Checked:
        """What `gyrotc check --json` writes."""
        return Checked(
            gyrotc_version=__version__,
            serial=self.serial,
            axis=self.axis,
            problems=tuple(Problem(where=p.where, found=p.found, expected=p.expected) for p in self.problems),
            doubts=tuple(Doubted(id=d.id, where=d.where, text=d.text) for d in self.doubts),
            runs=tuple(_checked_run(axis, f) for axis, f in self.facts),
        )


def envelope_of(text: str) -> Envelope:
    """`-40:60,-5:5`: lowest and highest temperature, C, and rate, C/min.

    Raises:
        InputError: It is not of that form.
    """
    try:
        (t0, t1), (r0, r1) = (tuple(float(v) for v in part.split(":")) for part in text.split(","))
    except ValueError:
        t0 = t1 = r0 = r1 = np.nan
    if not (-np.inf < t0 < t1 < np.inf and -np.inf < r0 < r1 < np.inf):
        raise InputError("envelope", repr(text), "T0:T1,R0:R1 in C and C/min, such as -40:60,-5:5")
    return (t0, t1), (r0, r1)


def check(
    folder: Path,
    *,
    axis: str | None = None,
    envelope: Envelope | None = None,
    applied: Applied | None = None,
    trust_units: bool = False,
) -> CheckResult:
    """Checks a data set as `fit` would read it, and looks for what is doubtful.

    Args:
        folder: The data set.
        axis: Axis of three-axis recordings, or "all".
        envelope: Temperatures and rates that the training runs should cover.
        applied: Model that was subtracted while recording, if the data set says that there was one.
        trust_units: Values that contradict their units are a doubt, not a problem.
    """
    problems: dict[str, InputError] = {}
    doubts: dict[Doubt, list[str | None]] = {}
    facts: list[tuple[str | None, RunFacts]] = []
    serial = None
    axes = _axes(folder, axis)
    for one in axes:
        told = Problems(collect=True)
        dataset = survey(folder, told, axis=one, applied=applied, trust_units=trust_units)
        problems |= {str(problem): problem for problem in told.found}
        if dataset is not None:
            serial = dataset.serial
            looked = [_look(run) for run in dataset.runs]
            of_axis = [f for f, _, _ in looked]
            offered = dict(text for _, text, _ in looked if text)
            copied = [doubt for _, _, doubts_of_run in looked for doubt in doubts_of_run]
            for doubt in (*_with_exclusions(_doubts(dataset, of_axis, envelope), offered), *copied):
                doubts.setdefault(doubt, []).append(one)
            facts += [(one, f) for f in of_axis]
    named = (_of_axes(doubt, seen, len(axes)) for doubt, seen in doubts.items())
    return CheckResult(serial, axis, tuple(problems.values()), tuple(named), tuple(facts))


def _look(run: Run) -> tuple[RunFacts, tuple[str, str] | None, list[Doubt]]:
    """Facts of a run; where, and with which lines, its spikes can be left out; doubts of its columns."""
    rows = run.rows()
    f = facts_of(run, rows)
    where = _where(f.file, f.from_s)
    seen = (*copied_channel_findings(run, rows), *stuck_temperature_findings(run, rows))
    copied = [Doubt(c["id"], where, c["text"]) for c in seen]
    wild = departing_rows(rows, run, samples_per_block(_BLOCK_S, run.row_period_s))
    stretches = stretches_left_out(run, rows.time_s[wild])
    if not stretches:
        return f, None, copied
    shown = ", ".join(
        f'{{from_s = {s.from_s!r}, to_s = {s.to_s!r}, reason = "outlier"}}' for s in stretches[:_LINES]
    )
    more = f" ({len(stretches) - _LINES} more stretches)" if len(stretches) > _LINES else ""
    text = (
        f"{len(wild)} rows in {len(stretches)} stretches are spikes or bursts and do not reach the fit; to leave them "
        f"out of every figure: exclude = [{shown}]{more}"
    )
    return f, (where, text), copied


def _with_exclusions(doubts: Iterator[Doubt], offered: dict[str, str]) -> Iterator[Doubt]:
    """Doubts about outliers with the lines that leave them out, which `offered` has by place."""
    left = dict(offered)
    for doubt in doubts:
        text = left.pop(doubt.where, None) if doubt.id == "rate_outliers" else None
        yield Doubt(doubt.id, doubt.where, f"{doubt.text}; {text}") if text else doubt
    for where, text in left.items():
        yield Doubt("rate_outliers", where, text)


def _of_axes(doubt: Doubt, seen: Sequence[str | None], axes: int) -> Doubt:
    """Says for which axes a doubt holds, where that is not for all."""
    if len(seen) == axes:
        return doubt
    return Doubt(doubt.id, f"{doubt.where}, axis {', '.join(map(str, seen))}", doubt.text)


def _axes(folder: Path, axis: str | None) -> tuple[str | None, ...]:
    """The axes to look at; where they cannot be read the problem comes up again with its place."""
    if axis != "all":
        return (axis,)
    try:
        return axes_of(folder) or ("all",)
    except InputError:
        return (None,)


def _doubts(dataset: Dataset, facts: Sequence[RunFacts], envelope: Envelope | None) -> Iterator[Doubt]:
    for warning in dataset.warnings:
        where, _, text = warning.partition(": ")
        yield Doubt("left_out", where, text)
    isothermal = list(temperature_findings(facts))
    for finding in (*isothermal, *jump_findings(facts), *earth_rate_findings(dataset, facts)):
        yield Doubt(finding["id"], "data set", finding["text"])
    for finding in (*counter_findings(facts), *outlier_findings(facts), *contradiction_findings(facts)):
        where = _where(finding["evidence"]["file"], finding["evidence"]["from_s"])
        yield Doubt(finding["id"], where, finding["text"])
    for finding in (*shared_rows_findings(dataset), *sign_findings(facts)):
        yield Doubt(finding["id"], finding["evidence"]["file"], finding["text"])
    for f in facts:
        yield from _doubts_of_temperature(f)
        yield from _doubts_of_rate(f)
        yield from _doubts_of_time(f)
    yield from _doubts_between_runs(facts)
    training = [f for f in facts if f.role == "train" and len(f.slopes_c_per_min)]
    if training and not isothermal:
        yield from _doubts_of_holds(training)
    if envelope is not None:
        yield from _doubts_of_coverage(training, envelope)


def _doubts_of_temperature(f: RunFacts) -> Iterator[Doubt]:
    where = _where(f.file, f.from_s)
    for column in f.constant:
        yield Doubt("constant_channel", where, f"{column} holds one value in all {f.rows} rows")
    step = f.temperature_step_c
    if step >= _COARSE_STEP_C:
        what = "whole degrees" if step % 1.0 == 0.0 else f"steps of {step:.3g} C"
        text = f"temperature comes in {what}: its rate is the difference of two such steps"
        yield Doubt("coarse_temperature", where, text)


def _doubts_of_rate(f: RunFacts) -> Iterator[Doubt]:
    where = _where(f.file, f.from_s)
    if 0.0 < f.largest_dph < _SMALL_DPH:
        text = f"no rate exceeds {f.largest_dph:.3g} deg/h; are they in deg/s or rad/s?"
        yield Doubt("small_rates", where, text)
    if f.outlier is not None and not any(outlier_findings([f])):
        text = (
            f"{f.outliers} rows depart from those around them by more than 8 times the noise, most at "
            f"{f.outlier.time_s:.10g} s: {f.outlier.rate_dph:.4g} deg/h"
        )
        yield Doubt("rate_outliers", where, text)
    stuck = f.stuck_s > max(_STUCK_S, _STUCK_ROWS * f.row_period_s)
    if stuck and "rate" not in f.constant:
        yield Doubt("stuck_rate", where, f"the rate stays at one value for {f.stuck_s:.4g} s")


def _doubts_of_time(f: RunFacts) -> Iterator[Doubt]:
    where = _where(f.file, f.from_s)
    if f.gaps:
        yield Doubt(
            "gaps", where, f"{f.gaps} gaps; {f.missing_rows} rows of {f.row_period_s:.4g} s are missing"
        )
    if abs(f.first_s) > _LATE_S:
        text = f"time starts at {f.first_s:.10g} s; it should count from power-on"
        yield Doubt("time_since_epoch", where, text)


def _doubts_between_runs(facts: Sequence[RunFacts]) -> Iterator[Doubt]:
    first: dict[str, str] = {}
    for f in facts:
        other = first.setdefault(f.sha256, f.file)
        if other != f.file:
            yield Doubt("same_recording_twice", f.file, f"holds the same bytes as {other}")
    periods = [f.row_period_s for f in facts]
    if periods and max(periods) > (1.0 + _PERIODS) * min(periods):
        text = f"row periods from {min(periods):.4g} to {max(periods):.4g} s"
        yield Doubt("row_periods_differ", "data set", text)


def _doubts_of_holds(facts: Sequence[RunFacts]) -> Iterator[Doubt]:
    holds = float(np.average([f.hold_share for f in facts], weights=[len(f.slopes_c_per_min) for f in facts]))
    if holds > _HOLDS:
        text = f"{holds:.0%} of the training time is held at one temperature: little is learnt about its rate"
        yield Doubt("mostly_holds", "data set", text)


def _doubts_of_coverage(facts: Sequence[RunFacts], envelope: Envelope) -> Iterator[Doubt]:
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
            yield Doubt("envelope_not_reached", "data set", text)
    seen, *_ = np.histogram2d(temperatures, slopes, bins=_ENVELOPE_CELLS, range=envelope)
    share = float(np.mean(seen > 0))
    text = f"{share:.0%} of the cells of temperature and its rate hold training data"
    yield Doubt("envelope_coverage", "data set", text)


def _where(file: str, from_s: float | None) -> str:
    return file if from_s is None else f"{file} from {from_s:.6g} s"


def _run_line(axis: str | None, f: RunFacts) -> str:
    earth = f", Earth's rate {f.earth.rate_dph:.4f} +- {f.earth.sigma_dph:.4f} deg/h off" if f.earth else ""
    return (
        f"{_where(f.file, f.from_s)}{f', axis {axis}' if axis else ''} ({f.role}): {f.rows} rows of "
        f"{f.row_period_s:.4g} s, {f.temperature_c[0]:.4g} ... {f.temperature_c[1]:.4g} C, "
        f"mean {f.mean_dph:.4g} deg/h, noise {f.noise_dph:.2g} deg/h a row{earth}"
    )


def _checked_run(axis: str | None, f: RunFacts) -> CheckedRun:
    return CheckedRun(
        axis=axis,
        file=f.file,
        from_s=f.from_s,
        role=f.role,
        environment=f.environment,
        rows=f.rows,
        first_s=f.first_s,
        last_s=f.last_s,
        row_period_s=f.row_period_s,
        gaps=f.gaps,
        missing_rows=f.missing_rows,
        temperature_c=f.temperature_c,
        mean_dph=f.mean_dph,
        noise_dph=f.noise_dph,
        hold_share=f.hold_share,
        earth_rate_dph=f.earth.rate_dph if f.earth else None,
        earth_rate_sigma_dph=f.earth.sigma_dph if f.earth else None,
    )
