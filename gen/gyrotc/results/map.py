"""A map on a grid (`gyrotc export --format json`)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Amount, Axis, Part, Result

__all__ = ["MapOfAxis", "MapOnGrid"]


class MapOfAxis(Part):
    """The static map of one axis at the points of a grid."""

    axis: Axis = Field(description="null where the recordings have one axis")
    model_hash: str = Field(description="of its model, shifted as its tables are (`emit --zero-at`)")
    temperature_c: tuple[float, ...] = Field(description="n temperatures, ascending, C")
    slope_c_per_min: tuple[float, ...] = Field(
        description="m rates of temperature, ascending, C/min; 0 is one of them where the envelope holds it"
    )
    bias_dph: tuple[tuple[float, ...], ...] = Field(
        description="n rows of m: the bias to be subtracted at each temperature and rate, deg/h"
    )
    linear_rms_dph: Amount = Field(
        description="RMS of what interpolation (bilinear, of values in float32) loses against the map, deg/h"
    )
    linear_largest_dph: Amount = Field(description="the most that it loses")
    terms: tuple[str, ...] = Field(description="ids of terms of the model, which no static map holds")


class MapOnGrid(Result):
    """The correction of a gyro as a table that any program reads."""

    schema_: Annotated[Literal["gyrotc.map/1"], Field(alias="schema")] = "gyrotc.map/1"
    serial: str = Field(description="gyro serial")
    axis: None = Field(description="each map has its own")
    units: dict[str, str] = Field(description="of every quantity of a map")
    maps: tuple[MapOfAxis, ...] = Field(description="one for each axis")
