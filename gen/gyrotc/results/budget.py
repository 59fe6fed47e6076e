"""`budget.json`: the uncertainty of what a unit's correction leaves, part by part (JCGM 100:2008)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Amount, Axis, Figure, Part, Positive, Result

__all__ = ["Budget", "Contribution", "Instrument"]


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
    coverage_factor: Annotated[float, Field(ge=1.0, le=10.0)] = Field(
        default=2.0, description="k of that uncertainty"
    )
    degrees_of_freedom: Positive | None = Field(default=None, description="of it; null: many")


class Contribution(Part):
    """One source of uncertainty."""

    id: Literal["noise", "fit", "unseen", "turn_on", "thermometer", "reference", "arithmetic", "ageing"] = (
        Field(description="its stable name")
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


class Budget(Result):
    """Uncertainty of the bias that is left after compensation (`gyrotc build`)."""

    schema_: Annotated[Literal["gyrotc.budget/1"], Field(alias="schema")] = "gyrotc.budget/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where the recordings have one axis")
    measurand: str = Field(description="what the uncertainty is of, in words")
    contributions: tuple[Contribution, ...] = Field(description="all that are known")
    not_known: tuple[str, ...] = Field(description="sources of which nothing was stated, which are not in it")
    combined_dph: Amount = Field(
        description="combined standard uncertainty: root of the sum of squares, deg/h"
    )
    freedom: Figure = Field(description="effective degrees of freedom (Welch and Satterthwaite); null: many")
    coverage_factor: Positive = Field(description="k of 95.45 %")
    expanded_dph: Amount = Field(description="U = k times the combined one, deg/h")
    instruments: tuple[Instrument, ...] = Field(description="with their certificates")
    calibrated_on: str | None = Field(description="`calibrated_on` of `[meta]`; null: not stated")
    interval_days: Figure = Field(description="until the next calibration, days; null: none is stated")
    valid_until: str | None = Field(description="last day of the interval; null: no date or no interval")
