"""`plan.json` of `gyrotc plan --unit`: which run to record next for a unit."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Amount, Axis, Part, Positive, Result
from .lot_plan import LotProgramme

__all__ = ["NextRun", "ProposedRun"]

_Share = Annotated[float, Field(ge=0.0, le=1.0)]


class ProposedRun(Part):
    """A run, what it is expected to bring, and what it costs."""

    programme: LotProgramme = Field(description="what the chamber does, and 1 sigma of the map after it")
    removed_share: _Share = Field(
        description="of the map's variance, mean over where corrections are asked for"
    )
    price: Amount = Field(description="of the run, with what one run costs before it begins")


class NextRun(Result):
    """Which run to record next for a unit (`gyrotc plan --unit`)."""

    schema_: Annotated[Literal["gyrotc.next-run/1"], Field(alias="schema")] = "gyrotc.next-run/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where the recordings have one axis")
    model_hash: str = Field(description="of the unit's model")
    scenario: str = Field(description="whose chamber and instrument are assumed")
    before_dph: Amount = Field(description="1 sigma of the map as it is known now, deg/h")
    price_per_hour: Positive = Field(description="of the chamber, in any currency")
    price_per_run: Amount = Field(description="of mounting, settling and powering once, in the same")
    proposals: tuple[ProposedRun, ...] = Field(
        description="each longer than the one before it and beginning like it; the last is the longest that is allowed"
    )
    best: int = Field(ge=0, description="number of the one that removes most variance for its price, from 0")
