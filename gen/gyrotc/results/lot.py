"""`lot.json`: what units of one type share, learnt from fully calibrated ones."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Amount, Axis, Count, Figure, Part, Positive, Result, Share

Celsius = Annotated[float, Field(ge=-400.0, le=800.0)]
Rate = Annotated[float, Field(ge=-2000.0, le=2000.0)]
Numbers = tuple[float, ...]


class LotFunctions(Part):
    """The functions that maps are written in: docs/lot.md, section 7."""

    center_c: Celsius = Field(description="z_T = (T - center)/half range")
    half_range_c: Positive = Field(description="of T, C")
    half_range_c_per_min: Positive = Field(description="of dT/dt, C/min")
    kept: tuple[Annotated[int, Field(ge=0, le=120)], ...] = Field(description="numbers of the functions, of 121")


class LotProcess(Part):
    """A smooth process: standard deviations in units of the lot, scales in half ranges."""

    constant: Positive = Field(description="of the constant")
    short: Positive = Field(description="of the part with a short scale in T")
    short_scale: Positive = Field(description="its scale")
    long: Positive = Field(description="of the part with a long scale in T")
    long_scale: Positive = Field(description="its scale")
    coupled: Positive = Field(description="of the part that couples T and dT/dt")
    coupled_scale_t: Positive = Field(description="its scale in T")
    coupled_scale_r: Positive = Field(description="its scale in dT/dt")


class LotCluster(Part):
    """Units that resemble each other."""

    units: Count = Field(description="how many")
    mean: Numbers = Field(description="coefficients of their mean map, in units of the lot")
    covariance: tuple[Numbers, ...] = Field(description="how well it is known: lower triangle, row by row")


class LotUnit(Part):
    """A unit that the lot was learnt from, or that was excluded."""

    serial: str = Field(description="gyro serial")
    model_hash: str = Field(description="hash of its model")
    cluster: int | None = Field(description="number of its cluster, from 0; null: it was excluded")
    p_value: Share = Field(description="probability that a unit of the lot without it lies as far from it")


class CrossValidation(Part):
    """What the lot says of units that it has not seen, nothing of them being known."""

    folds: Count = Field(description="parts of the units, each left out in turn")
    spread_scale: Positive = Field(description="by what the covariances had to be multiplied")
    left_rms_dph: Amount = Field(description="RMS of a unit's map about the mean of its cluster, deg/h")
    constant_rms_dph: Amount = Field(description="RMS of a unit's map about its own mean, deg/h")


class LotAgeing(Part):
    """How biases of the lot's units moved between two calibrations: random walks in time, 1 sigma."""

    units: Count = Field(description="units that were calibrated twice")
    months: Positive = Field(description="median time between the two calibrations")
    level_dph_per_sqrt_month: Amount = Field(description="of the level, deg/h/√month")
    shape_dph_per_sqrt_month_c: Amount = Field(description="of the map's random walk along T, deg/h/√(month C)")


class AtRest(Part):
    """The lot to be read: its first cluster where temperature stands still."""

    temperature_c: Numbers = Field(description="C")
    mean_dph: Numbers = Field(description="mean map, deg/h")
    spread_dph: Numbers = Field(description="standard deviation of a new unit about it, deg/h")


class Lot(Result):
    """What units of one type share (`gyrotc lot`)."""

    schema_: Annotated[Literal["gyrotc.lot/1"], Field(alias="schema")] = "gyrotc.lot/1"
    axis: Axis = Field(description="of the gyros; null where their recordings have one axis")
    units: tuple[LotUnit, ...] = Field(description="fully calibrated units, in the order of their folders")
    text: str = Field(description="in words: how much is shared, clusters, outliers")
    temperature_c: tuple[Celsius, Celsius] = Field(description="envelope of the lot, C")
    slope_c_per_min: tuple[Rate, Rate] = Field(description="the same of dT/dt, C/min")
    occupancy: tuple[Numbers, ...] = Field(
        description="where units were: share of time in cells of the envelope, a row for each of dT/dt, T ascending"
    )
    center_dph: float = Field(description="0 of the coefficients, deg/h")
    unit_dph: Positive = Field(description="1 of the coefficients, deg/h")
    functions: LotFunctions = Field(description="what maps are written in")
    clusters: Annotated[tuple[LotCluster, ...], Field(min_length=1)] = Field(
        description="one, where no more were found"
    )
    directions: tuple[Numbers, ...] = Field(description="in which units differ: coefficients of one standard deviation")
    rest: LotProcess = Field(description="what is each unit's own besides")
    of_mean: LotProcess = Field(description="smoothness of the mean maps")
    noise_dph: Positive = Field(description="median noise of means over `mean_s`, deg/h")
    mean_s: Positive = Field(description="length of these means, s")
    between_dph: Amount = Field(description="of the constant from power-on to power-on: RMS over the units, deg/h")
    cross_validation: CrossValidation = Field(description="over units")
    at_rest: AtRest = Field(description="to be read")
    ageing: LotAgeing | None = Field(default=None, description="not there: no earlier fleet was given")
    checksum: str = Field(description="SHA-256 of the canonical form without this field")


class UnitCurve(Part):
    """Prior, recordings and posterior where temperature stands still."""

    temperature_c: Numbers = Field(description="C")
    prior_dph: Numbers = Field(description="what the lot says, deg/h")
    prior_sigma_dph: Numbers = Field(description="1 sigma of it, deg/h")
    posterior_dph: Numbers = Field(description="what lot and runs say together, deg/h")
    posterior_sigma_dph: Numbers = Field(description="1 sigma of it, deg/h")


class LotUse(Part):
    """What a lot did for a unit."""

    checksum: str = Field(description="of `lot.json`")
    units: Count = Field(description="units that the lot was learnt from")
    member: bool = Field(description="whether this serial is one of them: then the lot has seen it before")
    cluster: int = Field(description="number of the cluster that fits best, from 0")
    p_value: Share = Field(description="probability that a unit of the lot lies as far from it as these runs do")
    accepted: bool = Field(description="whether the lot was used: p_value is at least `false_alarm`")
    false_alarm: Share = Field(description="share of the lot's own units that the test refuses")
    text: str = Field(description="in words: what came from the lot and what from the unit's own runs")
    own_share: Figure = Field(
        description="of the variance that the lot leaves, mean over the envelope: what the unit's runs have removed"
    )
    prior_sigma_dph: Amount = Field(description="1 sigma by the lot alone, RMS over where units are, deg/h")
    sigma_dph: Amount = Field(description="1 sigma of lot and runs together, the same, deg/h")
    curve: UnitCurve | None = Field(description="for the picture; null: the lot was not used")


class KnownMap(Part):
    """What was known of a unit's map when its table was made, where its own recordings do not say it all."""

    temperature_c: tuple[Celsius, Celsius] = Field(description="envelope, C")
    slope_c_per_min: tuple[Rate, Rate] = Field(description="the same of dT/dt, C/min")
    center_dph: float = Field(description="0 of the coefficients, deg/h")
    unit_dph: Positive = Field(description="1 of the coefficients, deg/h")
    functions: LotFunctions = Field(description="what maps are written in: docs/lot.md, section 7")
    mean: Numbers = Field(description="coefficients of the map")
    covariance: tuple[Numbers, ...] = Field(description="of the coefficients: lower triangle, row by row")
    rest: LotProcess = Field(description="the smooth process behind it")
    asked_temperature_c: Numbers = Field(description="where corrections are asked for, C")
    asked_slope_c_per_min: Numbers = Field(description="the same, C/min")
    asked_share: Numbers = Field(description="the same, share of time")
    between_dph: Amount = Field(description="of the constant from power-on to power-on, 1 sigma, deg/h")
