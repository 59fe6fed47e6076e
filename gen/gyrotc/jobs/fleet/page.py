"""The summary of a fleet: `fleet.json`, `fleet.csv` and one HTML page."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from ... import __version__
from ...outputs import json_text, result_folder, write_atomically
from ...pages.plots import ACCENT, AFTER, BEFORE, STYLE, svg
from ...pages.report import page_environment
from ...texts import csv_cell
from .copies import copies, with_copies
from .entry import INTERNAL
from .manifest import SUMMARY
from .outliers import FIGURES, outliers, spread
from .turned import with_turned

__all__ = ["summary_of", "write_summary"]

_COLUMNS = (
    "name", "serial", "axis", "status", "judged_on", "before_rms_dph", "after_rms_dph", "rms_over_floor",
    "noise_floor_dph", "bias_dph", "centers", "table_bytes", "error_bound_dph", "findings", "model_hash", "reason",
)  # fmt: skip


def summary_of(entries: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The JSON object of `fleet.json`."""
    counts = Counter(entry["status"] for entry in entries)
    copied = copies(entries)
    entries = with_turned(with_copies(entries, copied))
    figured = [entry for entry in entries if "model_hash" in entry]
    return {
        "schema": "gyrotc.fleet/1",
        "gyrotc_version": __version__,
        "serial": None,
        "axis": None,
        "units": len(entries),
        "done": counts["done"],
        "failed": counts["failed"],
        "unfinished": counts["unfinished"],
        "figures": {f: spread(figured, f) for f in (*FIGURES, "centers", "table_bytes")},
        "outliers": [asdict(outlier) for outlier in outliers(figured)],
        "copies": [asdict(copy) for copy in copied],
        "serials": [{k: v for k, v in entry.items() if k not in INTERNAL} for entry in entries],
    }


def write_summary(out: Path, entries: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Writes `fleet.json`, `fleet.csv` and `fleet.html`; returns the object of the first.

    Raises:
        InputError: There are files of these names that gyrotc did not write.
    """
    summary = summary_of(entries)
    names = {outlier["name"] for outlier in summary["outliers"]}
    picture = _picture([e for e in entries if e.get("after_rms_dph")], names)
    template = page_environment().get_template("fleet.html.j2")
    page = template.render(summary=summary, apart=names, picture=picture)
    texts = (json_text(summary), _table(summary["serials"]), page)
    with result_folder(out, "fleet", entries=SUMMARY) as stage:
        for name, text in zip(SUMMARY, texts, strict=True):
            write_atomically(stage.folder / name, text)
    return summary


def _picture(entries: Sequence[dict[str, Any]], apart: set[str]) -> str | None:
    """RMS of every gyro before and after, those that stand apart ringed; None for fewer than two."""
    if len(entries) < 2:
        return None
    ordered = sorted(entries, key=lambda e: float(e["after_rms_dph"]))
    place = np.arange(1, len(ordered) + 1)
    ringed = [k for k, entry in enumerate(ordered) if entry["name"] in apart]
    size = 4.0 if len(ordered) < 200 else 2.0
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 3.2), layout="constrained")
        ax = figure.subplots()
        for key, color, label in (
            ("before_rms_dph", BEFORE, "before"),
            ("after_rms_dph", AFTER, "after"),
        ):
            values = np.array([entry[key] for entry in ordered])
            ax.plot(place, values, "o", color=color, markersize=size, label=label)
            ax.plot(place[ringed], values[ringed], "o", mfc="none", mec=ACCENT, markersize=9.0)
        ax.set(yscale="log", xlabel="gyros", ylabel="RMS, deg/h")
        figure.legend(loc="outside upper right", ncols=2)
        return svg(figure)


def _table(entries: Sequence[dict[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for entry in entries:
        cells = (entry.get(column) for column in _COLUMNS)
        writer.writerow(
            csv_cell(" ".join(c) if isinstance(c, list) else "" if c is None else c) for c in cells
        )
    return text.getvalue()
