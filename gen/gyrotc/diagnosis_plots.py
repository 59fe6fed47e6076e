"""Pictures of a diagnosis: what the simulation does not do, what the named cause does, who else was considered.

Draws; computes nothing but running means. Every function returns one `<svg>` element.
"""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .diagnose.attribute import Attribution
from .diagnose.compare import Ensemble
from .diagnose.records import Records, centred_slope
from .diagnose.refine import Refined
from .diagnose.words import WORDS
from .metrics import Averages
from .plots import ACCENT, AFTER, BEFORE, COVERED, STYLE, svg

__all__ = ["before_and_after", "considered", "likelihood", "over_inputs", "residual_over_time", "statistics"]

Array = NDArray[np.float64]

_SMOOTH_S = 1800.0
_LEVEL = 0.01
_MOVING = 0.1  # C/min


def residual_over_time(records: Records, ensemble: Ensemble, causes: Sequence[Refined]) -> str:
    """Half-hour means of every run's residual over the band of the simulated ones, and the fitted causes."""
    width = max(round(_SMOOTH_S / records.block_s), 1)
    term = sum((c.contribution for c in causes), np.zeros(records.size))
    with mpl.rc_context(STYLE):
        figure, axes = _grid(len(records.runs))
        for ax, run, span, kept in zip(axes, records.runs, records.spans(), records.kept, strict=False):
            hours = (kept + 0.5) * records.block_s / 3600.0
            band = _smooth(ensemble.simulated[span], width)
            low, high = np.quantile(band, [0.025, 0.975], axis=1)
            ax.fill_between(hours, low, high, color=COVERED, alpha=0.3, linewidth=0, label="simulated, 95 %")
            ax.plot(
                hours, _smooth(ensemble.residual[span], width), color=BEFORE, linewidth=1.2, label="measured"
            )
            if causes:
                ax.plot(
                    hours, _smooth(term[span] - 0.0, width), color=AFTER, linewidth=1.2, label="named causes"
                )
            ax.set_title(f"{run.name}  {run.environment}", fontsize=8, loc="left")
        axes[0].legend(fontsize=7)
        figure.supxlabel("h since the first row", fontsize=9)
        figure.supylabel("residual of the static map, deg/h", fontsize=9)
        return svg(figure)


def _grid(count: int) -> tuple[Figure, list[Axes]]:
    columns = min(3, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(10.0, 0.6 + 1.9 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for ax in axes.flat[count:]:
        ax.set_visible(False)
    return figure, list(axes.flat[:count])


def _smooth(values: Array, width: int) -> Array:
    """Running mean over `width` blocks, shorter at the ends."""
    total = np.cumsum(np.concatenate([np.zeros((1, *values.shape[1:])), values]), axis=0)
    n = len(values)
    low = np.maximum(np.arange(n) - width // 2, 0)
    high = np.minimum(low + width, n)
    count = (high - low).reshape(-1, *([1] * (values.ndim - 1)))
    return np.asarray((total[high] - total[low]) / count)


def statistics(ensemble: Ensemble) -> str:
    """Every statistic of the residuals: measured, against the middle 95 % of the simulated ones."""
    found = ensemble.discrepancies
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 0.6 + 0.32 * len(found)), layout="constrained")
        ax = figure.subplots()
        for k, d in enumerate(reversed(found)):
            half = max(0.5 * (d.simulated_high - d.simulated_low), 1e-300)
            middle = 0.5 * (d.simulated_high + d.simulated_low)
            place = (d.measured - middle) / half
            ax.plot([-1, 1], [k, k], color=COVERED, linewidth=7, alpha=0.35, solid_capstyle="butt")
            ax.plot(_signed_root(place), k, "o", color=BEFORE if d.p_value < _LEVEL else AFTER, markersize=5)
        ax.set_yticks(range(len(found)), [d.statistic.replace("_", " ") for d in reversed(found)])
        ax.set_xlabel("measured, in half widths of the simulated 95 % range (root scale beyond)")
        ax.grid(axis="y", visible=False)
        return svg(figure)


def _signed_root(x: float) -> float:
    """The value itself up to 1, its square root beyond."""
    return float(np.sign(x) * min(abs(x), np.sqrt(abs(x))))


def over_inputs(records: Records, ensemble: Ensemble) -> str:
    """Residual over T (heating, cooling), dT/dt, time since power-on and date."""
    residual = ensemble.residual
    t = records.average([r.history.temperature_c for r in records.runs])
    slope = records.average([centred_slope(r.history) for r in records.runs])
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 5.4), layout="constrained")
        axes = figure.subplots(2, 2, sharey=True)
        for mask, colour, label in (
            (slope > _MOVING, BEFORE, "heating"),
            (slope < -_MOVING, AFTER, "cooling"),
            (np.abs(slope) <= _MOVING, COVERED, "held"),
        ):
            if mask.sum() > 20:
                _binned(axes[0, 0], t[mask], residual[mask], colour, label)
        axes[0, 0].set_xlabel("temperature, C")
        axes[0, 0].legend(fontsize=8)
        _binned(axes[0, 1], slope, residual, ACCENT, "")
        axes[0, 1].set_xlabel("dT/dt, C/min")
        _over_power_on(axes[1, 0], records, residual)
        _over_date(axes[1, 1], records, residual)
        figure.supylabel("residual of the static map, deg/h", fontsize=9)
        return svg(figure)


def _binned(ax: Axes, x: Array, y: Array, colour: str, label: str) -> None:
    """Means in 24 cells with their standard errors."""
    edges = np.linspace(x.min(), x.max() + 1e-9, 25)
    cell = np.digitize(x, edges) - 1
    count = np.bincount(cell, minlength=24)
    use = np.flatnonzero(count >= 4)
    if use.size == 0:
        return
    mean = np.bincount(cell, weights=y, minlength=24)[use] / count[use]
    place = np.bincount(cell, weights=x, minlength=24)[use] / count[use]
    error = np.array([y[cell == c].std() for c in use]) / np.sqrt(count[use])
    ax.axhline(0.0, color=ACCENT, linewidth=0.6)
    ax.errorbar(place, mean, yerr=error, color=colour, fmt="o-", markersize=3, linewidth=1.0, label=label)


def _over_power_on(ax: Axes, records: Records, residual: Array) -> None:
    ax.set_xlabel("h since power-on")
    for run, number, span in zip(records.runs, range(len(records.runs)), records.spans(), strict=True):
        if run.history.on_s is None:
            continue
        hours = records.average_run(number, np.asarray(run.history.on_s)) / 3600.0
        width = max(round(_SMOOTH_S / records.block_s), 1)
        ax.plot(hours, _smooth(residual[span], width), linewidth=0.8)
    ax.axhline(0.0, color=ACCENT, linewidth=0.6)


def _over_date(ax: Axes, records: Records, residual: Array) -> None:
    ax.set_xlabel("day (number of the run where undated)")
    for number, (run, span) in enumerate(zip(records.runs, records.spans(), strict=True)):
        day = run.history.day if run.history.day is not None else float(number)
        part = residual[span]
        ax.errorbar(
            day, part.mean(), yerr=part.std() / np.sqrt(max(part.size, 1)), fmt="o", color=AFTER, markersize=4
        )
    ax.axhline(0.0, color=ACCENT, linewidth=0.6)


def before_and_after(before: Sequence[Averages], after: Sequence[Averages], average_s: float) -> str:
    """Half-hour means on the scored runs: model without the causes, and with them."""
    width = max(round(_SMOOTH_S / average_s), 1)
    with mpl.rc_context(STYLE):
        figure, axes = _grid(len(before))
        for ax, b, a in zip(axes, before, after, strict=False):
            hours = (b.time_s - b.time_s[0]) / 3600.0
            ax.axhline(0.0, color=ACCENT, linewidth=0.6)
            ax.plot(hours, _smooth(b.after_dph, width), color=BEFORE, linewidth=1.1, label="without")
            ax.plot(hours, _smooth(a.after_dph, width), color=AFTER, linewidth=1.1, label="with the causes")
        axes[0].legend(fontsize=7)
        figure.supxlabel("h", fontsize=9)
        figure.supylabel("compensated rate on unseen runs, deg/h", fontsize=9)
        return svg(figure)


def likelihood(cause: Refined) -> str | None:
    """Profile likelihood of the parameter of a cause, with its 95 % interval."""
    if cause.profile is None:
        return None
    x, gain = cause.profile
    name = next(n for n in cause.parameters if n in cause.candidate.values)
    interval = cause.parameters[name]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.0, 2.6), layout="constrained")
        ax = figure.subplots()
        ax.axvspan(interval.low, interval.high, color=AFTER, alpha=0.12, linewidth=0)
        ax.plot(x, gain - gain.max(), "o-", color=AFTER, markersize=3, linewidth=1.0)
        ax.axhline(-3.84, color=ACCENT, linewidth=0.6, linestyle="--")
        ax.set_ylim(bottom=max(-40.0, float((gain - gain.max()).min()) * 1.05))
        ax.set_xlabel(name)
        ax.set_ylabel("2 Δ log likelihood")
        ax.set_title(WORDS[cause.candidate.id].name, fontsize=8, loc="left")
        return svg(figure)


def considered(attribution: Attribution) -> str:
    """Best score of every cause before any was taken, and what is left after the named ones."""
    first, last = _best_scores(attribution.first), _best_scores(attribution.last)
    ids = [i for i in WORDS if i in first]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 0.7 + 0.32 * len(ids)), layout="constrained")
        ax = figure.subplots()
        places = np.arange(len(ids))[::-1]
        ax.barh(places, [first[i] for i in ids], height=0.62, color=BEFORE, alpha=0.85, label="alone")
        if attribution.causes:
            ax.barh(
                places, [last.get(i, 0.0) for i in ids], height=0.28, color=AFTER, label="beside the named"
            )
            ax.legend(fontsize=8, loc="lower right")
        significant = [f.log_p for f in attribution.first if f.p_value <= _LEVEL]
        missed = [f.log_p for f in attribution.first if f.p_value > _LEVEL]
        if significant and missed:
            ax.axvline(0.5 * (min(significant) + max(missed)), color=ACCENT, linewidth=0.8, linestyle="--")
        ax.set_yticks(places, [i.replace("_", " ") for i in ids])
        ax.set_xlabel("−ln p of the best candidate (dashed: 1 % for the whole search)")
        ax.set_xscale("symlog", linthresh=20.0)
        ax.grid(axis="y", visible=False)
        return svg(figure)


def _best_scores(found: Sequence[object]) -> dict[str, float]:
    out: dict[str, float] = {}
    for f in found:
        id, value = f.candidate.id, f.log_p  # type: ignore[attr-defined]
        if np.isfinite(value):
            out[id] = max(out.get(id, 0.0), value)
    return out
