"""A certificate of a result folder: facts of the laboratory beside what was measured, on paper and as a DCC.

What is missing is told before anything is written. Figures are those of the page, digit by digit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from ..common.errors import InputError
from ..common.inputs_texts import checked, read_toml
from ..jobs.axes import axes_in
from ..jobs.release import accepted, unit_of
from ..pages.unit import UnitResults
from ..results.budget import Budget
from ..results.manifest import Manifest
from ..store.files import write_atomically
from ..store.folder import result_folder
from ..store.marker import sha256
from .pages_certificate import certificate_page, dcc_text
from .printing import print_to_pdf

__all__ = ["Certified", "LaboratoryFacts", "certificate", "facts_of"]

_EXPECTED = "a facts file (docs/certificate.md)"
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
    return value.isoformat() if isinstance(value, date) else value


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
        accept_fail: Why a unit gets one whose verdict is FAIL; both say it.

    Raises:
        InputError: Something that a certificate must say is missing (all of it is named), a file is not as it was
            built, the verdict is FAIL and not accepted, or `out` cannot be replaced.
    """
    units = [unit_of(folder / axis) for axis in axes_in(folder)] or [unit_of(folder)]
    why = accepted(folder, units, accept_fail)
    places = [folder / axis for axis in axes_in(folder)] or [folder]
    first = units[0]
    stated = facts_of(first.model.meta, facts, number)
    missing = list(_missing(stated, units))
    if missing and not draft:
        raise InputError(
            str(folder), f"{len(missing)} things are missing for a certificate: " + "; ".join(missing),
            "them in a facts file (--facts, docs/certificate.md) or in [meta], or --draft",
        )  # fmt: skip
    for place, unit in zip(places, units, strict=True):
        _as_built(place, unit)
    with result_folder(out, "certificate", inputs=[folder]) as stage:
        stage.of(first.model.serial)
        told = stated.model_copy(update={"issued": stated.issued or date.today().isoformat()})
        page = certificate_page(units, told, missing, why)
        write_atomically(stage.folder / "certificate.html", page)
        if not missing:
            write_atomically(stage.folder / "dcc.xml", dcc_text(units, told, why))
        printed = print_to_pdf(stage.folder / "certificate.html", stage.folder / "certificate.pdf")
    names = (
        "certificate.html",
        *(("dcc.xml",) if not missing else ()),
        *(("certificate.pdf",) if printed else ()),
    )
    return Certified(tuple(out / name for name in names), printed)


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
    if budget is not None and not _traceable(budget):
        yield 'instrument (a thermometer with its certificate: [[meta.instrument]], quantity = "temperature")'


def _traceable(budget: Budget) -> bool:
    return any(one.quantity == "temperature" and one.certificate for one in budget.instruments)


def _as_built(folder: Path, unit: UnitResults) -> None:
    """Model and emitted files are those of the manifest, and all results are of one model.

    Raises:
        InputError: One is not.
    """
    manifest = unit.manifest
    if manifest is None:
        return
    if manifest.model_hash != unit.model.hash:
        raise InputError(
            str(folder / "manifest.json"), "is of another model", "a folder as gyrotc build left it"
        )
    for name, known in _proven(manifest).items():
        path = folder / name
        if not path.is_file() or sha256(path) != known:
            raise InputError(str(path), "is not as it was built", "a folder as gyrotc build left it")


def _proven(manifest: Manifest) -> dict[str, str]:
    kept = (name for name in manifest.files if name in _NEVER_REWRITTEN or name.startswith("c/"))
    return {name: manifest.files[name] for name in kept if not name.endswith("main.c")}
