"""The page of `plan.json`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from markupsafe import Markup

from ..causes import CATALOGUE
from ..results.base import read_result
from ..results.files import json_text, write_atomically
from ..results.folder import result_folder
from ..results.recordings import Plan
from .chart import AFTER, BEFORE, Panel, drawing
from .display import with_unit
from .report import page_environment, page_from, write_page

_FULL = 30.0  # d from which a pair counts as inseparable
_LEAST = 10.0**0.5  # d below which a pair has no colour: well separated


def temperatures(result: Plan) -> Markup:
    """Temperature that the sensor will show in every run."""
    columns = min(3, len(result.runs))
    panels = []
    for k, run in enumerate(result.runs):
        panel = Panel(x="time, h", y="" if k % columns else "temperature, C", title=run.profile)
        panel.line(run.temperature.time_h, run.temperature.value_c, BEFORE)
        panels.append(panel)
    return drawing(panels, columns=columns, height=105.0, share_x=True, share_y=True)


def separability_matrix(result: Plan) -> Markup:
    """d from which the row's cause can be distinguished from the column's, on a logarithmic scale of grey."""
    rows = result.separability
    others = list(dict.fromkeys([*(row.id for row in rows), *(o for row in rows for o in row.d)]))
    places, texts, shades = [], [], []
    for k, row in enumerate(rows):
        for i, other in enumerate(others):
            value = row.d.get(other)
            if value is not None and np.isfinite(value):
                places.append((i, k))
                texts.append(f">{_FULL:.0f}" if value > _FULL else f"{value:.1f}")
                shades.append(np.log(max(value, _LEAST) / _LEAST) / np.log(_FULL / _LEAST))
    names = [row.id.replace("_", " ") + ("" if row.value is None else f" {row.value:.4g}") for row in rows]
    panel = Panel(
        x_range=(-0.5, len(others) - 0.5),
        y_range=(-0.5, len(rows) - 0.5),
        x_ticks=[(k, other.replace("_", "\n")) for k, other in enumerate(others)],
        y_ticks=[(len(rows) - 1 - k, name) for k, name in enumerate(names)],
    )
    x, y = np.array(places, dtype=np.float64).reshape(-1, 2).T
    panel.cells(x, len(rows) - 1 - y, texts, np.clip(shades, 0.0, 1.0))
    return drawing([panel], height=24.0 * len(rows) + 6.0)


def accuracy_by_hours(result: Plan) -> Markup:
    """Predicted RMS over the noise floor, and error of the map, over chamber hours."""
    hours = [a.hours for a in result.accuracy]
    left = Panel(x="chamber hours", y="RMS ÷ noise floor")
    right = Panel(x="chamber hours", y="error of the map, deg/h", y_log=True)
    left.horizontal(1.0, dash="5 3")
    for panel, color, values in (
        (left, AFTER, [a.rms_over_floor for a in result.accuracy]),
        (right, BEFORE, [a.map_error_dph for a in result.accuracy]),
    ):
        panel.line(hours, values, color)
        panel.dots(hours, values, color, size=6.0)
    return drawing([left, right], columns=2, height=150.0)


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
                limit=lambda id, value: with_unit(value, CATALOGUE[id].unit),
                temperatures=temperatures(result),
                matrix=separability_matrix(result),
                accuracy=accuracy_by_hours(result),
            )
        )
    return write_page(folder, text)
