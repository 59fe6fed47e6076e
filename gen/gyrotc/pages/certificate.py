"""Draw a certificate: the page for paper, and the digital calibration certificate (PTB's DCC, schema 3.2.0).

Both are drawn from the same rows, so that a figure has the same digits in both and on the report.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ..results.decision import worst_of
from ..results.files import write_own
from ..results.folder import scratch_folder
from ..results.release import Limit
from ..results.templates import html_templates
from .display import bound_words, digits_of, limit_words, measured_words, rounded
from .report import page_environment
from .unit import UnitResults

_CONFORMITY = {"PASS": "pass", "CONDITIONAL PASS": "conditionalPass", "NOT TESTABLE": "noPass", "FAIL": "fail"}
_UNITS = (
    ("_dph", r"\degree\hour\tothe{-1}"),
    ("_arcsec", r"\arcsecond"),
    ("rms_over_floor", r"\one"),
    ("improvement", r"\one"),
)
"""Ends of the names of figures, and their units in D-SI."""


@dataclass(frozen=True, slots=True)
class CertifiedRow:
    """A result: what it is, its text on the page, and for machines value, U, k and unit (empty: it has no U)."""

    text: str
    page: str
    value: str = ""
    spread: str = ""
    factor: str = ""
    unit: str = ""
    bound: str = ""
    verdict: str = ""

    @property
    def conformity(self) -> str:
        """Conformity in the words of the DCC; empty without a limit."""
        return _CONFORMITY.get(self.verdict, "")


def rows_of(unit: UnitResults) -> list[CertifiedRow]:
    """Results of an axis: the bias after compensation, then every limit, those that are not met first."""
    rows, budget = [_row(limit) for limit in unit.held], unit.budget
    if budget is None or budget.expanded_dph <= 0.0:
        return rows
    found = digits_of(0.0, budget.expanded_dph)
    bias = CertifiedRow(
        text="bias after compensation, deg/h",
        page=f"0 ± {rounded(budget.expanded_dph)}",
        value="0",
        spread=found.decimal(found.spread),
        factor=f"{budget.coverage_factor:.2f}",
        unit=_UNITS[0][1],
    )
    return [bias, *rows]


def _row(limit: Limit) -> CertifiedRow:
    text, page, bound = limit_words(limit.limit), measured_words(limit), bound_words(limit)
    plain = CertifiedRow(text, page, bound=bound, verdict=limit.verdict)
    unit = next((unit for end, unit in _UNITS if limit.limit.endswith(end)), "")
    known = limit.expanded_uncertainty
    if not unit or not known or not math.isfinite(known) or not isinstance(limit.measured, float):
        return plain
    found = digits_of(limit.measured, known)
    return replace(
        plain,
        value=found.decimal(found.value),
        spread=found.decimal(found.spread),
        factor=f"{limit.coverage_factor or 2.0:.2f}",
        unit=unit,
    )


def certificate_page(
    units: Sequence[UnitResults],
    pictures: Mapping[str | None, Markup | None],
    facts: Any,
    valid_until: str | None,
    missing: Sequence[str],
    accepted: str | None = None,
) -> str:
    """The page.

    Args:
        pictures: By axis: bias against temperature; None: it has no traces.
        facts: What the laboratory states.
        valid_until: Last day of the calibration; None: no interval was stated.
        missing: What is missing makes it a draft.
        accepted: Why the unit is released although a verdict is not PASS.
    """
    template = page_environment().get_template("certificate.html.j2")
    rows = [rows_of(unit) for unit in units]
    return template.render(
        units=units,
        rows=rows,
        pictures=pictures,
        facts=facts,
        valid_until=valid_until,
        missing=missing,
        accepted=accepted,
    )


def dcc_text(
    units: Sequence[UnitResults], facts: Any, valid_until: str | None = None, accepted: str | None = None
) -> str:
    """The XML of a DCC; arguments as of the page."""
    # Text as a DCC takes it: words with a blank between them, and never none
    environment = html_templates(
        line=lambda value: " ".join(str(value).split()) or "-", day=lambda text: text[:10], rounded=rounded
    )
    text = environment.get_template("dcc.xml.j2").render(
        units=units,
        rows=[rows_of(unit) for unit in units],
        facts=facts,
        valid_until=valid_until,
        accepted=accepted,
        verdict=worst_of(unit.decision for unit in units) or "",
    )
    return re.sub(r"\n\s*\n+", "\n", text)


_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_LONGEST_S = 120.0  # a page takes two seconds; a browser that hangs must not hold the job


def print_to_pdf(page: Path, pdf: Path) -> bool:
    """Print a page of our own; return False if no browser is there or it fails."""
    found = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if found is None:
        return False
    with scratch_folder() as work:
        command = [
            found, "--headless", "--disable-gpu", "--disable-extensions", "--no-first-run",
            *(["--no-sandbox"] if os.geteuid() == 0 else []),  # which it refuses to have as root
            f"--user-data-dir={work / 'browser'}", "--no-pdf-header-footer", f"--print-to-pdf={work / 'page.pdf'}",
            page.resolve().as_uri(),
        ]  # fmt: skip
        try:
            subprocess.run(command, check=True, timeout=_LONGEST_S, capture_output=True)
            write_own(pdf, (work / "page.pdf").read_bytes())
        except (OSError, subprocess.SubprocessError):
            return False
    return True
