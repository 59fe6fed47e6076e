"""The summary of a fleet: `fleet.json`, `fleet.csv` and one HTML page."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from ... import __version__
from ...outputs import json_text, result_folder, write_atomically
from ...pages.plots import ACCENT, AFTER, BEFORE, STYLE, svg
from ...pages.report import page_environment
from ...results.fleet import FleetEntry, FleetSummary, FleetUnit
from ...texts import csv_cell
from .copies import copies, with_copies
from .manifest import SUMMARY
from .outliers import FIGURES, outliers, spread
from .turned import with_turned

__all__ = ["summary_of", "write_summary"]

_COLUMNS = (
    "name", "serial", "axis", "status", "judged_on", "before_rms_dph", "after_rms_dph", "rms_over_floor",
    "noise_floor_dph", "bias_dph", "centers", "table_bytes", "error_bound_dph", "findings", "model_hash", "reason",
)  # fmt: skip


def summary_of(entries: Sequence[FleetEntry]) -> FleetSummary:
    """What `fleet.json` holds."""
    counts = Counter(entry.status for entry in entries)
    copied = copies(entries)
    units = tuple(entry.told() for entry in with_turned(with_copies(entries, copied)))
    figured = [unit for unit in units if unit.model_hash is not None]
    return FleetSummary(
        gyrotc_version=__version__,
        serial=None,
        axis=None,
        units=len(units),
        done=counts["done"],
        failed=counts["failed"],
        unfinished=counts["unfinished"],
        figures={f: spread(figured, f) for f in (*FIGURES, "centers", "table_bytes")},
        outliers=tuple(outliers(figured)),
        copies=tuple(copied),
        serials=units,
    )


def write_summary(out: Path, entries: Sequence[FleetEntry]) -> FleetSummary:
    """Writes `fleet.json`, `fleet.csv` and `fleet.html`; returns the object of the first.

    Raises:
        InputError: There are files of these names that gyrotc did not write.
    """
    summary = summary_of(entries)
    names = {outlier.name for outlier in summary.outliers}
    picture = _picture(summary.serials, names)
    template = page_environment().get_template("fleet.html.j2")
    page = template.render(summary=summary, apart=names, picture=picture)
    texts = (json_text(summary.content()), _table(summary.serials), page)
    with result_folder(out, "fleet", entries=SUMMARY) as stage:
        for name, text in zip(SUMMARY, texts, strict=True):
            write_atomically(stage.folder / name, text)
    return summary


def _picture(units: Sequence[FleetUnit], apart: set[str]) -> str | None:
    """RMS of every gyro before and after, those that stand apart ringed; None for fewer than two."""
    ordered = sorted(
        (unit.after_rms_dph, unit.before_rms_dph, unit.name) for unit in units if unit.after_rms_dph
    )
    if len(ordered) < 2:
        return None
    place = np.arange(1, len(ordered) + 1)
    ringed = [k for k, (*_, name) in enumerate(ordered) if name in apart]
    size = 4.0 if len(ordered) < 200 else 2.0
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 3.2), layout="constrained")
        ax = figure.subplots()
        for column, color, label in ((1, BEFORE, "before"), (0, AFTER, "after")):
            values = np.array([gyro[column] for gyro in ordered], dtype=np.float64)
            ax.plot(place, values, "o", color=color, markersize=size, label=label)
            ax.plot(place[ringed], values[ringed], "o", mfc="none", mec=ACCENT, markersize=9.0)
        ax.set(yscale="log", xlabel="gyros", ylabel="RMS, deg/h")
        figure.legend(loc="outside upper right", ncols=2)
        return svg(figure)


def _table(units: Sequence[FleetUnit]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for unit in units:
        cells = (getattr(unit, column) for column in _COLUMNS)
        writer.writerow(
            csv_cell(" ".join(c) if isinstance(c, tuple) else "" if c is None else c) for c in cells
        )
    return text.getvalue()
