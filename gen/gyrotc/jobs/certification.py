"""Certify a result folder: check what it states, complete it with the facts of the laboratory, write the certificate.

What is missing is reported before anything is written.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal

from markupsafe import Markup
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from ..assess.limits import last_day
from ..assess.stated import check_stated
from ..common.errors import InputError, quoted
from ..common.inputs import checked, read_toml
from ..pages.certificate import certificate_page, dcc_text, print_to_pdf
from ..pages.report import thermal_picture
from ..pages.unit import UnitResults, unit_in
from ..recordings.description import in_order, json_value, stated_day
from ..results.decision import worst_of
from ..results.files import sha256, write_atomically
from ..results.folder import result_folder
from ..results.marker import EXAMPLE, check_intact
from ..results.release import NEED_REASON, STATED
from .axes import axes_in, refuse_parts_of_two

_LONGEST = 300  # characters of a reason: a line or two of a certificate
_EXPECTED = "a facts file (docs/delivery.md)"
StatedLine = Annotated[str, Field(min_length=1, max_length=300)]
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


Day = Annotated[str, BeforeValidator(stated_day)]
Country = Annotated[str, Field(pattern="^[A-Z]{2}$")]


class LaboratoryFacts(BaseModel):
    """Facts of a laboratory from its facts file or from `[meta]` of the data set; None: not stated."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    number: StatedLine | None = None
    laboratory: StatedLine | None = None
    city: StatedLine | None = None
    country: Country | None = None
    operator: StatedLine | None = None
    approved_by: StatedLine | None = None
    customer: StatedLine | None = None
    customer_city: StatedLine | None = None
    customer_country: Country | None = None
    manufacturer: StatedLine | None = None
    type: StatedLine | None = None
    procedure: StatedLine | None = None
    environment: StatedLine | None = None
    calibrated_on: Day | None = None
    issued: Day | None = None
    place: Literal["laboratory", "customer", "other"] = "laboratory"
    accreditation: StatedLine | None = None

    @model_validator(mode="after")
    def _days(self) -> LaboratoryFacts:
        in_order(self.calibrated_on, self.issued)
        return self


_BUILT = ("model.json", "training.json", "limits.json")  # besides c/: a certificate is of the build


@dataclass(frozen=True, slots=True)
class Certified:
    """Files that were written, and whether a PDF could be made."""

    files: tuple[Path, ...]
    pdf: bool


def laboratory_facts(meta: Mapping[str, Any], path: Path | None, number: str | None) -> LaboratoryFacts:
    """Collect the facts: the facts file before `[meta]`, the number of the command line before both.

    Raises:
        InputError: The file cannot be read, or a field is wrong or not known.
    """
    known = {key: value for key, value in meta.items() if key in LaboratoryFacts.model_fields and value != ""}
    where = "dataset.toml, [meta]"
    if path is not None:
        stated = read_toml(path, _EXPECTED)
        if stated.pop("schema", None) != 1:
            raise InputError(f"{path}, field schema", "is not 1", "schema = 1")
        known |= {key: json_value(value) for key, value in stated.items()}
        where = str(path)
    if number is not None:
        if not number.strip():
            raise InputError("--number", quoted(number), "the number of the certificate")
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
    """Write `certificate.html`, `dcc.xml` and, with Chromium, `certificate.pdf` into `out`.

    Args:
        folder: What `build` wrote, also of several axes.
        facts: A facts file of the laboratory.
        number: Number of the certificate.
        draft: Take what is missing as not stated: the page is marked as a draft, and there is no DCC.
        accept_fail: Why a unit gets one whose verdict is not PASS; both say it.

    Raises:
        InputError: Something that a certificate must say is missing (all of it is named), a file is not as it was
            built, parts are missing or of two units, its last day has passed, the verdict is not PASS and not accepted,
            or `out` cannot be replaced.
    """
    places = [folder / axis for axis in axes_in(folder)] or [folder]
    units = [unit_of(place) for place in places]
    refuse_parts_of_two(folder, {axis: unit.model for axis, unit in zip(axes_in(folder) or ("",), units, strict=True)})
    check_intact(folder, ("c",))
    _refuse_two_limits(folder, units)
    why = reason_of_release(folder, units, accept_fail)
    first = units[0]
    stated = laboratory_facts(first.model.meta, facts, number)
    valid_until = _last_day(folder, stated, first)
    missing = list(missing_facts(stated, units))
    if missing and not draft:
        raise InputError(
            str(folder), f"{len(missing)} things are missing for a certificate",
            "them in a facts file (--facts, docs/delivery.md) or in [meta], or --draft", missing,
        )  # fmt: skip
    for place, unit in zip(places, units, strict=True):
        _as_built(place, unit)
    with result_folder(out, "certificate", inputs=[folder]) as stage:
        stage.of(first.model.serial)
        issued = stated.model_copy(update={"issued": stated.issued or date.today().isoformat()})
        pictures: dict[str | None, Markup | None] = {
            u.model.axis: thermal_picture(place, u) for place, u in zip(places, units, strict=True)
        }
        page = certificate_page(units, pictures, issued, valid_until, missing, why)
        write_atomically(stage.folder / "certificate.html", page)
        if not missing:
            write_atomically(stage.folder / "dcc.xml", dcc_text(units, issued, valid_until, why))
        printed = print_to_pdf(stage.folder / "certificate.html", stage.folder / "certificate.pdf")
    written = {"certificate.html": True, "dcc.xml": not missing, "certificate.pdf": printed}
    return Certified(tuple(out / name for name, there in written.items() if there), printed)


def _refuse_two_limits(folder: Path, units: Sequence[UnitResults]) -> None:
    """Refuse axes that were judged by different limits.

    Raises:
        InputError: They were.
    """
    if len({unit.limits.sha256 if unit.limits else None for unit in units}) > 1:
        raise InputError(str(folder), "axes were judged by different limits", "axes that were built together")


def _last_day(folder: Path, stated: LaboratoryFacts, first: UnitResults) -> str | None:
    """Return the last day of the calibration; None where no interval is stated.

    Raises:
        InputError: It has passed, or the facts name another day of the calibration than the result.
    """
    budget = first.budget
    if budget is None:
        return None
    day = stated.calibrated_on
    if None not in (day, budget.calibrated_on) and str(day)[:10] != str(budget.calibrated_on)[:10]:
        found = f"is {str(day)[:10]}, and the result was calibrated on {str(budget.calibrated_on)[:10]}"
        raise InputError("field calibrated_on", found, "the day of this calibration, or a new build")
    until = last_day(day, budget.interval_days)
    if until is not None and until < date.today().isoformat():
        raise InputError(str(folder), f"was valid until {until}", "a calibration that is valid: record and build again")
    return until


def unit_of(folder: Path) -> UnitResults:
    """Check that a result of one axis is as it was written and consistent, and return it.

    Raises:
        InputError: It does not; or as `unit_in`.
    """
    unit = unit_in(folder)
    check_intact(folder, STATED)
    model, evaluation = unit.model, unit.evaluation
    named = {
        "evaluate.json": evaluation, "training.json": unit.training, "verify.json": unit.verification,
        "manifest.json": unit.manifest, "limits.json": unit.limits, "budget.json": unit.budget,
    }  # fmt: skip
    for name, result in named.items():
        if result is not None and (result.serial, result.axis) != (model.serial, model.axis):
            raise InputError(str(folder / name), "is of another gyro or axis", f"serial {model.serial}")
    check_stated(
        folder, model, evaluation, training=unit.training, verification=unit.verification, changes=unit.changes,
        limits=unit.limits, budget=unit.budget,
    )  # fmt: skip
    return unit


def reason_of_release(folder: Path, units: Sequence[UnitResults], reason: str | None) -> str | None:
    """The reason for which a unit is released whose verdict is not PASS; None where it is neither.

    Raises:
        InputError: The verdict is one of these and there is no reason, or it is neither and there is one.
    """
    verdict = worst_of(unit.decision for unit in units) or ""
    if reason is None:
        if verdict in NEED_REASON:
            why = [text for unit in units for text in (*unit.failures, unit.named(verdict)) if text]
            raise InputError(
                str(folder), f"its verdict is {verdict} ({'; '.join(why)[:200]})", "a PASS, or --accept-fail REASON"
            )
        return None
    if verdict not in NEED_REASON:
        raise InputError("--accept-fail", f"the verdict is {verdict or 'not stated'}", "no such option")
    line = " ".join(reason.split())
    if not 0 < len(line) <= _LONGEST:
        raise InputError("--accept-fail", quoted(reason), f"a reason of at most {_LONGEST} characters")
    return line


def missing_facts(facts: LaboratoryFacts, units: Sequence[UnitResults]) -> Iterator[str]:
    """Yield what a certificate must state and nobody has stated, each with where to state it."""
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
            "a temperature sensor with its certificate (state it as [[meta.instrument]] of dataset.toml or as"
            ' [[instrument]] of the limits file of build, quantity = "temperature"; then build again)'
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
        if name == EXAMPLE or not (name in _BUILT or name.startswith("c/")):
            continue
        if not path.is_file() or sha256(path) != known:
            expected = "a folder as gyrotc build left it; build again if gyrotc evaluate has replaced figures"
            raise InputError(str(path), "is not as it was built", expected)
