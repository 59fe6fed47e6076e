"""Pictures of a fleet: RMS of every gyro, their curves over each other, and why one is an outlier."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup

from ..common.arrays import FloatArray
from ..results.fleet import Facts, FleetEntry, Reason, ResidualSeries
from .chart import ACCENT, AFTER, BEFORE, COVERED, HALF, Panel, drawing, side_by_side
from .display import in_unit, rate_unit

_IN_TIME = (
    "outliers",
    "noise",
    "warm_up",
    "run_outlier",
)  # reasons that show over time, not over temperature, beside those that have a time
_FIRST_C, _BIN_C = -90.0, 5.0  # of the curves of entries
_SMALL_FLEET = 200  # gyros: beyond it dots are drawn smaller
_MOST_CURVES = 400  # of an axis: more make one dark area, which the band shows as well


def rms_of_units(entries: Sequence[FleetEntry], outliers: set[str]) -> Markup | None:
    """RMS of every gyro before and after, those that are outliers ringed; None for fewer than two."""
    if len(entries) < 2:
        return None
    ordered = sorted(entries, key=lambda e: e.after_rms_dph or 0.0)
    place = np.arange(1, len(ordered) + 1)
    ringed = [k for k, entry in enumerate(ordered) if entry.name in outliers]
    size = 5.0 if len(ordered) < _SMALL_FLEET else 2.5
    panel = Panel(x="gyros, in the order of what remains", y=f"RMS, {rate_unit()}", y_log=True, whole_x=True)
    for figures, color, label in (
        ([entry.before_rms_dph for entry in ordered], BEFORE, "before"),
        ([entry.after_rms_dph for entry in ordered], AFTER, "after"),
    ):
        values = in_unit(np.array(figures, dtype=np.float64))
        panel.dots(place, values, color, label, size=size)
        if ringed:
            panel.dots(place[ringed], values[ringed], ACCENT, "outlier", size=11.0, hollow=True)
    return drawing([panel], width=HALF, height=240.0)


def curves_of_units(entries: Sequence[FleetEntry], outliers: set[str]) -> Markup | None:
    """Bias over temperature of all units of an axis over each other, outliers coloured; None for fewer than two."""
    panels = []
    for axis in sorted({entry.axis or "" for entry in entries}):
        members = [e for e in entries if (e.axis or "") == axis and e.facts]
        if len(members) < 2:
            continue
        plain = [e for e in members if e.name not in outliers]
        panel = Panel(x="temperature, C", y=f"bias, {rate_unit()}", title=f"axis {axis}" if axis else "", zoom=True)
        for k, entry in enumerate(plain[:: -(-len(plain) // _MOST_CURVES) or 1]):
            label = "the others" if k == 0 else ""
            panel.line(_centers(entry), _curve(entry), COVERED, label, width=0.8, title=entry.name)
        for k, entry in enumerate(e for e in members if e.name in outliers):
            label = "outlier" if k == 0 else ""
            panel.line(_centers(entry), _curve(entry), BEFORE, label, width=2.0, title=entry.name)
            panel.dots(_centers(entry), _curve(entry), BEFORE, size=5.0)
        panels.append(panel)
    return side_by_side(*(drawing([panel], width=HALF, height=240.0) for panel in panels))


def why_outlier(known: Mapping[str, FleetEntry], reason: Reason) -> Markup:
    """What shows why a gyro is an outlier.

    Args:
        known: Entries with facts by name.
        reason: Of one of them.
    """
    entry = known[reason.name]
    series = entry.facts.series if entry.facts else None
    panel = (
        _over_time(series, reason)
        if series and reason.file in (None, series.file) and (reason.time_s is not None or reason.id in _IN_TIME)
        else _over_temperature(known, entry)
    )
    return drawing([panel], width=HALF, height=160.0)


def _over_time(series: ResidualSeries, reason: Reason) -> Panel:
    panel = Panel(x="time, h", y=f"compensated, {rate_unit()}")
    time = np.array(series.time_s)
    panel.line((time - time[0]) / 3600.0, in_unit(series.rate_dph), AFTER, series.file, width=1.0)
    if reason.time_s is not None and reason.file == series.file:
        panel.vertical((reason.time_s - time[0]) / 3600.0, BEFORE, reason.id, dash="5 3", width=1.2)
    return panel


def _over_temperature(known: Mapping[str, FleetEntry], entry: FleetEntry) -> Panel:
    panel = Panel(x="temperature, C", y=f"bias, {rate_unit()}")
    rows = np.array([_curve(e) for e in known.values() if e.axis == entry.axis and e.facts])
    t = _centers(entry)
    seen = np.isfinite(rows).any(axis=0)
    low, middle, high = np.nanquantile(rows[:, seen], (0.05, 0.5, 0.95), axis=0)
    panel.band(t[seen], low, high, COVERED, "90 % of its kind")
    panel.line(t[seen], middle, COVERED)
    panel.line(t, _curve(entry), BEFORE, entry.name, width=1.4)
    panel.dots(t, _curve(entry), BEFORE, size=5.0)
    return panel


def _centers(entry: FleetEntry) -> FloatArray:
    return np.asarray(_FIRST_C + _BIN_C * (np.arange(len(_facts(entry).curve)) + 0.5))


def _curve(entry: FleetEntry) -> FloatArray:
    return in_unit([np.nan if v is None else v for v in _facts(entry).curve])


def _facts(entry: FleetEntry) -> Facts:
    assert entry.facts is not None
    return entry.facts
