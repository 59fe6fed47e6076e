"""`gyrotc check`: all errors and warnings about recordings at once.

A problem is what `fit` refuses. A warning is what it takes and a person should look at. A recording that still grows
can be checked: its unfinished last line is left out, and that is a warning.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import __version__
from ..common.errors import InputError
from ..common.progress import Progress, Stages, silent
from ..model import Model
from ..recordings.description import Problems
from ..recordings.loading import asked_axes, load_reporting
from ..recordings.plausibility import TRUSTED
from ..recordings.records import Applied, Dataset, Mark, Run
from ..results.base import Finding, MarkedRows
from ..results.recordings import Checked, CheckedRun, Problem
from ..results.rows import RowsCount
from .curves import contradiction_findings, curve_findings, open_questions
from .event_findings import row_count, row_findings
from .findings import (
    RunFacts,
    coarse_rate_findings,
    constant_findings,
    copied_channel_findings,
    counter_findings,
    earth_rate_findings,
    finding,
    held_findings,
    run_facts,
    shared_axes_findings,
    shared_rows_findings,
    temperature_findings,
)
from .judgement import Judgement, judge
from .thermometers import thermometer_findings
from .timing import time_findings

_HOLDS = 0.8  # share of the time: beyond it dT/dt is learnt from less than a fifth
_PERIODS = 0.01  # relative: clocks of loggers differ by less, another sample rate by more


@dataclass(frozen=True, slots=True)
class CheckResult:
    """Result of `check`.

    Attributes:
        serial: The stated one; None if that could not be read.
        axis: The one that was asked for.
        problems: What `fit` refuses.
        warnings: What a person should look at.
        not_testable: What the recordings cannot tell.
        facts: Axis and facts of every run that could be read.
        counts: Count of the rows of these runs.
        marks: Rows that a problem is about, by its text.
    """

    serial: str | None
    axis: str | None
    problems: tuple[InputError, ...]
    warnings: tuple[Finding, ...]
    not_testable: tuple[Finding, ...]
    facts: tuple[tuple[str | None, RunFacts], ...]
    counts: tuple[RowsCount, ...]
    marks: Mapping[str, tuple[Mark, ...]]

    def lines(self) -> Iterator[str]:
        """Yield a line for each problem, warning, open question and run, and one that sums up."""
        for problem in self.problems:
            yield f"problem: {problem}"
        advised = (("warning", "advice", self.warnings), ("not testable", "to test it", self.not_testable))
        for kind, advice, found in advised:
            for one in found:
                yield f"{kind}: {one}"
                if one.next:
                    yield f"  {advice}: {one.next}"
                if one.exclude:
                    yield f"  paste: {one.exclude}"
        for (axis, f), count in zip(self.facts, self.counts, strict=True):
            yield _run_line(axis, f, count)
        verdict = "fit refuses these recordings" if self.problems else "fit takes these recordings"
        yield f"{_counted(self.problems, 'problem')}, {_counted(self.warnings, 'warning')}: {verdict}"

    def result(self) -> Checked:
        """Return the result of `gyrotc check --json`."""
        return Checked(
            gyrotc_version=__version__,
            serial=self.serial,
            axis=self.axis,
            problems=tuple(
                Problem(where=p.where, found=p.found, expected=p.expected, rows=_rows(self.marks.get(str(p), ())))
                for p in self.problems
            ),
            warnings=self.warnings,
            not_testable=self.not_testable,
            runs=tuple(_checked_run(axis, f, count) for (axis, f), count in zip(self.facts, self.counts, strict=True)),
        )


# As `gyrotc check -v` measures them on data of `gyrotc simulate paper`.
_STAGES = {"reading": 0.05, "judging rows": 0.75, "looking at each run": 0.2}


def check(
    folder: Path,
    *,
    axis: str | None = None,
    applied: Applied | None = None,
    earlier: Mapping[str, Model] | None = None,
    progress: Progress = silent,
) -> CheckResult:
    """Check a data set as `fit` would read it, and look for what is suspect.

    Args:
        folder: The data set.
        axis: Axis of three-axis recordings; None or "all": every one.
        applied: Model that was subtracted while recording, if the data set says that there was one.
        earlier: Models of an earlier calibration of this gyro, by axis ("" where the recordings have one rate).

    Raises:
        InputError: The earlier calibration is of another gyro.
    """
    problems: dict[str, InputError] = {}
    marks: dict[str, tuple[Mark, ...]] = {}
    warnings: _Seen = {}
    untold: _Seen = {}
    facts: list[tuple[str | None, RunFacts]] = []
    counts: list[RowsCount] = []
    serial: str | None = None
    axes = _axes(folder, axis)
    of_axes = Stages(progress, dict.fromkeys(map(str, axes), 1.0))
    for one in axes:
        say = Stages(of_axes.within(str(one)), _STAGES)
        reported = Problems(collect=True)
        say("reading")
        dataset = load_reporting(folder, reported, axis=one, applied=applied)
        problems |= {str(problem): problem for problem in reported.found}
        marks |= reported.marks
        if dataset is not None:
            _refuse_another(earlier or {}, dataset)
            serial = dataset.serial
            say("judging rows")
            judged = judge(dataset)
            looked = []
            for k, run in enumerate(dataset.runs):
                say("looking at each run", k, len(dataset.runs))
                looked.append(_looked_at(run, judged.of(run)))
            of_axis = [f for f, _ in looked]
            together = _of_all_runs(dataset, of_axis, earlier)
            _see(warnings, (*together, *(warning for _, of_run in looked for warning in of_run)), one)
            _see(untold, open_questions(dataset, of_axis, earlier), one)
            facts += [(one, f) for f in of_axis]
            counts += [row_count(judged.of(run)) for run in dataset.runs]
    named, open_ = (tuple(_of_axes(w, of, len(axes)) for w, of in found.values()) for found in (warnings, untold))
    return CheckResult(serial, axis, tuple(problems.values()), named, open_, tuple(facts), tuple(counts), marks)


_Seen = dict[tuple[str, str, str], tuple[Finding, list[str | None]]]  # and the axes that show it


def _see(seen: _Seen, findings: Iterable[Finding], axis: str | None) -> None:
    for one in findings:
        seen.setdefault((one.id, one.where, one.text), (one, []))[1].append(axis)


def _rows(marks: Sequence[Mark]) -> tuple[MarkedRows, ...]:
    return tuple(MarkedRows(file=m.file, rows=m.rows, span_s=m.span_s) for m in marks)


def _of_axes(warning: Finding, seen: Sequence[str | None], axes: int) -> Finding:
    """State the axes of a warning if it is not of all."""
    if len(seen) == axes:
        return warning
    named = tuple(map(str, seen))
    return warning.model_copy(update={"axes": named, "where": f"{warning.where}, axis {', '.join(named)}"})


def _axes(folder: Path, axis: str | None) -> tuple[str | None, ...]:
    """The axes to look at; where they cannot be read the problem comes up again with its place."""
    try:
        return asked_axes(folder, axis)
    except InputError:
        return (axis,)


def _run_line(axis: str | None, f: RunFacts, count: RowsCount) -> str:
    earth = f", Earth's rate {f.earth.rate_dph:.4f} +- {f.earth.sigma_dph:.4f} deg/h off" if f.earth else ""
    return (
        f"{f.file}{'' if f.from_s is None else f' from {f.from_s:.6g} s'}{f', axis {axis}' if axis else ''} "
        f"({f.role}): {count.words()}; a row every {f.row_period_s:.4g} s, "
        f"{f.temperature_c[0]:.4g} ... {f.temperature_c[1]:.4g} C, "
        f"mean {f.mean_dph:.4g} deg/h, noise {f.noise_dph:.2g} deg/h a row "
        f"({f.noise_dph * np.sqrt(f.row_period_s / 3600.0):.2g} deg/sqrt(h)){earth}"
    )


def _checked_run(axis: str | None, f: RunFacts, count: RowsCount) -> CheckedRun:
    earth = (f.earth.rate_dph, f.earth.sigma_dph) if f.earth else (None, None)
    return CheckedRun.of_object(f, axis=axis, rows=count, earth_rate_dph=earth[0], earth_rate_sigma_dph=earth[1])


def _counted(things: Sequence[object], word: str) -> str:
    return f"{len(things)} {word}" + "s" * (len(things) != 1)


def _refuse_another(models: Mapping[str, Model], dataset: Dataset) -> None:
    """Refuse models of an earlier calibration of another gyro."""
    for model in models.values():
        if model.serial != dataset.serial:
            axis = f", axis {model.axis}" if model.axis else ""
            raise InputError("--previous", f"is of gyro {model.serial}{axis}", f"gyro {dataset.serial}{axis}")


def findings_of_run(judgement: Judgement, f: RunFacts) -> Iterator[Finding]:
    """Yield what the rows of a run show by themselves of its temperature sensor, its rate and its counter."""
    yield from counter_findings(f)
    yield from held_findings(f)
    yield from row_findings(judgement)


def findings_of_data_set(
    dataset: Dataset, facts: Sequence[RunFacts], earlier: Mapping[str, Model] | None = None
) -> Iterator[Finding]:
    """Report what all runs together show.

    Args:
        earlier: Models of an earlier calibration, by axis.
    """
    yield from earth_rate_findings(dataset, facts)
    yield from contradiction_findings(facts)
    yield from thermometer_findings(dataset)
    yield from shared_rows_findings(dataset)
    yield from shared_axes_findings(dataset)
    yield from curve_findings(dataset, facts, earlier)


def _looked_at(run: Run, judgement: Judgement) -> tuple[RunFacts, list[Finding]]:
    """Facts of a run, and the warnings that its rows alone raise."""
    rows = run.rows()
    f = run_facts(run, rows)
    found = [
        *constant_findings(f),
        *time_findings(run, rows),
        *coarse_rate_findings(run, rows),
        *copied_channel_findings(run, rows),
        *findings_of_run(judgement, f),
    ]
    return f, found


def _of_all_runs(dataset: Dataset, facts: Sequence[RunFacts], earlier: Mapping[str, Model] | None) -> Iterator[Finding]:
    """Yield findings of all runs together."""
    for warning in dataset.warnings:
        where, _, text = warning.partition(": ")
        yield finding("units_trusted" if text.startswith(TRUSTED) else "left_out", text, where)
    isothermal = list(temperature_findings(facts))
    yield from isothermal
    yield from findings_of_data_set(dataset, facts, earlier)
    yield from _between_runs(facts)
    training = [f for f in facts if f.role == "train" and len(f.slopes_c_per_min)]
    if training and not isothermal:
        yield from _of_holds(training)


def _between_runs(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    first: dict[str, str] = {}
    for f in facts:
        other = first.setdefault(f.sha256, f.file)
        if other != f.file:
            yield finding("same_recording_twice", f"holds the same bytes as {other}", f.file)
    periods = [f.row_period_s for f in facts]
    if periods and max(periods) > (1.0 + _PERIODS) * min(periods):
        yield finding("row_periods_differ", f"row periods from {min(periods):.4g} to {max(periods):.4g} s")


def _of_holds(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    holds = float(np.average([f.hold_share for f in facts], weights=[len(f.slopes_c_per_min) for f in facts]))
    if holds > _HOLDS:
        text = f"{holds:.0%} of the training time is held at one temperature: little is learnt about its rate"
        yield finding("mostly_holds", text)
