"""The summary of a fleet: `fleet.json`, `fleet.csv` and one HTML page with its pictures."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np
from markupsafe import Markup

from .. import __version__
from ..common.arrays import FloatArray
from ..common.texts import csv_cell
from ..pages.chart import ACCENT, AFTER, BEFORE, COVERED, HALF, Panel, drawing, side_by_side
from ..pages.display import NATIVE, displayed, in_unit, rate_unit, shown
from ..pages.report import page_environment
from ..results.fleet import Facts, FleetEntry, FleetSummary, FleetUnit, Reason, ResidualSeries
from ..store.files import json_text, write_atomically
from ..store.folder import result_folder
from .manifest import SUMMARY
from .outliers import FIGURES, copies, outliers, spread, with_copies
from .reasons import reasons, with_reasons

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


_COLUMNS = (
    "name", "serial", "axis", "status", "verdict", "limits_met", "limits_held", "date", "outlier_reason", "judged_on",
    "before_rms_dph", "after_rms_dph", "expanded_uncertainty_dph", "rms_over_floor", "noise_floor_dph", "bias_dph",
    "centers", "table_bytes", "error_bound_dph", "findings", "model_hash", "reason",
)  # fmt: skip

_PICTURES = 60  # of outliers; of more, the words say enough


def summary_of(entries: Sequence[FleetEntry]) -> FleetSummary:
    """What `fleet.json` says."""
    counts = Counter(entry.status for entry in entries)
    copied = copies(entries)
    entries = with_copies(entries, copied)
    figured = [entry for entry in entries if entry.model_hash is not None]
    named = reasons(figured, copied)
    entries = with_reasons(entries, named)
    return FleetSummary(
        gyrotc_version=__version__,
        serial=None,
        axis=None,
        units=len(entries),
        done=counts["done"],
        failed=counts["failed"],
        unfinished=counts["unfinished"],
        figures={f: spread(figured, f) for f in (*FIGURES, "sum_abs_weights_dph", "centers", "table_bytes")},
        outliers=tuple(outliers(figured)),
        reasons=tuple(named),
        copies=tuple(copied),
        serials=tuple(entry.unit() for entry in entries),
    )


def write_summary(out: Path, entries: Sequence[FleetEntry], display: str = NATIVE) -> FleetSummary:
    """Writes `fleet.json`, `fleet.csv` and `fleet.html`; returns what the first says.

    Args:
        display: Unit of rates on the page.

    Raises:
        InputError: There are files of these names that gyrotc did not write.
    """
    summary = summary_of(entries)
    outliers = {reason.name for reason in summary.reasons} | {outlier.name for outlier in summary.outliers}
    known = {entry.name: entry for entry in entries if entry.facts}
    with displayed(display):
        visible = shown(summary)
        pictures = {
            reason.name: why_outlier(known, reason)
            for reason in summary.reasons[:_PICTURES]
            if reason.name in known and reason.id != "copy_of_other"  # nothing to be seen in it
        }
        page = (
            page_environment()
            .get_template("fleet.html.j2")
            .render(
                summary=visible,
                outliers=outliers,
                picture=rms_of_units([e for e in entries if e.after_rms_dph], outliers),
                curves=curves_of_units(entries, outliers),
                pictures=pictures,
                links={entry.name: _link(out, entry.name) for entry in summary.serials},
                verdicts=Counter(entry.verdict for entry in visible.serials),
                barred=sum(bool(entry.barred) for entry in visible.serials),
            )
        )
    texts = (json_text(summary.content()), _table(summary.serials), page)
    with result_folder(out, "fleet", entries=SUMMARY) as stage:
        for name, text in zip(SUMMARY, texts, strict=True):
            write_atomically(stage.folder / name, text)
    return summary


def _link(out: Path, name: str) -> str | None:
    """Where a row leads: the unit's page, else its folder; None where there is nothing."""
    try:
        if (out / name / "report.html").is_file():
            return f"{quote(name)}/report.html"
        return f"{quote(name)}/" if (out / name / "model.json").is_file() else None
    except (OSError, ValueError):  # a name as it is shown may be longer than one that a file may have
        return None


def _table(entries: Sequence[FleetUnit]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for entry in entries:
        cells = (getattr(entry, column) for column in _COLUMNS)
        writer.writerow(csv_cell(" ".join(c) if isinstance(c, tuple) else "" if c is None else c) for c in cells)
    return text.getvalue()
