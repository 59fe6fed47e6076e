"""The summary of a fleet: `fleet.json`, `fleet.csv` and one HTML page."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from .. import __version__
from ..common.texts import csv_cell
from ..pages.display import NATIVE, displayed, shown
from ..pages.fleet_plots import curves_of_units, rms_of_units, why_outlier
from ..pages.report import page_environment
from ..results.fleet import FleetEntry, FleetSummary, FleetUnit
from ..store.files import json_text, write_atomically
from ..store.folder import result_folder
from .copies import copies, with_copies
from .manifest import SUMMARY
from .outliers import FIGURES, outliers, spread
from .reasons import reasons, with_reasons

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
