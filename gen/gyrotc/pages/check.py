"""The page of `gyrotc check --plots`: every error and warning with its rows, a picture, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from ..quality.check import Columned, Compared, Covered, Picture, Seen, Strip
from ..recordings.records import Curve
from ..results.recordings import Checked
from ..store.folder import write_result
from .chart import ACCENT, AFTER, BEFORE, COVERED, Panel, drawing
from .display import in_unit, rate_unit, shown
from .report import page_environment

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
        path,
        page.render(result=result, problems=problems, warnings=warnings, title=title, more=max(-left, 0)),
    )
