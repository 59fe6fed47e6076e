"""`report.html`: one self-contained page from DIR/*.json and DIR/trace/*.csv. Computes nothing new."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import jinja2
import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from markupsafe import Markup

from ..causes import CATALOGUE
from ..common.arrays import numpy_of
from ..common.errors import InputError
from ..common.inputs import need_memory, open_input, refuse_above
from ..common.metrics import Averages, average
from ..common.texts import file_stem, html_environment
from ..recordings.description import exclude_line
from ..results.evaluation import EvaluatedRun
from ..results.training import LeftOutRows, Training
from ..store.files import write_atomically
from ..store.folder import result_folder
from .display import displayed, rate_unit
from .plots import (
    bias_over_time,
    calibrations_over_time,
    curve_by_size,
    map_with_centers,
    prior_and_posterior,
)
from .thermal import allan_deviation, bias_against_temperature
from .unit import UnitResults, unit_in
from .words import (
    bound_words,
    limit_words,
    measured_words,
    plain,
    rounded,
    sci,
    with_uncertainty,
    words,
    words_of_candidate,
)

_ORDER = ("FAIL", "CONDITIONAL PASS", "", "PASS")  # of axes on their common page
_TRACE_COPIES = 3.0 * 8.0 * 4  # bytes a row of its four columns while they are averaged
_LEAST_ROW_BYTES = 12  # six cells and their commas


def write_report(folder: Path, display: str | None = None) -> Path:
    """Writes `folder/report.html` from what stands in the folder; returns its path.

    Args:
        display: Unit of rates; None: that of the limits, else deg/h.

    Raises:
        InputError: `model.json` or `evaluate.json` is missing or broken, or the unit is not known.
    """
    unit = unit_in(folder)
    with displayed(display or unit.display), page_from(folder):
        unit = unit.shown()
        pictures = _pictures(folder, unit)
        template = page_environment().get_template("report.html.j2")
        text = template.render(unit=unit, pictures=pictures, left_out=_left_out(unit.training), **vars(unit))
    return write_page(folder, text)


def axes_page(folder: Path, axes: Sequence[str], display: str | None = None) -> str:
    """The page of a unit with several axes, each in a folder of its name: those that failed first.

    Args:
        display: As of `write_report`.

    Raises:
        InputError: A result of an axis is missing or broken.
    """
    units = [unit_in(folder / axis) for axis in axes]
    with displayed(display or units[0].display), page_from(folder):
        units = [unit.shown() for unit in units]
        ordered = sorted(units, key=lambda unit: (_ORDER.index(unit.verdict), -unit.counts["FAIL"]))
        pictures = {u.model.axis: thermal_picture(folder / str(u.model.axis), u) for u in units}
        worst = ordered[0].verdict
        template = page_environment().get_template("axes.html.j2")
        trends = {unit.model.axis: _trend(unit) for unit in units}
        return template.render(units=ordered, pictures=pictures, trends=trends, verdict=worst)


def write_page(folder: Path, text: str) -> Path:
    """Writes `folder/report.html`; returns its path.

    Raises:
        InputError: There is one that gyrotc did not write, or that was changed since.
    """
    with result_folder(folder, "report", kind="", entries=("report.html",)) as stage:
        write_atomically(stage.folder / "report.html", text)
    return folder / "report.html"


@functools.cache
def page_environment() -> jinja2.Environment:
    """Where pages come from, compiled once in a process.

    Filters print figures and words (`words`); the test `moved_input` tells causes that change what the map sees.
    """
    environment = html_environment(
        sci=sci, number=_number, times=_times, chance=_chance, known=with_uncertainty, plain=plain, rounded=rounded,
        words=words, candidate=words_of_candidate, limit_words=limit_words, bound_words=bound_words,
        measured_words=measured_words,
    )  # fmt: skip
    environment.globals["rate"] = rate_unit
    environment.tests["moved_input"] = lambda id: id in CATALOGUE and CATALOGUE[id].kind == "input"
    return environment


@contextmanager
def page_from(source: Path) -> Iterator[None]:
    """Refuses results with which drawing stumbles: it computes nothing, so they are not as they were written.

    Raises:
        InputError: It stumbled.
    """
    try:
        yield
    except (
        ArithmeticError,
        LookupError,
        TypeError,
        ValueError,
        AttributeError,
        jinja2.TemplateError,
    ) as error:
        what = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise InputError(str(source), f"no page can be made of it ({what})", "results as gyrotc wrote them") from error


def _left_out(training: Training | None) -> list[tuple[str, list[LeftOutRows], str]]:
    """Files of which rows were left out of training: stretches, and the line that leaves them out of all figures."""
    outliers = training.outliers if training else None
    stretches = outliers.stretches if outliers else ()
    of_file = {name: [s for s in stretches if s.file == name] for name in dict.fromkeys(s.file for s in stretches)}
    return [(name, mine, exclude_line(((s.from_s, s.to_s) for s in mine), "outlier")) for name, mine in of_file.items()]


@dataclass(frozen=True, slots=True)
class _Traced:
    """A run of which there is a trace: its means, and times (s) of rows that were left out of training."""

    run: EvaluatedRun
    means: Averages
    left_out_s: list[float]


def _pictures(folder: Path, unit: UnitResults) -> dict[str, Markup | None]:
    traced = list(_traced(folder, unit))
    return {
        "thermal": bias_against_temperature(unit.model, [one.means for one in traced]),
        "bias": _over_time(traced),
        "map": map_with_centers(unit.model),
        "curve": curve_by_size(unit.training) if unit.training else None,
        "lot": prior_and_posterior(unit.training) if unit.training else None,
        "allan": allan_deviation(unit.training.noise) if unit.training else None,
        "trend": _trend(unit),
    }


def thermal_picture(folder: Path, unit: UnitResults) -> Markup | None:
    """Bias of one axis against temperature, from the traces of its folder; None where there are none."""
    return bias_against_temperature(unit.model, [one.means for one in _traced(folder, unit)])


def _trend(unit: UnitResults) -> Markup | None:
    return calibrations_over_time(unit.changes.history) if unit.changes else None


def _traced(folder: Path, unit: UnitResults) -> Iterator[_Traced]:
    """Runs of a result that have a trace."""
    outliers = unit.training.outliers if unit.training else None
    stretches = outliers.stretches if outliers else ()
    for run in unit.evaluation.runs:
        means = _trace(folder / "trace", run, unit.evaluation.average_s)
        if means is not None and means.time_s.size:
            mine = [s.from_s for s in stretches if s.file == run.file and run.role == "train"]
            first, last = means.time_s[0], means.time_s[-1]
            yield _Traced(run, means, [t for t in mine if first <= t <= last])


def _over_time(traced: Sequence[_Traced]) -> Markup | None:
    if not traced:
        return None
    runs = [(one.run.environment or one.run.file, one.run.role, one.means) for one in traced]
    return bias_over_time(runs, [one.left_out_s for one in traced])


def _trace(folder: Path, run: EvaluatedRun, average_s: float) -> Averages | None:
    start = f"@{run.from_s or 0.0:g}"
    stems = (file_stem(run.file.replace("/", "_")), file_stem(Path(run.file).stem))
    names = [stem + end + ".csv" for stem in stems for end in (start, "")]
    path = next((folder / n for n in names if (folder / n).is_file()), None)
    if path is None:
        return None
    names = ["time_s", "temperature_c", "rate_dph", "compensated_dph"]
    types = pacsv.ConvertOptions(include_columns=names, column_types=dict.fromkeys(names, pa.float64()))
    file, size = open_input(path, str(path), "a trace")
    refuse_above("recording_mib", size / 2**20, str(path), "MiB")
    need_memory(_TRACE_COPIES * size / _LEAST_ROW_BYTES, str(path), "its rows")
    with file:
        read = pacsv.read_csv(file, pacsv.ReadOptions(use_threads=False), convert_options=types)
    columns = [[np.zeros(0), *map(numpy_of, column.chunks)] for column in read.columns]
    del read
    time_s = np.concatenate(columns[0])
    if not (np.isfinite(time_s).all() and np.all(time_s[1:] > time_s[:-1])):
        raise InputError(f"{path}, column time_s", "times that do not increase", "a trace as gyrotc wrote it")
    scored = np.ones(len(time_s), dtype=bool)
    del time_s
    # Popped, so that a full-rate trace is not in memory twice.
    return average(*(np.concatenate(columns.pop(0)) for _ in names), scored=scored, average_s=average_s)


def _number(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _times(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.2f}×" if value < 9.995 else f"{value:.1f}×" if value < 99.95 else f"{value:.0f}×"


def _chance(value: float) -> str:
    return "< 0.1 %" if value < 1e-3 else f"{100.0 * value:.2g} %"
