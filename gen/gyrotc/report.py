"""`report.html`: one self-contained page from DIR/*.json and DIR/trace/*.csv. Computes nothing new."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from .errors import InputError
from .metrics import Averages, average
from .model import Model, load_model
from .outputs import result_folder, write_atomically
from .plots import allan_deviation, bias_over_time, curve_by_size, map_with_centers
from .terms import CATALOGUE
from .texts import file_stem, html_environment

__all__ = ["page_environment", "read_json", "write_page", "write_report"]


def write_report(folder: Path) -> Path:
    """Writes `folder/report.html` from what stands in the folder; returns its path.

    Raises:
        InputError: `model.json` or `evaluate.json` is missing or broken.
    """
    model = load_model(folder / "model.json")
    evaluation = read_json(folder / "evaluate.json")
    training = read_json(folder / "training.json", optional=True)
    verification = read_json(folder / "verify.json", optional=True)
    manifest = read_json(folder / "manifest.json", optional=True)
    text = (
        page_environment()
        .get_template("report.html.j2")
        .render(
            model=model,
            evaluation=evaluation,
            training=training,
            verification=verification,
            manifest=manifest,
            diagnosis=read_json(folder / "diagnosis" / "diagnose.json", optional=True),
            limits=read_json(folder / "limits.json", optional=True),
            changes=read_json(folder / "changes.json", optional=True),
            judged=_judged(evaluation),
            pictures=_pictures(folder, model, evaluation, training),
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


def read_json(path: Path, *, optional: bool = False) -> dict[str, Any]:
    """A JSON object that a stage wrote; {} for an optional one that is absent.

    Raises:
        InputError: It is missing or broken.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        if optional:
            return {}
        raise InputError(str(path), "is missing", "the result of gyrotc build or evaluate") from None
    except (OSError, ValueError) as error:
        raise InputError(str(path), f"cannot be read ({error})", "a JSON result") from error
    if not isinstance(content, dict):
        raise InputError(str(path), "is not a JSON object", "a JSON result")
    return content


def _judged(evaluation: dict[str, Any]) -> tuple[str, dict[str, Any] | None]:
    """What the model is judged by: exam runs, else spans left out, else the training runs themselves."""
    for key, text in (
        ("exam", "exam runs, never seen in training"),
        ("left_out", "spans left out of training in turn"),
        ("train", "the training runs themselves"),
    ):
        if evaluation.get(key):
            return text, evaluation[key]
    return "nothing", None


def _pictures(
    folder: Path, model: Model, evaluation: dict[str, Any], training: dict[str, Any]
) -> dict[str, str | None]:
    runs = []
    for run in evaluation["runs"]:
        averages = _trace(folder / "trace", run, float(evaluation["average_s"]))
        if averages is not None and averages.time_s.size:
            runs.append((run.get("environment") or run["file"], run["role"], averages))
    return {
        "bias": bias_over_time(runs) if runs else None,
        "map": map_with_centers(model),
        "curve": curve_by_size(training) if training else None,
        "allan": allan_deviation(training["noise"]) if training.get("noise") else None,
    }


def _trace(folder: Path, run: dict[str, Any], average_s: float) -> Averages | None:
    start = f"@{run.get('from_s') or 0.0:g}"
    stems = (file_stem(run["file"].replace("/", "_")), file_stem(Path(run["file"]).stem))
    names = [stem + end + ".csv" for stem in stems for end in (start, "")]
    path = next((folder / n for n in names if (folder / n).is_file()), None)
    if path is None:
        return None
    names = ["time_s", "temperature_c", "rate_dph", "compensated_dph"]
    types = pacsv.ConvertOptions(include_columns=names, column_types=dict.fromkeys(names, pa.float64()))
    columns = pacsv.read_csv(path, pacsv.ReadOptions(use_threads=False), convert_options=types).columns
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
