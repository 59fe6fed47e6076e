"""`limits.json`, `budget.json` and `c/release.json`: what is decided about a unit, and what a laboratory signs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Amount, Axis, Figure, Part, Positive, Result, UnitResult


class Instrument(Part):
    """What the calibration was made with, as `[[meta.instrument]]` or the limits file state it."""

    name: str = Field(description="what it is, with its own serial")
    certificate: str = Field(default="", description="number of its certificate; empty: none is stated")
    quantity: Literal["temperature", "rate", "other"] = Field(
        default="other",
        description="what its uncertainty is of: the temperature that the table is asked with, C; the rate that "
        "the recordings are referred to, deg/h; another, which takes no part in the budget",
    )
    expanded_uncertainty: Positive | None = Field(
        default=None, description="as its certificate states it, in the unit of the quantity"
    )
    coverage_factor: Annotated[float, Field(ge=1.0, le=10.0)] = Field(default=2.0, description="k of that uncertainty")
    degrees_of_freedom: Positive | None = Field(default=None, description="of it; null: many")


class Contribution(Part):
    """One source of uncertainty."""

    id: Literal["noise", "fit", "unseen", "turn_on", "thermometer", "reference", "arithmetic", "ageing"] = Field(
        description="its stable name"
    )
    text: str = Field(description="what it is of")
    type: Literal["A", "B"] = Field(description="of its evaluation: by statistics, or by other means")
    distribution: Literal["normal", "rectangular", "t"] = Field(description="that is assumed of it")
    standard_uncertainty: Amount = Field(description="u of the input, 1 sigma")
    unit: str = Field(description="of the input")
    sensitivity: Amount = Field(description="c: deg/h of the result for a unit of the input")
    contribution_dph: Amount = Field(description="c u, deg/h")
    freedom: Figure = Field(description="degrees of freedom; null: many")
    source: str = Field(description="what it rests on")
    certificate: str = Field(default="", description="that states it; empty: none")


class Budget(UnitResult):
    """Uncertainty of the bias that is left after compensation (`gyrotc build`)."""

    schema_: Annotated[Literal["gyrotc.budget/1"], Field(alias="schema")] = "gyrotc.budget/1"
    measurand: str = Field(description="what the uncertainty is of, in words")
    contributions: tuple[Contribution, ...] = Field(description="all that are known")
    not_known: tuple[str, ...] = Field(description="sources of which nothing was stated, which are not in it")
    combined_dph: Amount = Field(description="combined standard uncertainty: root of the sum of squares, deg/h")
    freedom: Figure = Field(description="effective degrees of freedom (Welch and Satterthwaite); null: many")
    coverage_factor: Positive = Field(description="k of 95.45 %")
    expanded_dph: Amount = Field(description="U = k times the combined one, deg/h")
    instruments: tuple[Instrument, ...] = Field(description="with their certificates")
    calibrated_on: str | None = Field(description="`calibrated_on` of `[meta]`; null: not stated")
    interval_days: Figure = Field(description="until the next calibration, days; null: none is stated")
    valid_until: str | None = Field(description="last day of the interval; null: no date or no interval")


Verdict = Literal["PASS", "CONDITIONAL PASS", "FAIL"]
"""Statement of conformity; a conditional pass is within its limit, but closer to it than the guard band."""

NEED_REASON: tuple[Verdict, ...] = ("CONDITIONAL PASS", "FAIL")
"""Verdicts of units that are certified and signed only for a stated reason."""

JudgedOn = Literal["exam", "left_out", "train"]
"""What a figure was measured on."""

DecisionRule = Literal["guard_band", "guard_band_binary", "simple_acceptance"]
"""How the uncertainty of a figure counts (ILAC-G8:09/2019, 4.2): see docs/limits.md."""

Value = bool | int | float | str | tuple[float, ...] | tuple[str, ...] | None
"""A bound, or what was measured of it; null: not measured."""


def _in_words(value: Value) -> str:
    """A bound or a figure on one line."""
    if isinstance(value, tuple):
        return ", ".join(str(v) for v in value) or "none"
    return "not measured" if value is None else str(value)


class Limit(Part):
    """One limit with what was measured."""

    limit: str = Field(description="name in the limits file, such as `at_most.rms_dph`")
    measured: Value = Field(description="figure, range, or what was found; null where it was not measured")
    bound: Value = Field(description="as in the limits file")
    met: bool = Field(
        description="whether the decision rule accepts it, a conditional pass included; a limit whose figure was not "
        "measured is not met"
    )
    verdict: Verdict | None = Field(default=None, description="null: of a gyrotc that did not state it")
    standard_uncertainty: Figure = Field(
        default=None,
        description="1 sigma, in the unit of the figure; null where there is none or it is not known",
    )
    degrees_of_freedom: Figure = Field(default=None, description="of that uncertainty; null: many")
    coverage_factor: Figure = Field(
        default=None, description="k of 95.45 %: 2 for many degrees of freedom, Student's t for few"
    )
    expanded_uncertainty: Figure = Field(default=None, description="U, k times the standard uncertainty")
    guard_band: Figure = Field(default=None, description="w: U, or 0 by simple acceptance")
    acceptance_limit: Figure = Field(default=None, description="the bound less the guard band")
    false_acceptance: Amount | None = Field(
        default=None,
        description="probability that the figure is beyond its limit although it was accepted: specific risk, normal "
        "distribution about what was measured, nothing known before; null where it was not accepted or has no "
        "uncertainty",
    )
    uncertainty_from: str = Field(default="", description="what the uncertainty rests on, or why there is none")

    part: JudgedOn | None = Field(
        default=None,
        description="what the figure was measured on: `exam` runs, `left_out` spans of training, or the training runs "
        "themselves; null: not on recordings",
    )
    capped: str = Field(
        default="", description="why it is CONDITIONAL PASS at most, and what to record; empty: it is not"
    )

    @property
    def decision(self) -> Verdict:
        """The verdict; files of an early gyrotc state only whether the limit is met."""
        return self.verdict or ("PASS" if self.met else "FAIL")

    def failure(self) -> str:
        """What is reported of a limit that is not met."""
        bound, measured = (_in_words(v) for v in (self.bound, self.measured))
        if self.verdict == "CONDITIONAL PASS":
            return f"{self.limit} = {bound} is met by less than the guard band: {measured}"
        return f"{self.limit} = {bound} is not met: {measured}"


class HeldLimits(UnitResult):
    """Limits of a product, held against what was measured (`gyrotc build --limits`)."""

    schema_: Annotated[Literal["gyrotc.limits/1"], Field(alias="schema")] = "gyrotc.limits/1"
    product: str = Field(description="name of the product, empty where the limits file gives none")
    sha256: str = Field(description="of the limits file")
    met: bool = Field(description="whether all are met; false where the file gives no limits")
    limits: tuple[Limit, ...] = Field(description="every limit of the file")
    verdict: Verdict | None = Field(default=None, description="the worst of all limits; null: there are none")
    decision_rule: DecisionRule | None = Field(default=None, description="of the limits file")
    display: str = Field(
        default="",
        description="unit in which pages show rates; empty: deg/h, as every figure of the file is in",
    )

    @property
    def decision(self) -> Verdict | None:
        """The verdict; None where there is nothing that it could be of. Files of an early gyrotc do not state it."""
        return (self.verdict or ("PASS" if self.met else "FAIL")) if self.limits else None

    @property
    def capped(self) -> tuple[str, ...]:
        """Why limits are CONDITIONAL PASS at most, each reason once."""
        return tuple(dict.fromkeys(one.capped for one in self.limits if one.capped))


RELEASED = (
    "model.json", "training.json", "evaluate.json", "limits.json", "budget.json", "changes.json", "manifest.json",
    "diagnosis/diagnose.json",
)  # fmt: skip
"""Files of an axis that say something of the unit, by their paths in its folder, and are signed."""

STATED = (*RELEASED, "verify.json", "c")
"""These and what is compared anew by whoever verifies."""


class ReleasedUnit(Part):
    """One axis."""

    axis: Axis = Field(description="null where the recordings have one axis")
    model_hash: str = Field(description="hash of the model")
    verdict: Verdict | None = Field(description="of limits and checks; null: no limits were given")
    failures: tuple[str, ...] = Field(description="checks that failed beside the limits")
    limits_sha256: str | None = Field(description="of the limits file; null where none was given")
    limits: tuple[Limit, ...] = Field(description="every limit")
    expanded_dph: Amount | None = Field(description="U of the compensated bias; null: no budget, deg/h")
    coverage_factor: Figure = Field(description="k of it")
    calibrated_on: str | None = Field(description="day of the calibration; null: not stated")
    valid_until: str | None = Field(description="last day of the interval; null: none is stated")


class Release(Result):
    """What is signed (`gyrotc sign`): it binds the emitted files to what was found of the unit."""

    schema_: Annotated[Literal["gyrotc.release/1"], Field(alias="schema")] = "gyrotc.release/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where there is one axis, and for the folder of several")
    verdict: Verdict | None = Field(description="the gravest of all axes; null: no limits were given")
    accepted_fail: str | None = Field(
        description="why it is released although the verdict is FAIL or CONDITIONAL PASS; else null"
    )
    units: tuple[ReleasedUnit, ...] = Field(description="every axis")
    emission: str = Field(description="SHA-256 of `c/emission.json`, which has that of every emitted file")
    files: dict[str, str] = Field(description="SHA-256 of the files behind this, by path in the result")
