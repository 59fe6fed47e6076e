"""Pictures of the report: matplotlib figures in, SVG text out. Draws; computes nothing.

Every function takes arrays and returns one `<svg>` element that fits the page's width. The same data
give the same bytes (no dates, fixed ids).
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..common.metrics import Averages
from ..common.texts import checked_svg, picture_text
from ..model import Model
from ..results.training import NoiseTerms, Training

__all__ = [
    "ACCENT",
    "AFTER",
    "BEFORE",
    "COVERED",
    "STYLE",
    "allan_deviation",
    "bias_over_time",
    "curve_by_size",
    "map_with_centers",
    "svg",
]

BEFORE, AFTER, COVERED, ACCENT = "#b4552d", "#1f6f8b", "#7a7a7a", "#222222"
STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "gyrotc",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
}


def svg(figure: Figure, identifier: str | None = None) -> Markup:
    """The figure as an SVG element without prologue, date or fixed size; `identifier` goes into its metadata."""
    with mpl.rc_context(STYLE):
        stream = io.StringIO()
        figure.savefig(
            stream, format="svg", metadata={"Date": None, "Creator": None, "Identifier": identifier}
        )
    text = stream.getvalue()
    text = re.sub(
        r"<!--.*?-->", "", text[text.index("<svg") :], flags=re.DOTALL
    )  # what a formula was written as
    text = re.sub(r' height="[\d.]+pt"', "", text, count=1)
    return checked_svg(re.sub(r'(<svg[^>]*?) width="[^"]*"', r'\1 width="100%"', text, count=1))


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")


def bias_over_time(
    runs: Sequence[tuple[str, str, Averages]], left_out_s: Sequence[Sequence[float]] = ()
) -> str:
    """Measured and compensated bias of every run (label, role, averages), one panel a run, common scales.

    Args:
        left_out_s: Times of rows that were left out of training, for each run, s; drawn as marks above.
    """
    with mpl.rc_context(STYLE):
        columns = min(3, len(runs))
        rows = -(-len(runs) // columns)
        figure = _figure(10.0, 0.5 + 1.75 * rows)
        axes = figure.subplots(rows, columns, sharey=True, squeeze=False)
        for ax in axes.flat[len(runs) :]:
            ax.set_visible(False)
        marks = [*left_out_s, *[()] * (len(runs) - len(left_out_s))]
        for ax, (label, role, a), times in zip(axes.flat, runs, marks, strict=False):
            hours = (a.time_s - (a.time_s[0] if a.time_s.size else 0.0)) / 3600.0
            ax.axhline(0.0, color=ACCENT, linewidth=0.6)
            ax.plot(hours, a.before_dph, color=BEFORE, linewidth=0.8, label="measured")
            ax.plot(hours, a.after_dph, color=AFTER, linewidth=0.8, label="compensated")
            ax.set_title(f"{picture_text(label)} ({role})", fontsize=8.5, loc="left")
            if times and a.time_s.size:
                at = (np.array(times) - a.time_s[0]) / 3600.0
                top = ax.get_xaxis_transform()
                ax.plot(at, np.full(len(at), 0.97), "v", color=ACCENT, markersize=4, transform=top)
        for ax in axes[-1]:
            ax.set_xlabel("time, h")
        for ax in axes[:, 0]:
            ax.set_ylabel("deg/h")
        handles, labels = axes[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=2)
        return svg(figure)


def map_with_centers(model: Model) -> str:
    """The map over its envelope, hatched where there was no training data, with its centers."""
    (t0, t1), (r0, r1) = _shown(model.envelope.temperature_c), _shown(model.envelope.slope_c_per_min)
    t, r = np.linspace(t0, t1, 160), np.linspace(r0, r1, 80)
    tt, rr = np.meshgrid(t, r)
    bias = model.map_dph(tt, rr)
    with mpl.rc_context(STYLE):
        figure = _figure(10.0, 3.6)
        left, right = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
        image = left.pcolormesh(t, r, bias, cmap="cividis", shading="nearest", rasterized=True)
        figure.colorbar(image, ax=left, label="bias, deg/h")
        _hatch_uncovered(left, model)
        _draw_centers(left, model, (t0, t1), (r0, r1))
        left.set(xlabel="temperature T, C", ylabel="dT/dt, C/min", xlim=(t0, t1), ylim=(r0, r1))
        left.set_title(
            "map; circles: centers, triangles: beyond; hatched: no training data", fontsize=8.5, loc="left"
        )
        left.grid(visible=False)
        for rate, style in zip(np.linspace(r0, r1, 3), ("--", "-", ":"), strict=True):
            right.plot(
                t,
                model.map_dph(t, np.full_like(t, rate)),
                style,
                color=AFTER,
                linewidth=1.2,
                label=f"{round(rate, 2) + 0.0:+.2f} C/min",  # + 0.0: not "-0.00"
            )
        right.set(xlabel="temperature T, C", ylabel="bias, deg/h")
        right.set_title("cuts through the map", fontsize=8.5, loc="left")
        right.legend(fontsize=8)
        return svg(figure)


def _draw_centers(ax: Axes, model: Model, t_span: tuple[float, float], r_span: tuple[float, float]) -> None:
    """Centers where they are; one outside the map as a triangle at its edge that points there."""
    style: Any = {"mfc": "white", "mec": ACCENT, "linestyle": "none", "clip_on": False, "zorder": 5}
    for t, r in (center for network in model.networks for center in network.centers):
        x, y = min(max(t, t_span[0]), t_span[1]), min(max(r, r_span[0]), r_span[1])
        if (x, y) == (t, r):
            marker = "o"
        elif x != t:
            marker = "<" if t < x else ">"
        else:
            marker = "v" if r < y else "^"
        ax.plot([x], [y], marker, markersize=5 if marker == "o" else 7, **style)


def _shown(limits: tuple[float, float]) -> tuple[float, float]:
    """Limits of an axis: those of the envelope, a little apart where they are one value."""
    low, high = limits
    return limits if high > low else (low - 0.5, high + 0.5)


def _hatch_uncovered(ax: Axes, model: Model) -> None:
    if model.coverage is None:
        return
    (t0, t1), (r0, r1) = _shown(model.envelope.temperature_c), _shown(model.envelope.slope_c_per_min)
    seen = np.array([[c == "1" for c in row] for row in model.coverage.rows])
    t = np.linspace(t0, t1, seen.shape[1] + 1)
    r = np.linspace(r0, r1, seen.shape[0] + 1)
    centers_t, centers_r = (t[:-1] + t[1:]) / 2, (r[:-1] + r[1:]) / 2
    if min(seen.shape) < 2:
        return
    with mpl.rc_context({"hatch.color": "#ffffff", "hatch.linewidth": 0.5}):
        ax.contourf(
            centers_t, centers_r, np.where(seen, 0.0, 1.0), levels=[0.5, 2.0], colors="none", hatches=["////"]
        )


def curve_by_size(training: Training) -> str | None:
    """What each further center brings: error left over the number of centers, the chosen one marked."""
    curves = training.curves
    sizes = curves.get("sizes") or []
    if len(sizes) < 2:
        return None
    n = [s["centers"] for s in sizes]
    keys = [(k, label) for k, label in _CURVES if all(s.get(k) is not None for s in sizes)]
    with mpl.rc_context(STYLE):
        figure = _figure(10.0, 2.8)
        ax = figure.subplots()
        for (key, label), color in zip(keys, (AFTER, BEFORE, COVERED, ACCENT), strict=False):
            ax.semilogy(
                n,
                np.maximum([s[key] for s in sizes], 1e-12),
                "o-",
                color=color,
                markersize=3.5,
                linewidth=1.0,
                label=label,
            )
        chosen = curves.get("chosen")
        if chosen is not None:
            ax.axvline(chosen, color=ACCENT, linewidth=0.8, linestyle="--", label=f"chosen: {chosen}")
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        ax.set(xlabel="number of centers")
        ax.legend(fontsize=8)
        return svg(figure)


_CURVES = (
    ("unexplained", "1 − Σ error-reduction ratio"),
    ("departure", "squared departure from the smooth estimate ÷ noise variance"),
    ("misfit", "cost of the fit"),
)


def allan_deviation(noise: NoiseTerms) -> str | None:
    """Allan deviation over averaging time, with its uncertainty and the line of the angle random walk."""
    points = [p for p in noise.allan if p.deviation_dph > 0.0]
    if len(points) < 2:
        return None
    tau = np.array([p.tau_s for p in points])
    value = np.array([p.deviation_dph for p in points])
    spread = value / np.sqrt(2.0 * np.array([p.freedom for p in points]))
    with mpl.rc_context(STYLE):
        figure = _figure(10.0, 2.8)
        ax = figure.subplots()
        low = np.minimum(spread, 0.9 * value)
        ax.errorbar(
            tau, value, yerr=(low, spread), fmt="o-", color=AFTER, markersize=3.5, linewidth=1.0, capsize=2
        )
        walk = noise.arw_deg_per_sqrt_h
        if walk:
            ax.plot(
                tau,
                walk * 60.0 / np.sqrt(tau),
                "--",
                color=BEFORE,
                linewidth=1.0,
                label=f"N = {walk:.2e} deg/√h",
            )
            ax.legend(fontsize=8)
        ax.set(xscale="log", yscale="log", xlabel="averaging time, s", ylabel="deg/h")
        return svg(figure)
