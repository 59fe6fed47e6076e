"""`fleet.json`, and the `entry.json` of each gyro: many serials at once."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Axis, Count, Figure, Part, Result

__all__ = ["Copy", "FleetEntry", "FleetOutlier", "FleetSummary", "FleetUnit", "Spread"]


class FleetUnit(Part):
    """One gyro; figures are absent where nothing was made, and null where they were not measured."""

    name: str = Field(description="of its folder in the fleet")
    dataset: str | None = Field(
        default=None, description="its recordings; absent where they were not begun with"
    )
    axis: Axis = Field(description="null where the recordings have one axis")
    status: Literal["done", "failed", "unfinished"] = Field(
        description="`unfinished`: the fleet was stopped before it"
    )
    reason: str | None = Field(default=None, description="why it is not done")
    serial: str | None = Field(default=None, description="gyro serial")
    judged_on: Literal["exam", "left_out", "train"] | None = Field(
        default=None, description="kind of its runs"
    )
    before_rms_dph: Figure = Field(default=None, description="before compensation, deg/h")
    after_rms_dph: Figure = Field(default=None, description="after compensation, deg/h")
    after_mean_dph: Figure = Field(default=None, description="after compensation, deg/h")
    rms_over_floor: Figure = Field(default=None, description="`after_rms_dph` over the noise floor")
    noise_floor_dph: Figure = Field(default=None, description="deg/h")
    bias_dph: Figure = Field(default=None, description="mean bias, deg/h")
    centers: Count | None = Field(default=None, description="of all networks")
    table_bytes: Count | None = Field(default=None, description="size of the table, bytes (section 3)")
    sum_abs_weights_dph: Figure = Field(default=None, description="largest sum of a network's weights, deg/h")
    error_bound_dph: Figure = Field(default=None, description="of the tables for any input, deg/h")
    findings: tuple[str, ...] = Field(default=(), description="ids of findings")
    model_hash: str | None = Field(default=None, description="hash of the model")
    copy_of: tuple[str, ...] = Field(default=(), description="gyros of other serials with the same rows")
    aside: str | None = Field(
        default=None, description="folder of an earlier result that somebody had changed"
    )


class FleetEntry(FleetUnit):
    """What stands in `entry.json`: the same, and what it was made of."""

    key: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] | None = Field(
        default=None, description="hash of recordings, options, limits and program"
    )
    sketch: Annotated[str, Field(pattern="^([0-9a-f]{16})*$")] = Field(
        default="", description="hashes of rows, by which copies are found"
    )
    curve: tuple[Figure, ...] = Field(
        default=(),
        description="bias at a slope of 0 every 5 C from -60 to 125 C, deg/h; null outside the envelope",
    )
    kept: bool = Field(
        default=False, exclude=True, description="whether it is of an earlier call; not written"
    )

    def told(self) -> FleetUnit:
        """What a summary says of it."""
        return FleetUnit(
            **{name: getattr(self, name) for name in FleetUnit.model_fields if name in self.given}
        )

    @property
    def given(self) -> set[str]:
        """Names of the fields that were set."""
        return self.model_fields_set


class Spread(Part):
    """A figure over the fleet."""

    median: float = Field(description="of the gyros that have it")
    least: float = Field(description="of the gyros that have it")
    largest: float = Field(description="of the gyros that have it")


class FleetOutlier(Part):
    """A figure of a gyro that stands apart from the fleet."""

    name: str = Field(description="of the gyro")
    figure: str = Field(description="its name")
    value: float = Field(description="of this gyro")
    median: float = Field(description="of the fleet")
    sigmas: float = Field(description="distance in robust standard deviations")


class Copy(Part):
    """Two gyros of different serials with the same rows."""

    name: str = Field(description="of a gyro")
    serial: str = Field(description="its serial")
    other: str = Field(description="name of the other")
    other_serial: str = Field(description="its serial")
    share: float = Field(description="of the smaller one's rows, about")


class FleetSummary(Result):
    """Many gyros (`gyrotc fleet`)."""

    schema_: Annotated[Literal["gyrotc.fleet/1"], Field(alias="schema")] = "gyrotc.fleet/1"
    serial: None = Field(description="a fleet is of no gyro")
    axis: None = Field(description="of no axis")
    units: Count = Field(description="gyros")
    done: Count = Field(description="gyros whose table was made and passed every check")
    failed: Count = Field(description="gyros that failed")
    unfinished: Count = Field(description="gyros that the fleet was stopped before")
    figures: dict[str, Spread | None] = Field(description="figures over the fleet; null where no gyro has it")
    outliers: tuple[FleetOutlier, ...] = Field(description="what stands apart, the farthest first")
    copies: tuple[Copy, ...] = Field(description="gyros with rows of another serial")
    serials: tuple[FleetUnit, ...] = Field(description="every gyro, in the order of the manifest")
