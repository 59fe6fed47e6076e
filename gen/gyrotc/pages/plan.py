"""`report.html` of a plan and its pictures, from `plan.json`. Computes nothing new."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from ..common.texts import picture_text
from ..results.base import read_result
from ..results.planned import Plan
from ..store.files import json_text, write_atomically
from ..store.folder import result_folder
from .plots import ACCENT, AFTER, BEFORE, STYLE, svg
from .report import page_environment, page_from, write_page

__all__ = [
    "accuracy_by_hours",
    "is_plan",
    "separability_matrix",
    "temperatures",
    "write_plan",
    "write_plan_page",
]

_FULL = 30.0  # d from which a pair counts as inseparable


def temperatures(result: Plan) -> str:
    """Temperature that the sensor will show in every run."""
    runs = result.runs
    columns = min(3, len(runs))
    rows = -(-len(runs) // columns)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 0.5 + 1.6 * rows), layout="constrained")
        axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for ax in axes.flat[len(runs) :]:
            ax.set_visible(False)
        for ax, run in zip(axes.flat, runs, strict=False):
            ax.plot(run.temperature.time_h, run.temperature.value_c, color=BEFORE, linewidth=1.1)
            ax.set_title(picture_text(run.profile), fontsize=8.5, loc="left")
        figure.supxlabel("h", fontsize=9)
        figure.supylabel("temperature at the sensor, C", fontsize=9)
        return svg(figure)


def separability_matrix(result: Plan) -> str:
    """d from which the row's cause can be distinguished from the column's, on a logarithmic scale of grey."""
    rows = result.separability
    others = list(dict.fromkeys([*(row.id for row in rows), *(o for row in rows for o in row.d)]))
    d = np.array([[row.d.get(o, np.nan) for o in others] for row in rows])
    names = [
        picture_text(row.id.replace("_", " ")) + ("" if row.value is None else f" {row.value:.4g}")
        for row in rows
    ]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 1.4 + 0.33 * len(rows)), layout="constrained")
        ax = figure.subplots()
        shade = np.log(np.clip(d, np.sqrt(10.0), _FULL))
        ax.imshow(shade, cmap="Oranges", aspect="auto", vmin=np.log(np.sqrt(10.0)), vmax=np.log(_FULL))
        for k, line in enumerate(d):
            for i, value in enumerate(line):
                if np.isfinite(value):
                    text = f">{_FULL:.0f}" if value > _FULL else f"{value:.1f}"
                    ax.text(i, k, text, ha="center", va="center", fontsize=8, color=ACCENT)
        ax.set_xticks(range(len(others)), [picture_text(o).replace("_", "\n") for o in others], fontsize=8)
        ax.set_yticks(range(len(rows)), names, fontsize=8)
        ax.grid(visible=False)
        return svg(figure)


def accuracy_by_hours(result: Plan) -> str:
    """Predicted RMS over the noise floor, and error of the map, over chamber hours."""
    hours = [a.hours for a in result.accuracy]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 2.6), layout="constrained")
        left, right = figure.subplots(1, 2)
        left.plot(hours, [a.rms_over_floor for a in result.accuracy], "o-", color=AFTER, markersize=4)
        left.axhline(1.0, color=ACCENT, linewidth=0.7, linestyle="--")
        left.set(xlabel="chamber hours", ylabel="RMS of 100 s means / noise floor")
        right.semilogy(hours, [a.map_error_dph for a in result.accuracy], "o-", color=BEFORE, markersize=4)
        right.set(xlabel="chamber hours", ylabel="error of the map, deg/h")
        return svg(figure)


def is_plan(folder: Path) -> bool:
    """Whether a folder holds a plan (and not a build)."""
    return (folder / "plan.json").is_file() and not (folder / "evaluate.json").exists()


def write_plan(folder: Path, result: Plan) -> Path:
    """Writes `folder/plan.json` and `folder/report.html`; returns the page's path."""
    with result_folder(folder, "plan") as stage:
        write_atomically(stage.folder / "plan.json", json_text(result.content()))
        write_plan_page(stage.folder)
    return folder / "report.html"


def write_plan_page(folder: Path) -> Path:
    """Writes `folder/report.html` from `folder/plan.json`; returns its path.

    Raises:
        InputError: `plan.json` is missing or broken.
    """
    result = read_result(folder / "plan.json", Plan)
    with page_from(folder / "plan.json"):
        text = (
            page_environment()
            .get_template("plan.html.j2")
            .render(
                p=result,
                temperatures=temperatures(result),
                matrix=separability_matrix(result),
                accuracy=accuracy_by_hours(result),
            )
        )
    return write_page(folder, text)
