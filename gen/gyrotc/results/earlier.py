"""What a unit's earlier model was worth for its recalibration (`--prior`): part of `training.json`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Amount, Figure, Part
from .lot import UnitCurve

__all__ = ["CheckedCell", "EarlierUse", "MapChange"]

_Share = Annotated[float, Field(ge=0.0, le=1.0)]


class CheckedCell(Part):
    """What the earlier model left of the check run in a part of the envelope, and what it may have left."""

    temperature_c: tuple[float, float] = Field(description="from, to, C")
    slope_c_per_min: tuple[float, float] = Field(
        description="lowest and highest dT/dt of the run there, C/min"
    )
    found_dph: float = Field(description="mean of what the earlier map left, deg/h")
    limit_dph: Amount = Field(
        description="what it may be, either way: by the earlier model's sigma, ageing and the noise of the run; all "
        "cells of a unit that has not changed lie within theirs in 99 of 100 check runs"
    )
    within: bool = Field(description="whether it is")


class MapChange(Part):
    """The change of the map that explains best why the earlier model does not hold."""

    kind: Literal["offset", "slope", "rate", "local"] = Field(
        description="the same everywhere, in proportion to T, in proportion to dT/dt, or in a region"
    )
    temperature_c: tuple[float, float] = Field(description="where, C")
    slope_c_per_min: tuple[float, float] = Field(description="where, C/min")
    size_dph: float = Field(
        description="deg/h: the offset, from one end of the region to the other, or in the middle of the region"
    )
    standard_uncertainty_dph: Amount = Field(description="of it, deg/h")
    text: str = Field(description="in words")


class EarlierUse(Part):
    """What the earlier model of a unit did for its recalibration."""

    model_hash: str = Field(description="of the earlier model")
    date: str | None = Field(description="of the earlier calibration; null: it states none")
    ageing_dph: Amount = Field(description="how far the bias may have moved since, 1 sigma, deg/h")
    ageing_from: str = Field(description="where that comes from")
    p_value: _Share = Field(
        description="probability that a unit that has not changed lies as far away as this one"
    )
    false_alarm: _Share = Field(
        description="share of unchanged units of which it is said that they have changed"
    )
    confirmed: bool = Field(description="whether the check run confirms the earlier model")
    accepted: bool = Field(
        description="whether the table is made from both; else from the new recordings alone"
    )
    change: MapChange | None = Field(description="what changed; null: nothing was seen")
    cells: tuple[CheckedCell, ...] = Field(description="the check run in parts, T ascending")
    own_share: Figure = Field(
        description="of the variance that the earlier model leaves after ageing, mean over where corrections are "
        "asked for: what the check run has removed"
    )
    prior_sigma_dph: Amount = Field(description="1 sigma of the earlier model after ageing, RMS, deg/h")
    sigma_dph: Amount = Field(description="1 sigma of both together, deg/h")
    curve: UnitCurve | None = Field(description="for the picture; null: the earlier model was not used")
    text: str = Field(description="in words")
