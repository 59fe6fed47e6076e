"""`limits.json`: limits of a product, each with what was measured."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Amount, Axis, Figure, Part, Result

__all__ = ["DecisionRule", "HeldLimits", "Limit", "Value", "Verdict"]

Verdict = Literal["PASS", "CONDITIONAL PASS", "FAIL"]
"""Statement of conformity; a conditional pass is within its limit, but closer to it than the guard band."""

DecisionRule = Literal["guard_band", "guard_band_binary", "simple_acceptance"]
"""How the uncertainty of a figure counts (ILAC-G8:09/2019, 4.2): see docs/limits.md."""

Value = bool | int | float | str | tuple[float, ...] | tuple[str, ...] | None
"""A bound, or what was measured of it; null: not measured."""


def _told(value: Value) -> str:
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
    uncertainty_from: str = Field(
        default="", description="what the uncertainty rests on, or why there is none"
    )

    def failure(self) -> str:
        """What is told of a limit that is not met."""
        bound, measured = (_told(v) for v in (self.bound, self.measured))
        if self.verdict == "CONDITIONAL PASS":
            return f"{self.limit} = {bound} is met by less than the guard band: {measured}"
        return f"{self.limit} = {bound} is not met: {measured}"


class HeldLimits(Result):
    """Limits of a product, held against what was measured (`gyrotc build --limits`)."""

    schema_: Annotated[Literal["gyrotc.limits/1"], Field(alias="schema")] = "gyrotc.limits/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where the recordings have one axis")
    product: str = Field(description="name of the product, empty where the limits file gives none")
    sha256: str = Field(description="of the limits file")
    met: bool = Field(description="whether all are met; false where the file gives no limits")
    limits: tuple[Limit, ...] = Field(description="every limit of the file")
    verdict: Verdict | None = Field(default=None, description="the worst of all limits; null: there are none")
    decision_rule: DecisionRule | None = Field(default=None, description="of the limits file")

    @property
    def decision(self) -> Verdict | None:
        """The verdict; None where there is nothing that it could be of. Files of an early gyrotc do not state it."""
        return (self.verdict or ("PASS" if self.met else "FAIL")) if self.limits else None
