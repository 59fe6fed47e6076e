"""A certificate as a page that prints on A4, and as a digital calibration certificate (PTB's DCC, schema 3.2.0).

Both are made of the same rows, so that a figure has the same digits in both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..common.texts import html_environment
from ..pages.report import page_environment
from ..pages.unit import UnitResults
from ..pages.words import bound_words, digits_of, limit_words, measured_words, rounded
from ..results.limits import Limit

__all__ = ["CertifiedRow", "certificate_page", "dcc_text", "rows_of"]

_CONFORMITY = {"PASS": "pass", "CONDITIONAL PASS": "conditionalPass", "FAIL": "fail"}
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
        """As the DCC says it; empty without a limit."""
        return _CONFORMITY.get(self.verdict, "")


def rows_of(unit: UnitResults) -> list[CertifiedRow]:
    """Results of an axis: the bias after compensation, then every limit, those that are not met first."""
    return [*_bias(unit), *map(_row, unit.held)]


def _bias(unit: UnitResults) -> Iterator[CertifiedRow]:
    budget = unit.budget
    if budget is not None and budget.expanded_dph > 0.0:
        found = digits_of(0.0, budget.expanded_dph)
        yield CertifiedRow(
            text="bias after compensation, deg/h",
            page=f"0 ± {rounded(budget.expanded_dph)}",
            value="0",
            spread=found.decimal(found.spread),
            factor=f"{budget.coverage_factor:.2f}",
            unit=_UNITS[0][1],
        )


def _row(limit: Limit) -> CertifiedRow:
    verdict = limit.verdict or ("PASS" if limit.met else "FAIL")
    plain = CertifiedRow(
        text=limit_words(limit.limit), page=measured_words(limit), bound=bound_words(limit), verdict=verdict
    )
    unit = next((unit for end, unit in _UNITS if limit.limit.endswith(end)), "")
    known = limit.expanded_uncertainty
    if not unit or not known or not math.isfinite(known) or not isinstance(limit.measured, float):
        return plain
    found = digits_of(limit.measured, known)
    return CertifiedRow(
        text=plain.text,
        page=plain.page,
        value=found.decimal(found.value),
        spread=found.decimal(found.spread),
        factor=f"{limit.coverage_factor or 2.0:.2f}",
        unit=unit,
        bound=plain.bound,
        verdict=verdict,
    )


def certificate_page(
    units: Sequence[UnitResults], facts: Any, missing: Sequence[str], accepted: str | None = None
) -> str:
    """The page.

    Args:
        facts: What the laboratory states.
        missing: What is missing makes it a draft.
        accepted: Why the unit is released although a verdict is FAIL.
    """
    template = page_environment().get_template("certificate.html.j2")
    rows = [rows_of(unit) for unit in units]
    return template.render(units=units, rows=rows, facts=facts, missing=missing, accepted=accepted)


def dcc_text(units: Sequence[UnitResults], facts: Any, accepted: str | None = None) -> str:
    """The XML of a DCC; arguments as of the page."""
    environment = html_environment(line=_line, day=lambda text: text[:10], rounded=rounded)
    text = environment.get_template("dcc.xml.j2").render(
        units=units, rows=[rows_of(unit) for unit in units], facts=facts, accepted=accepted
    )
    return re.sub(r"\n\s*\n+", "\n", text)


def _line(value: object) -> str:
    """Text as a DCC takes it: words with a blank between them, and never none."""
    return " ".join(str(value).split()) or "-"
