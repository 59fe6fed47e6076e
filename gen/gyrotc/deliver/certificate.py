"""A certificate of a result folder: on paper, and as a digital calibration certificate (PTB's DCC, schema 3.3).

Both are made of the same rows, so that a figure has the same digits in both.

What is missing is reported before anything is written. Figures are those of the page, digit by digit.
"""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, time
from pathlib import Path
from typing import Annotated, Any, Literal

from markupsafe import Markup
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from ..common.errors import InputError
from ..common.inputs import checked, read_toml
from ..common.texts import html_environment
from ..jobs.release import accepted, axes_in, unit_of
from ..pages.display import bound_words, digits_of, limit_words, measured_words, rounded
from ..pages.report import page_environment, thermal_picture
from ..pages.unit import UnitResults
from ..results.files import write_atomically, write_own
from ..results.folder import result_folder, scratch_folder
from ..results.marker import sha256
from ..results.release import Limit

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
    plain = CertifiedRow(text, page, bound=bound, verdict=limit.decision)
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
    missing: Sequence[str],
    accepted: str | None = None,
) -> str:
    """The page.

    Args:
        pictures: By axis: bias against temperature; None: it has no traces.
        facts: What the laboratory states.
        missing: What is missing makes it a draft.
        accepted: Why the unit is released although a verdict is FAIL or CONDITIONAL PASS.
    """
    template = page_environment().get_template("certificate.html.j2")
    rows = [rows_of(unit) for unit in units]
    return template.render(units=units, rows=rows, pictures=pictures, facts=facts, missing=missing, accepted=accepted)


def dcc_text(units: Sequence[UnitResults], facts: Any, accepted: str | None = None) -> str:
    """The XML of a DCC; arguments as of the page."""
    # Text as a DCC takes it: words with a blank between them, and never none
    environment = html_environment(
        line=lambda value: " ".join(str(value).split()) or "-", day=lambda text: text[:10], rounded=rounded
    )
    text = environment.get_template("dcc.xml.j2").render(
        units=units, rows=[rows_of(unit) for unit in units], facts=facts, accepted=accepted
    )
    return re.sub(r"\n\s*\n+", "\n", text)


_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_LONGEST_S = 120.0  # a page takes two seconds; a browser that hangs must not hold the job


def print_to_pdf(page: Path, pdf: Path) -> bool:
    """Prints a page of our own; False where no browser is there or it does not do it."""
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


_EXPECTED = "a facts file (docs/delivery.md)"
Line = Annotated[str, Field(min_length=1, max_length=300)]
_NEEDED = {
    "number": "number of the certificate (--number)",
    "laboratory": "name of the laboratory",
    "city": "city of the laboratory",
    "country": "its country, two letters (ISO 3166-1)",
    "operator": "who calibrated",
    "customer": "for whom",
    "customer_city": "city of the customer",
    "customer_country": "country of the customer, two letters",
    "manufacturer": "of the unit",
    "type": "type designation of the unit",
    "procedure": "by which it was calibrated",
    "environment": "conditions of the laboratory",
    "calibrated_on": "date of the calibration, ISO 8601",
}
"""What a certificate has to say (ISO/IEC 17025:2017, 7.8.2 and 7.8.4), and what it is."""


def _day(value: object) -> object:
    """Dates of TOML as JSON writes them, in tables and lists, too."""
    if isinstance(value, Mapping):
        return {key: _day(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_day(one) for one in value]
    return value.isoformat() if isinstance(value, date | time) else value


Day = Annotated[str, BeforeValidator(_day), Field(pattern=r"^\d{4}-\d{2}-\d{2}")]
Country = Annotated[str, Field(pattern="^[A-Z]{2}$")]


class LaboratoryFacts(BaseModel):
    """What a laboratory states, in its facts file or in `[meta]` of the data set; None: not stated."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    number: Line | None = None
    laboratory: Line | None = None
    city: Line | None = None
    country: Country | None = None
    operator: Line | None = None
    approved_by: Line | None = None
    customer: Line | None = None
    customer_city: Line | None = None
    customer_country: Country | None = None
    manufacturer: Line | None = None
    type: Line | None = None
    procedure: Line | None = None
    environment: Line | None = None
    calibrated_on: Day | None = None
    issued: Day | None = None
    place: Literal["laboratory", "customer", "other"] = "laboratory"
    accreditation: Line | None = None


_NEVER_REWRITTEN = ("model.json", "training.json", "limits.json")  # by any command but build


@dataclass(frozen=True, slots=True)
class Certified:
    """What was written: the files, and whether a PDF could be made."""

    files: tuple[Path, ...]
    pdf: bool


def facts_of(meta: Mapping[str, Any], path: Path | None, number: str | None) -> LaboratoryFacts:
    """What is known: the facts file before `[meta]`, the number of the command line before both.

    Raises:
        InputError: The file cannot be read, or a field is wrong or not known.
    """
    known = {key: value for key, value in meta.items() if key in LaboratoryFacts.model_fields and value != ""}
    where = "dataset.toml, [meta]"
    if path is not None:
        stated = read_toml(path, _EXPECTED)
        if stated.pop("schema", None) != 1:
            raise InputError(f"{path}, field schema", "is not 1", "schema = 1")
        known |= {key: _day(value) for key, value in stated.items()}
        where = str(path)
    if number is not None:
        known["number"] = number
    return checked(LaboratoryFacts, known, where)


def certificate(
    folder: Path,
    out: Path,
    *,
    facts: Path | None = None,
    number: str | None = None,
    draft: bool = False,
    accept_fail: str | None = None,
) -> Certified:
    """Writes `certificate.html`, `dcc.xml` and, where Chromium is there, `certificate.pdf` into `out`.

    Args:
        folder: What `build` wrote, also with `--axis all`.
        facts: A facts file of the laboratory.
        number: Number of the certificate.
        draft: Take what is missing as not stated: the page is marked as a draft, and there is no DCC.
        accept_fail: Why a unit gets one whose verdict is FAIL or CONDITIONAL PASS; both say it.

    Raises:
        InputError: Something that a certificate must say is missing (all of it is named), a file is not as it was
            built, the verdict is FAIL or CONDITIONAL PASS and not accepted, or `out` cannot be replaced.
    """
    places = [folder / axis for axis in axes_in(folder)] or [folder]
    units = [unit_of(place) for place in places]
    why = accepted(folder, units, accept_fail)
    first = units[0]
    stated = facts_of(first.model.meta, facts, number)
    missing = list(_missing(stated, units))
    if missing and not draft:
        raise InputError(
            str(folder), f"{len(missing)} things are missing for a certificate: " + "; ".join(missing),
            "them in a facts file (--facts, docs/delivery.md) or in [meta], or --draft",
        )  # fmt: skip
    for place, unit in zip(places, units, strict=True):
        _as_built(place, unit)
    with result_folder(out, "certificate", inputs=[folder]) as stage:
        stage.of(first.model.serial)
        issued = stated.model_copy(update={"issued": stated.issued or date.today().isoformat()})
        pictures: dict[str | None, Markup | None] = {
            u.model.axis: thermal_picture(place, u) for place, u in zip(places, units, strict=True)
        }
        page = certificate_page(units, pictures, issued, missing, why)
        write_atomically(stage.folder / "certificate.html", page)
        if not missing:
            write_atomically(stage.folder / "dcc.xml", dcc_text(units, issued, why))
        printed = print_to_pdf(stage.folder / "certificate.html", stage.folder / "certificate.pdf")
    written = {"certificate.html": True, "dcc.xml": not missing, "certificate.pdf": printed}
    return Certified(tuple(out / name for name, there in written.items() if there), printed)


def _missing(facts: LaboratoryFacts, units: list[UnitResults]) -> Iterator[str]:
    for name, what in _NEEDED.items():
        if getattr(facts, name) is None:
            yield f"{name} ({what})"
    for unit in units:
        of = f" of axis {unit.model.axis}" if unit.model.axis else ""
        if unit.budget is None:
            yield f"uncertainty budget{of} (build the unit again)"
        if unit.manifest is None:
            yield f"manifest.json{of} (build the unit again)"
    budget = units[0].budget
    instruments = budget.instruments if budget else ()
    if budget and not any(one.quantity == "temperature" and one.certificate for one in instruments):
        yield (
            "a thermometer with its certificate (only dataset.toml states instruments: [[meta.instrument]],"
            ' quantity = "temperature"; then build again)'
        )


def _as_built(folder: Path, unit: UnitResults) -> None:
    """Model and emitted files are those of the manifest, and all results are of one model.

    Raises:
        InputError: One is not.
    """
    manifest = unit.manifest
    if manifest is None:
        return
    if manifest.model_hash != unit.model.hash:
        raise InputError(str(folder / "manifest.json"), "is of another model", "a folder as gyrotc build left it")
    for name, known in manifest.files.items():
        path = folder / name
        if name.endswith("main.c") or not (name in _NEVER_REWRITTEN or name.startswith("c/")):
            continue
        if not path.is_file() or sha256(path) != known:
            raise InputError(str(path), "is not as it was built", "a folder as gyrotc build left it")
