"""`report.html`: one self-contained page from DIR/*.json and DIR/trace/*.csv. Computes nothing new."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from ..errors import InputError
from ..inputs import need_memory, open_input, refuse_above
from ..metrics import Averages, average
from ..model import Model, load_model
from ..outputs import result_folder, write_atomically
from ..results.base import read_optional, read_result
from ..results.changes import Changes
from ..results.diagnosed import Diagnosed
from ..results.evaluation import EvaluatedRun, Evaluation, Pooled
from ..results.limits import HeldLimits
from ..results.manifest import Manifest
from ..results.training import LeftOutRows, Training
from ..results.verification import Verification
from ..terms import CATALOGUE
from ..texts import file_stem, html_environment
from ..train.outliers import exclude_text
from .plots import allan_deviation, bias_over_time, curve_by_size, map_with_centers

__all__ = ["page_environment", "page_from", "write_page", "write_report"]

_JUDGED_ON = {
    "exam": "exam runs, never seen in training",
    "left_out": "spans left out of training in turn",
    "train": "the training runs themselves",
}
_TRACE_COPIES = 3.0 * 8.0 * 4  # bytes a row of its four columns while they are averaged
_LEAST_ROW_BYTES = 12  # six cells and their commas


def write_report(folder: Path) -> Path:
    """Writes `folder/report.html` from what stands in the folder; returns its path.

    Raises:
        InputError: `model.json` or `evaluate.json` is missing or broken.
    """
    model = load_model(folder / "model.json")
    evaluation = read_result(folder / "evaluate.json", Evaluation)
    training = read_optional(folder / "training.json", Training)
    beside = {
        "verification": read_optional(folder / "verify.json", Verification),
        "manifest": read_optional(folder / "manifest.json", Manifest),
        "diagnosis": read_optional(folder / "diagnosis" / "diagnose.json", Diagnosed),
        "limits": read_optional(folder / "limits.json", HeldLimits),
        "changes": read_optional(folder / "changes.json", Changes),
    }
    with page_from(folder):
        pictures = _pictures(folder, model, evaluation, training)
        text = (
            page_environment()
            .get_template("report.html.j2")
            .render(
                model=model,
                evaluation=evaluation,
                training=training,
                judged=_judged(evaluation),
                pictures=pictures,
                left_out=_left_out(training),
                **beside,
            )
        )
    return write_page(folder, text)


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

    Filters `sci` and `number` print figures; the test `moved_input` tells causes that change what the map sees.
    """
    environment = html_environment(sci=_sci, number=_number, plain=_plain)
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
        raise InputError(
            str(source), f"no page can be made of it ({what})", "results as gyrotc wrote them"
        ) from error


def _left_out(training: Training | None) -> list[tuple[str, list[LeftOutRows], str]]:
    """Files of which rows were left out of training: stretches, and the line that leaves them out of all figures."""
    outliers = training.outliers if training else None
    stretches = outliers.stretches if outliers else ()
    of_file = {
        name: [s for s in stretches if s.file == name] for name in dict.fromkeys(s.file for s in stretches)
    }
    return [(name, mine, exclude_text(mine)) for name, mine in of_file.items()]


def _judged(evaluation: Evaluation) -> tuple[str, Pooled | None]:
    """What the model is judged by, in words, and its figures."""
    name, figures = evaluation.judged() or ("", None)
    return _JUDGED_ON.get(name, "nothing"), figures


def _pictures(
    folder: Path, model: Model, evaluation: Evaluation, training: Training | None
) -> dict[str, str | None]:
    runs, left_out = [], []
    outliers = training.outliers if training else None
    stretches = outliers.stretches if outliers else ()
    for run in evaluation.runs:
        averages = _trace(folder / "trace", run, evaluation.average_s)
        if averages is not None and averages.time_s.size:
            runs.append((run.environment or run.file, run.role, averages))
            mine = [s.from_s for s in stretches if s.file == run.file and run.role == "train"]
            first, last = averages.time_s[0], averages.time_s[-1]
            left_out.append([t for t in mine if first <= t <= last])
    return {
        "bias": bias_over_time(runs, left_out) if runs else None,
        "map": map_with_centers(model),
        "curve": curve_by_size(training) if training else None,
        "allan": allan_deviation(training.noise) if training else None,
    }


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
    columns = read.columns
    del read
    time_s = columns[0].to_numpy()
    if not (np.isfinite(time_s).all() and np.all(time_s[1:] > time_s[:-1])):
        raise InputError(f"{path}, column time_s", "times that do not increase", "a trace as gyrotc wrote it")
    del time_s
    scored = np.ones(len(columns[0]), dtype=bool)
    # Popped, so that a full-rate trace is not in memory twice.
    return average(*(columns.pop(0).to_numpy() for _ in names), scored=scored, average_s=average_s)


def _sci(value: float | None, digits: int = 2) -> str:
    """A number with its power of ten, as the trade writes it: 7.00e-04 → 7.00·10⁻⁴."""
    if value is None:
        return "–"
    if value == 0.0:
        return "0"
    if 0.01 <= abs(value) < 1e5:
        return f"{value:.{digits + 1}g}" if abs(value) < 1e3 else f"{value:,.0f}"
    mantissa, exponent = f"{value:.{digits}e}".split("e")
    return f"{mantissa}·10" + str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _number(value: float | None, digits: int = 2) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _plain(value: Any) -> str:
    """A figure of any kind."""
    if isinstance(value, (list, tuple)):
        return " … ".join(_plain(v) for v in value) or "none"
    return _sci(value) if isinstance(value, float) else "–" if value is None else str(value)
