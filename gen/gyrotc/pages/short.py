"""The short pages: of `check --plots`, and of `plan.json`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from ..causes import CATALOGUE
from ..quality.check import Columned, Compared, Covered, Picture, Seen, Strip
from ..recordings.records import Curve
from ..results.base import read_result
from ..results.files import json_text, write_atomically
from ..results.folder import result_folder, write_result
from ..results.recordings import Checked, Plan
from .chart import ACCENT, AFTER, BEFORE, COVERED, Panel, drawing
from .display import in_unit, rate_unit, shown, with_unit
from .report import page_environment, page_from, write_page

_NARROW = 0.004  # of the picture's width: spans below it get a mark above
_MOST_OTHERS = 40  # curves: more are a grey area


def picture(shown: Picture) -> Markup:
    """One picture as SVG."""
    if isinstance(shown, Seen):
        return _seen(shown)
    if isinstance(shown, Columned):
        return _columned(shown)
    return _compared(shown) if isinstance(shown, Compared) else _covered(shown)


def _seen(shown: Seen) -> Markup:
    """Rate above, temperature below; the whole run, and beside it the rows around the first mark."""
    strips = [(shown.whole, shown.title)]
    if shown.near is not None:
        strips.append((shown.near, "around the first mark"))
    panels = []
    for name, rates in ((f"rate, {rate_unit()}", True), ("temperature, C", False)):
        for k, (strip, title) in enumerate(strips):
            panel = Panel(x="" if rates else "time, s", y="" if k else name, title=title if rates else "")
            _band(
                panel,
                strip,
                (in_unit(strip.rate_dph[0]), in_unit(strip.rate_dph[1])) if rates else strip.temperature_c,
                BEFORE if rates else AFTER,
            )
            _marks(panel, strip, shown.spans_s)
            panels.append(panel)
    return drawing(panels, columns=len(strips), height=110.0)


def _band(panel: Panel, strip: Strip, values: tuple[np.ndarray, np.ndarray], color: str) -> None:
    low, high = values
    if np.array_equal(low, high, equal_nan=True):
        panel.line(strip.time_s, low, color, width=0.8)
        panel.dots(strip.time_s, low, color, size=2.5)
    else:
        panel.band(strip.time_s, low, high, color)
        panel.line(strip.time_s, low, color, width=0.8)
        panel.line(strip.time_s, high, color, width=0.8)


def _marks(panel: Panel, strip: Strip, spans: tuple[tuple[float, float], ...]) -> None:
    first, last = float(strip.time_s[0]), float(strip.time_s[-1])
    inside = [(max(a, first), min(b, last)) for a, b in spans if a <= last and b >= first]
    for a, b in inside:
        panel.span(a, b, ACCENT)
    narrow = [0.5 * (a + b) for a, b in inside if b - a < _NARROW * (last - first)]
    if narrow:
        panel.tops(narrow)


def _columned(shown: Columned) -> Markup:
    panel = Panel(x="row", y=shown.column, title=shown.title, whole_x=True)
    panel.line(shown.rows, shown.values, AFTER, width=0.8)
    panel.dots(shown.rows, shown.values, AFTER, size=3.0)
    panel.vertical(shown.wrong, BEFORE, width=1.2)
    return drawing([panel], height=120.0)


def _compared(shown: Compared) -> Markup:
    every = (*shown.named, *shown.others)
    count = max((max(len(c.axes), 1) for c in every), default=1)
    panels = [Panel(x="temperature, C", y="" if k else f"mean rate, {rate_unit()}") for k in range(count)]
    for curve in shown.others[:_MOST_OTHERS]:
        _curve(panels, curve, COVERED, "the other runs")
    for curve in shown.named[:_MOST_OTHERS]:
        _curve(panels, curve, BEFORE, curve.file)
    return drawing(panels, columns=count, height=150.0)


def _curve(panels: Sequence[Panel], curve: Curve, color: str, label: str) -> None:
    for k in range(curve.rates_dph.shape[1]):
        rates = in_unit(curve.rates_dph[:, k])
        panels[k].line(curve.temperature_c, rates, color, label)
        panels[k].dots(curve.temperature_c, rates, color, size=4.0)
        if curve.axes:
            panels[k].title = f"axis {curve.axes[k]}"


def _covered(shown: Covered) -> Markup:
    panel = Panel(x="temperature, C", y="dT/dt, C/min", title="training, minute by minute")
    panel.dots(shown.temperature_c, shown.slope_c_per_min, AFTER, size=3.0)
    return drawing([panel], height=150.0)


_MOST = 100  # pictures of one page


def write_check_page(path: Path, result: Checked, pictures: Sequence[Sequence[Picture]], title: str) -> None:
    """Writes the page of a check, rates as they are shown.

    Args:
        pictures: Of each problem, then of each warning.
        title: Of a data set whose serial could not be read.

    Raises:
        InputError: There is a file at `path` that gyrotc did not write.
    """
    result, left = shown(result), _MOST
    drawn: list[list[Markup]] = []
    for some in pictures:
        drawn.append([picture(one) for one in some[: max(left, 0)]])
        left -= len(some)
    problems = list(zip(result.problems, drawn, strict=False))
    warnings = list(zip(result.warnings, drawn[len(problems) :], strict=True))
    page = page_environment().get_template("check.html.j2")
    write_result(
        path, page.render(result=result, problems=problems, warnings=warnings, title=title, more=max(-left, 0))
    )


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
    right = Panel(x="chamber hours", y=f"error of the map, {rate_unit()}", y_log=True)
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
    result = shown(read_result(folder / "plan.json", Plan))
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
