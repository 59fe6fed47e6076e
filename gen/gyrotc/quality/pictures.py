"""What the pictures of `gyrotc check --plots` show of each problem and each warning."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..recordings.reading import open_file
from ..recordings.records import Curve, Dataset, Mark
from ..results.findings import Finding
from .check import CheckResult
from .facts import RunFacts

Span = tuple[float, float]

_POINTS = 600  # of a strip; a picture has about as many columns
_ZOOM_WIDTHS, _ZOOM_ROWS = 4.0, 30  # what is drawn around a mark: widths of it, and rows at least
_ZOOM_SHARE = 0.6  # of the whole; a zoom that shows more shows nothing new
_MOST_FILES = 2  # of one finding
_AROUND = 60  # rows of a column before and behind a wrong one
_COMPARED = ("sign_reversed", "axes_exchanged", "runs_contradict", "earth_rate_not_stated")
_COVERED = ("envelope_not_reached", "envelope_coverage", "mostly_holds", "no_temperature_information")


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """Times (s) with the lowest and highest value of rate (deg/h) and temperature (C) about each; shape (n,)."""

    time_s: FloatArray
    rate_dph: tuple[FloatArray, FloatArray]
    temperature_c: tuple[FloatArray, FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """A run with its marked spans, whole, and around the first one."""

    title: str
    whole: Strip
    near: Strip | None
    spans_s: tuple[Span, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Columned:
    """A column of a file that was refused, over the number of the row; the wrong row."""

    title: str
    column: str
    rows: NDArray[np.int64]
    values: FloatArray
    wrong: int


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """Mean rates over temperature: of the runs that are reported, and of the others."""

    named: tuple[Curve, ...]
    others: tuple[Curve, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Covered:
    """Temperatures (C) and their rates (C/min) of the training runs, minute by minute."""

    temperature_c: FloatArray
    slope_c_per_min: FloatArray


Picture = Seen | Columned | Compared | Covered


def pictures_of(folder: Path, result: CheckResult) -> list[list[Picture]]:
    """Pictures of every problem, then of every warning, of a check of `folder`.

    Raises:
        InputError: A recording changed meanwhile.
    """
    of_problems = (_of_problem(folder, result, _marks(result, problem)) for problem in result.problems)
    return [list(one) for one in (*of_problems, *(_of_warning(result, warning) for warning in result.warnings))]


def _marks(result: CheckResult, problem: InputError) -> Sequence[Mark]:
    """Rows that a problem is about, or all of the run whose file it names."""
    named = result.marks.get(str(problem), ())
    files = [run.file for _, dataset in result.datasets[:1] for run in dataset.runs]
    return named or [Mark(file) for file in dict.fromkeys(files) if problem.where.startswith(f"{file},")]


def _of_problem(folder: Path, result: CheckResult, marks: Sequence[Mark]) -> Iterator[Picture]:
    for mark in marks[:_MOST_FILES]:
        if mark.column is not None and mark.rows is not None:
            columned = _column(folder, mark)
            if columned is not None:
                yield columned
        elif result.datasets:
            yield from _file_rows(result.datasets[0][1], [mark])


def _column(folder: Path, mark: Mark) -> Columned | None:
    assert mark.rows is not None
    assert mark.column is not None
    try:
        columns = open_file(mark.file, folder / mark.file).read((mark.column,))
    except (InputError, OSError):
        return None
    if columns is None:
        return None
    values = columns[mark.column]
    wrong = mark.rows[0] - 1
    first, end = max(wrong - _AROUND, 0), min(wrong + _AROUND, len(values))
    return Columned(mark.file, mark.column, np.arange(first, end) + 1, values[first:end], wrong + 1)


def _of_warning(result: CheckResult, warning: Finding) -> Iterator[Picture]:
    axis = warning.axes[0] if warning.axes else result.datasets[0][0]
    dataset = dict(result.datasets)[axis]
    facts = [f for of, f in result.facts if of == axis]
    files = list(dict.fromkeys(mark.file for mark in warning.rows)) or [f.file for f in facts if f.file == warning.file]
    if warning.id in _COVERED:
        yield _covered(facts)
    elif warning.id in _COMPARED:
        named = tuple(c for c in dataset.curves if c.file in files)
        yield Compared(named, tuple(c for c in dataset.curves if c.file not in files))
    else:
        for file in files[:_MOST_FILES]:
            yield from _file_rows(
                dataset,
                [Mark(m.file, m.rows, m.span_s) for m in warning.rows if m.file == file] or [Mark(file)],
            )


def _covered(facts: Sequence[RunFacts]) -> Covered:
    training = [f for f in facts if f.role == "train"]
    empty = [np.zeros(0)]
    return Covered(
        np.concatenate([f.temperatures_c for f in training] or empty),
        np.concatenate([f.slopes_c_per_min for f in training] or empty),
    )


def _file_rows(dataset: Dataset, marks: Sequence[Mark]) -> Iterator[Seen]:
    """The file of the marks, which are all in one."""
    run = next((r for r in dataset.runs if r.file == marks[0].file), None)
    if run is None:
        return
    rows = run.rows()
    spans = tuple(m.span_s for m in marks if m.span_s is not None)
    columns = (rows.time_s, rows.rate_dph, rows.temperature_c)
    near = None
    if spans:
        start, end = spans[0]
        margin = max(_ZOOM_WIDTHS * (end - start), _ZOOM_ROWS * run.row_period_s)
        inside = (rows.time_s >= start - margin) & (rows.time_s <= end + margin)
        if 2 <= inside.sum() < _ZOOM_SHARE * len(rows):
            near = _strip(*(c[inside] for c in columns))
    title = run.file if dataset.axis is None else f"{run.file}, axis {dataset.axis}"
    yield Seen(title, _strip(*columns), near, spans)


def _strip(time: FloatArray, rate: FloatArray, temperature: FloatArray) -> Strip:
    starts = np.unique(np.linspace(0, len(time), min(_POINTS, len(time)), endpoint=False).astype(np.int64))

    def ends(values: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)

    return Strip(time[starts], ends(rate), ends(temperature))
