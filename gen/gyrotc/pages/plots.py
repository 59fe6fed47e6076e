"""Pictures of reports, of a unit's history, of lots and of priors: matplotlib figures in, SVG text out.

Every function takes arrays and returns one `<svg>` element that fits the page's width. The same data
give the same bytes (no dates, fixed ids).
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from datetime import date
from itertools import pairwise
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ..common.metrics import Averages
from ..common.texts import checked_svg, picture_text
from ..model import Model
from ..results.evaluation import Calibration
from ..results.fleet import Facts, FleetEntry, Reason, ResidualSeries
from ..results.training import NoiseTerms, Training

__all__ = [
    "ACCENT",
    "AFTER",
    "BEFORE",
    "COVERED",
    "STYLE",
    "allan_deviation",
    "bias_over_time",
    "calibrations_over_time",
    "curve_by_size",
    "lot_picture",
    "map_with_centers",
    "outlier_picture",
    "prior_and_posterior",
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
    """Limits of an axis: those of the envelope, widened a little where they are one value."""
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


_MOST_NAMED = 12  # dates that fit below a panel


def calibrations_over_time(history: Sequence[Calibration]) -> str | None:
    """RMS as found and as left, and the map's mean against the first calibration's; None with fewer than two."""
    if len(history) < 2:
        return None
    at, days = _times(history)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 3.0), layout="constrained")
        left, right = figure.subplots(1, 2)
        _remaining(left, at, history)
        _moved(right, at, history)
        for ax in (left, right):
            _labelled(ax, at, history, days)
        return svg(figure)


def _times(history: Sequence[Calibration]) -> tuple[list[float], bool]:
    """Days since the first where each has a date after the one before, else the number of each."""
    try:
        days = [float(date.fromisoformat(str(one.date)[:10]).toordinal()) for one in history]
    except ValueError:
        days = []
    if days and all(b > a for a, b in pairwise(days)):
        return [day - days[0] for day in days], True
    return [float(k) for k in range(1, len(history) + 1)], False


def _remaining(ax: Axes, at: Sequence[float], history: Sequence[Calibration]) -> None:
    series = (
        ("as found: the correction before", BEFORE, [one.as_found_rms_dph for one in history]),
        ("as left: the new one", AFTER, [one.as_left_rms_dph for one in history]),
    )
    for label, color, values in series:
        known = [(t, v) for t, v in zip(at, values, strict=True) if v is not None]
        if known:
            ax.plot(*zip(*known, strict=True), "o-", color=color, linewidth=1.0, markersize=4, label=label)
            ax.legend(fontsize=8)
    ax.set(ylabel="RMS of what remains, deg/h")
    ax.set_ylim(bottom=0.0)


def _moved(ax: Axes, at: Sequence[float], history: Sequence[Calibration]) -> None:
    """Steps of the map's mean, summed; each with the U of how far the map moved, and filled where that is exceeded."""
    steps = [one.moved_mean_dph or 0.0 for one in history]
    total = np.cumsum(steps) - steps[0]
    ax.axhline(0.0, color=ACCENT, linewidth=0.6)
    ax.plot(at, total, "-", color=COVERED, linewidth=1.0)
    for k, one in enumerate(history):
        style: Any = {"color": AFTER, "markersize": 5, "mfc": AFTER if one.significant else "white"}
        spread = one.expanded_uncertainty_dph
        ax.errorbar(
            at[k], total[k], yerr=spread if k and spread else None, fmt="o", capsize=2, linewidth=1.0, **style
        )
    ax.set(ylabel="mean of the map since the first, deg/h")


def _labelled(ax: Axes, at: Sequence[float], history: Sequence[Calibration], dated: bool) -> None:
    """Dates below where there are some and they fit."""
    if dated and len(at) <= _MOST_NAMED:
        ax.set_xticks(at, [picture_text(str(one.date)[:10]) for one in history], rotation=20, ha="right")
        return
    ax.set(xlabel="days since the first calibration" if dated else "number of the calibration")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))


_IN_TIME = ("step", "outliers", "noise")  # reasons that show over time, not over temperature
_FIRST_C, _BIN_C = -90.0, 5.0  # of the curves of entries


def lot_picture(entries: Sequence[FleetEntry], outliers: set[str]) -> str | None:
    """RMS of every gyro before and after, those that are outliers ringed; None for fewer than two."""
    if len(entries) < 2:
        return None
    ordered = sorted(entries, key=lambda e: e.after_rms_dph or 0.0)
    place = np.arange(1, len(ordered) + 1)
    ringed = [k for k, entry in enumerate(ordered) if entry.name in outliers]
    size = 4.0 if len(ordered) < 200 else 2.0
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 3.2), layout="constrained")
        ax = figure.subplots()
        for figures, color, label in (
            ([entry.before_rms_dph for entry in ordered], BEFORE, "before"),
            ([entry.after_rms_dph for entry in ordered], AFTER, "after"),
        ):
            values = np.array(figures, dtype=np.float64)
            ax.plot(place, values, "o", color=color, markersize=size, label=label)
            ax.plot(place[ringed], values[ringed], "o", mfc="none", mec=ACCENT, markersize=9.0)
        ax.set(yscale="log", xlabel="gyros", ylabel="RMS, deg/h")
        figure.legend(loc="outside upper right", ncols=2)
        return svg(figure)


def outlier_picture(known: Mapping[str, FleetEntry], reason: Reason) -> str:
    """What shows why a gyro is an outlier.

    Args:
        known: Entries with facts by name.
        reason: Of one of them.
    """
    entry = known[reason.name]
    series = entry.facts.series if entry.facts else None
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(4.4, 2.1), layout="constrained")
        ax = figure.subplots()
        if reason.id in _IN_TIME and series:
            _draw_series(ax, series, reason)
        else:
            _draw_curves(ax, known, entry)
        ax.legend(fontsize=8)
        return svg(figure)


def _draw_series(ax: Axes, series: ResidualSeries, reason: Reason) -> None:
    time = np.array(series.time_s)
    hours = (time - time[0]) / 3600.0
    ax.plot(hours, series.rate_dph, color=AFTER, linewidth=0.8, label=picture_text(series.file))
    if reason.time_s is not None and reason.file == series.file:
        ax.axvline(reason.time_s / 3600.0, color=BEFORE, linestyle="--", linewidth=1.0, label="step")
    ax.set(xlabel="time, h", ylabel="compensated, deg/h")


def _draw_curves(ax: Axes, known: Mapping[str, FleetEntry], entry: FleetEntry) -> None:
    kin = [_curve(e.facts) for e in known.values() if e.axis == entry.axis and e.facts]
    t = _FIRST_C + _BIN_C * (np.arange(len(kin[0])) + 0.5)
    rows = np.array(kin)
    seen = np.isfinite(rows).any(axis=0)
    low, middle, high = np.nanquantile(rows[:, seen], (0.05, 0.5, 0.95), axis=0)
    ax.fill_between(t[seen], low, high, color=COVERED, alpha=0.25, linewidth=0.0, label="90 % of its kind")
    ax.plot(t[seen], middle, color=COVERED, linewidth=1.0)
    if entry.facts:
        own = _curve(entry.facts)
        ax.plot(t, own, "o-", color=BEFORE, markersize=3.0, linewidth=1.0, label=picture_text(entry.name))
    ax.set(xlabel="temperature, C", ylabel="bias, deg/h")


def _curve(facts: Facts) -> NDArray[np.float64]:
    return np.array([np.nan if v is None else v for v in facts.curve])


_REST_C_PER_MIN = 0.1  # means at up to this rate are drawn as at rest: a cell of the gathered means
_BAND = 2.0  # sigma that a band reaches, about 95 %


def prior_and_posterior(training: Training) -> str | None:
    """Prior, recordings and posterior where temperature stands still, deg/h over C; None where nothing was known."""
    if training.lot is not None:
        curve, name = training.lot.curve, f"the lot alone, {training.lot.units} units"
    elif training.prior is not None:
        curve, name = training.prior.curve, "the earlier model after ageing"
    else:
        return None
    if curve is None:
        return None
    t = np.array(curve.temperature_c)
    bands = (
        (curve.prior_dph, curve.prior_sigma_dph, COVERED, name),
        (curve.posterior_dph, curve.posterior_sigma_dph, AFTER, "with this unit's own runs"),
    )
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 3.2), layout="constrained")
        ax = figure.subplots()
        for mean, sigma, color, label in bands:
            middle, half = np.array(mean), _BAND * np.array(sigma)
            ax.fill_between(t, middle - half, middle + half, color=color, alpha=0.25, linewidth=0.0)
            ax.plot(t, middle, color=color, linewidth=1.2, label=label)
        if (means := training.means) is not None:
            still = np.abs(means.slope_c_per_min) <= _REST_C_PER_MIN
            size = 3.0 + 3.0 * np.sqrt(np.array(means.count)[still])
            at = np.array(means.temperature_c)[still], np.array(means.bias_dph)[still]
            ax.scatter(
                *at, s=size, color=BEFORE, edgecolor=ACCENT, linewidth=0.3, label="its recordings at rest"
            )
        ax.set(xlabel="temperature, C", ylabel="bias at rest, deg/h")
        ax.legend(fontsize=8)
        return svg(figure)
