"""Pictures of a lot of gyros: what all leave, and what one that stands apart does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..common.texts import picture_text
from ..results.fleet import Facts, FleetEntry, Reason, ResidualSeries
from .plots import ACCENT, AFTER, BEFORE, COVERED, STYLE, svg

__all__ = ["lot_picture", "unit_apart"]

_IN_TIME = ("step", "outliers", "noise")  # reasons that show over time, not over temperature
_FIRST_C, _BIN_C = -90.0, 5.0  # of the curves of entries


def lot_picture(entries: Sequence[FleetEntry], apart: set[str]) -> str | None:
    """RMS of every gyro before and after, those that stand apart ringed; None for fewer than two."""
    if len(entries) < 2:
        return None
    ordered = sorted(entries, key=lambda e: e.after_rms_dph or 0.0)
    place = np.arange(1, len(ordered) + 1)
    ringed = [k for k, entry in enumerate(ordered) if entry.name in apart]
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


def unit_apart(known: Mapping[str, FleetEntry], reason: Reason) -> str:
    """What shows why a gyro stands apart.

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
