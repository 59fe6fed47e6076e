"""`plan.json` of `gyrotc plan --lot`: the shortest chamber programme that reaches an accuracy with a lot."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Amount, Part, Result

__all__ = ["ChamberStep", "LotPlan", "LotProgramme"]


class ChamberStep(Part):
    """A ramp and the hold after it."""

    to_c: float = Field(description="set point, C")
    c_per_min: Amount = Field(description="rate of the ramp to it, C/min")
    hold_min: Amount = Field(description="hold there, min")


class LotProgramme(Part):
    """A chamber programme and what it promises."""

    start_c: float = Field(description="where it starts, power coming on with it, C")
    steps: tuple[ChamberStep, ...] = Field(description="in their order")
    hours: Amount = Field(description="length, h")
    sigma_dph: Amount = Field(description="promised: 1 sigma of the map, RMS over where units are, deg/h")
    rms_over_floor: Amount = Field(description="the same as RMS over the noise floor of means over 100 s")
    reached: bool = Field(description="whether that is what was required; else it is what a day reaches")


class LotPlan(Result):
    """The shortest programme with a lot, and without."""

    schema_: Annotated[Literal["gyrotc.lot-plan/1"], Field(alias="schema")] = "gyrotc.lot-plan/1"
    lot: str = Field(description="checksum of the lot")
    scenario: str = Field(description="whose chamber and instrument are assumed")
    accuracy_dph: Amount = Field(description="required, deg/h")
    before_dph: Amount = Field(description="1 sigma by the lot alone, before any run, deg/h")
    with_lot: LotProgramme = Field(description="with the lot")
    without: LotProgramme = Field(
        description="for a unit of which nothing is known but that its map is smooth"
    )
