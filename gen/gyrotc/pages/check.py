"""The page of `gyrotc check --plots`: every error and warning with its rows, a picture, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..common.texts import picture_text
from ..quality.pictures import Columned, Compared, Covered, Picture, Seen, Strip
from ..recordings.records import Curve
from ..results.recordings import Checked
from ..store.folder import write_result
from .plots import ACCENT, AFTER, BEFORE, COVERED, STYLE, svg
from .report import page_environment

__all__ = ["picture", "write_check_page"]

_WIDE = 10.0  # inches, as every picture of a page
_NARROW = 0.004  # of the picture's width: spans below it get a mark above
_MOST_OTHERS = 40  # curves: more are a grey area


def picture(shown: Picture) -> str:
    """One picture as SVG."""
    with mpl.rc_context(STYLE):
        if isinstance(shown, Seen):
            return svg(_seen(shown))
        if isinstance(shown, Columned):
            return svg(_columned(shown))
        return svg(_compared(shown) if isinstance(shown, Compared) else _covered(shown))


def _seen(shown: Seen) -> Figure:
    """Rate above, temperature below; the whole run, and beside it the rows around the first mark."""
    strips = [shown.whole] if shown.near is None else [shown.whole, shown.near]
    figure = Figure(figsize=(_WIDE, 3.4), layout="constrained")
    axes = figure.subplots(2, len(strips), squeeze=False, sharex="col")
    for column, strip in zip(axes.T, strips, strict=True):
        for ax, values, color in (
            (column[0], strip.rate_dph, BEFORE),
            (column[1], strip.temperature_c, AFTER),
        ):
            _band(ax, strip, values, color)
            _marks(ax, strip, shown.spans_s)
        column[1].set_xlabel("time, s")
    axes[0][0].set_ylabel("rate, deg/h")
    axes[1][0].set_ylabel("temperature, C")
    axes[0][0].set_title(picture_text(shown.title), fontsize=8.5, loc="left")
    if len(strips) > 1:
        axes[0][1].set_title("around the first mark", fontsize=8.5, loc="left")
    return figure


def _band(ax: Axes, strip: Strip, values: tuple[np.ndarray, np.ndarray], color: str) -> None:
    low, high = values
    if np.array_equal(low, high, equal_nan=True):
        ax.plot(strip.time_s, low, ".-", color=color, linewidth=0.6, markersize=2.0)
    else:
        ax.fill_between(strip.time_s, low, high, color=color, linewidth=0.6, step="post")


def _marks(ax: Axes, strip: Strip, spans: tuple[tuple[float, float], ...]) -> None:
    first, last = float(strip.time_s[0]), float(strip.time_s[-1])
    inside = [(max(a, first), min(b, last)) for a, b in spans if a <= last and b >= first]
    for a, b in inside:
        ax.axvspan(a, b, color=ACCENT, alpha=0.15, linewidth=0)
    narrow = [0.5 * (a + b) for a, b in inside if b - a < _NARROW * (last - first)]
    if not narrow:
        return
    top = ax.get_xaxis_transform()
    ax.plot(narrow, np.full(len(narrow), 0.97), "v", color=ACCENT, markersize=4, transform=top, clip_on=False)


def _columned(shown: Columned) -> Figure:
    figure = Figure(figsize=(_WIDE, 2.2), layout="constrained")
    ax = figure.subplots()
    ax.plot(shown.rows, shown.values, ".-", color=AFTER, linewidth=0.6, markersize=3.0)
    ax.axvline(shown.wrong, color=BEFORE, linewidth=1.0)
    ax.set(xlabel="row", ylabel=picture_text(shown.column))
    ax.set_title(picture_text(shown.title), fontsize=8.5, loc="left")
    return figure


def _compared(shown: Compared) -> Figure:
    every = (*shown.named, *shown.others)
    panels = max((max(len(c.axes), 1) for c in every), default=1)
    figure = Figure(figsize=(_WIDE, 2.6), layout="constrained")
    axes = figure.subplots(1, panels, squeeze=False)[0]
    for curve in shown.others[:_MOST_OTHERS]:
        _curve(axes, curve, COVERED, "the other runs" if curve is shown.others[0] else None)
    for curve in shown.named[:_MOST_OTHERS]:
        _curve(axes, curve, BEFORE, picture_text(curve.file))
    for ax in axes:
        ax.set_xlabel("temperature, C")
    axes[0].set_ylabel("mean rate, deg/h")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2, fontsize=8)
    return figure


def _curve(axes: list[Axes], curve: Curve, color: str, label: str | None) -> None:
    for k in range(curve.rates_dph.shape[1]):
        axes[k].plot(
            curve.temperature_c,
            curve.rates_dph[:, k],
            ".-",
            color=color,
            linewidth=0.9,
            markersize=3,
            label=label,
        )
        if curve.axes:
            axes[k].set_title(f"axis {curve.axes[k]}", fontsize=8.5, loc="left")


def _covered(shown: Covered) -> Figure:
    figure = Figure(figsize=(_WIDE, 2.6), layout="constrained")
    ax = figure.subplots()
    ax.plot(shown.temperature_c, shown.slope_c_per_min, ".", color=AFTER, markersize=2.5)
    ax.set(xlabel="temperature, C", ylabel="dT/dt, C/min")
    ax.set_title("training, minute by minute", fontsize=8.5, loc="left")
    return figure


_MOST = 100  # pictures of one page


def write_check_page(path: Path, result: Checked, pictures: Sequence[Sequence[Picture]], title: str) -> None:
    """Writes the page of a check.

    Args:
        pictures: Of each problem, then of each warning.
        title: Of a data set whose serial could not be read.

    Raises:
        InputError: There is a file at `path` that gyrotc did not write.
    """
    left = _MOST
    drawn: list[list[str]] = []
    for shown in pictures:
        drawn.append([picture(one) for one in shown[: max(left, 0)]])
        left -= len(shown)
    problems = list(zip(result.problems, drawn, strict=False))
    warnings = list(zip(result.warnings, drawn[len(problems) :], strict=True))
    page = page_environment().get_template("check.html.j2")
    write_result(
        path,
        page.render(result=result, problems=problems, warnings=warnings, title=title, more=max(-left, 0)),
    )
