"""`gyrotc check`: all errors and warnings about recordings at once.

A problem is what `fit` refuses. A warning is what it takes and a person should look at. A recording that still grows
can be checked: its unfinished last line is left out, and that is a warning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .. import __version__
from ..common.errors import InputError
from ..model import Model
from ..recordings.description import Problems
from ..recordings.load import asked_axes, survey
from ..recordings.records import Applied, Dataset, Mark
from ..results.recordings import Checked, CheckedRun, MarkedRows, Problem, Suspected
from .facts import RunFacts
from .findings import CheckWarning, Envelope, looked_at, warnings_of_data_set, where_of


@dataclass(frozen=True, slots=True)
class CheckResult:
    """What `check` found.

    Attributes:
        serial: The stated one; None if that could not be read.
        axis: The one that was asked for.
        problems: What `fit` refuses.
        warnings: What a person should look at.
        facts: Axis and facts of every run that could be read.
        marks: Rows that a problem is about, by its text.
        datasets: Axis and data set of the runs that could be read.
    """

    serial: str | None
    axis: str | None
    problems: tuple[InputError, ...]
    warnings: tuple[CheckWarning, ...]
    facts: tuple[tuple[str | None, RunFacts], ...]
    marks: Mapping[str, tuple[Mark, ...]]
    datasets: tuple[tuple[str | None, Dataset], ...]

    def lines(self) -> Iterator[str]:
        """For a person: a line for each problem, warning (and what to do next) and run, and one that sums up."""
        for problem in self.problems:
            yield f"problem: {problem}"
        for warning in self.warnings:
            yield f"warning: {warning}"
            if warning.advice:
                yield f"  next: {warning.advice}"
        for axis, f in self.facts:
            yield _run_line(axis, f)
        verdict = "fit refuses these recordings" if self.problems else "fit takes these recordings"
        yield f"{_counted(self.problems, 'problem')}, {_counted(self.warnings, 'warning')}: {verdict}"

    def result(self) -> Checked:
        """What `gyrotc check --json` writes."""
        return Checked(
            gyrotc_version=__version__,
            serial=self.serial,
            axis=self.axis,
            problems=tuple(
                Problem(
                    where=p.where, found=p.found, expected=p.expected, rows=_rows(self.marks.get(str(p), ()))
                )
                for p in self.problems
            ),
            warnings=tuple(
                Suspected(id=d.id, where=d.where, text=d.text, next=d.advice, rows=_rows(d.marks))
                for d in self.warnings
            ),
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
    earlier: Mapping[str, Model] | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> CheckResult:
    """Checks a data set as `fit` would read it, and looks for what is suspect.

    Args:
        folder: The data set.
        axis: Axis of three-axis recordings; None or "all": every one.
        envelope: Temperatures and rates that the training runs should cover.
        applied: Model that was subtracted while recording, if the data set says that there was one.
        trust_units: Values that contradict their units are a warning, not a problem.
        earlier: Models of an earlier calibration of this gyro, by axis ("" where the recordings have one rate).

    Raises:
        InputError: The earlier calibration is of another gyro.
    """
    problems: dict[str, InputError] = {}
    marks: dict[str, tuple[Mark, ...]] = {}
    warnings: dict[CheckWarning, list[str | None]] = {}
    facts: list[tuple[str | None, RunFacts]] = []
    datasets: list[tuple[str | None, Dataset]] = []
    axes = _axes(folder, axis)
    for one in axes:
        reported = Problems(collect=True)
        progress("reading")
        dataset = survey(folder, reported, axis=one, applied=applied, trust_units=trust_units)
        problems |= {str(problem): problem for problem in reported.found}
        marks |= reported.marks
        if dataset is not None:
            _refuse_another(earlier or {}, dataset)
            datasets.append((one, dataset))
            looked = []
            for k, run in enumerate(dataset.runs, 1):
                progress(f"{run.file}, {k} of {len(dataset.runs)}")
                looked.append(looked_at(run))
            of_axis = [f for f, _ in looked]
            together = warnings_of_data_set(dataset, of_axis, envelope, earlier)
            for warning in (*together, *(warning for _, of_run in looked for warning in of_run)):
                warnings.setdefault(warning, []).append(one)
            facts += [(one, f) for f in of_axis]
    named = (_of_axes(warning, seen, len(axes)) for warning, seen in warnings.items())
    serial = datasets[-1][1].serial if datasets else None
    return CheckResult(
        serial, axis, tuple(problems.values()), tuple(named), tuple(facts), marks, tuple(datasets)
    )


def _rows(marks: Sequence[Mark]) -> tuple[MarkedRows, ...]:
    return tuple(MarkedRows(file=m.file, rows=m.rows, span_s=m.span_s) for m in marks)


def _of_axes(warning: CheckWarning, seen: Sequence[str | None], axes: int) -> CheckWarning:
    """Says for which axes a warning holds, where that is not for all."""
    if len(seen) == axes:
        return replace(warning, axes=tuple(seen))
    return replace(warning, where=f"{warning.where}, axis {', '.join(map(str, seen))}", axes=tuple(seen))


def _axes(folder: Path, axis: str | None) -> tuple[str | None, ...]:
    """The axes to look at; where they cannot be read the problem comes up again with its place."""
    try:
        return asked_axes(folder, axis)
    except InputError:
        return (axis,)


def _run_line(axis: str | None, f: RunFacts) -> str:
    earth = f", Earth's rate {f.earth.rate_dph:.4f} +- {f.earth.sigma_dph:.4f} deg/h off" if f.earth else ""
    return (
        f"{where_of(f.file, f.from_s)}{f', axis {axis}' if axis else ''} ({f.role}): {f.rows} rows of "
        f"{f.row_period_s:.4g} s, {f.temperature_c[0]:.4g} ... {f.temperature_c[1]:.4g} C, "
        f"mean {f.mean_dph:.4g} deg/h, noise {f.noise_dph:.2g} deg/h a row{earth}"
    )


def _checked_run(axis: str | None, f: RunFacts) -> CheckedRun:
    earth = (f.earth.rate_dph, f.earth.sigma_dph) if f.earth else (None, None)
    return CheckedRun.of_object(f, axis=axis, earth_rate_dph=earth[0], earth_rate_sigma_dph=earth[1])


def _counted(things: Sequence[object], word: str) -> str:
    return f"{len(things)} {word}" + "s" * (len(things) != 1)


def _refuse_another(models: Mapping[str, Model], dataset: Dataset) -> None:
    """Refuses models of an earlier calibration that are of another gyro."""
    for model in models.values():
        if model.serial != dataset.serial:
            axis = f", axis {model.axis}" if model.axis else ""
            raise InputError("--previous", f"is of gyro {model.serial}{axis}", f"gyro {dataset.serial}{axis}")
