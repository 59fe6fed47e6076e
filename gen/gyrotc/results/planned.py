"""`plan.json` of `gyrotc plan`, of a profile, with a lot and for one unit."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Amount, Count, Figure, Part, Positive, Result, Share, UnitResult


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
    without: LotProgramme = Field(description="for a unit of which nothing is known but that its map is smooth")


class ProposedRun(Part):
    """A run, what it is expected to bring, and what it costs."""

    programme: LotProgramme = Field(description="what the chamber does, and 1 sigma of the map after it")
    removed_share: Share = Field(description="of the map's variance, mean over where corrections are asked for")
    price: Amount = Field(description="of the run, with what one run costs before it begins")


class Parking(Part):
    """What a first parking is worth to a gyro that learns in service."""

    minutes: Positive = Field(description="its length, min")
    before_dph: Amount = Field(description="1 sigma of the shift without it, deg/h")
    after_dph: Amount = Field(description="the same right after it, where the table is known best, deg/h")


class NextRun(UnitResult):
    """Which run to record next for a unit (`gyrotc plan --unit`)."""

    schema_: Annotated[Literal["gyrotc.next-run/1"], Field(alias="schema")] = "gyrotc.next-run/1"
    model_hash: str = Field(description="of the unit's model")
    scenario: str = Field(description="whose chamber and instrument are assumed")
    before_dph: Amount = Field(description="1 sigma of the map as it is known now, deg/h")
    price_per_hour: Positive = Field(description="of the chamber, in any currency")
    price_per_run: Amount = Field(description="of mounting, settling and powering once, in the same")
    proposals: tuple[ProposedRun, ...] = Field(
        description="each longer than the one before it and beginning like it; the last is the longest that is allowed"
    )
    best: int = Field(ge=0, description="number of the one that removes most variance for its price, from 0")
    parkings: tuple[Parking, ...] = Field(default=(), description="of one that learns in service; empty: it does not")


class AssumedNoise(Part):
    """Noise that was assumed."""

    arw_deg_per_sqrt_h: float = Field(description="angle random walk, deg/√h")
    bias_instability_dph: float = Field(description="deg/h")
    rate_random_walk_dph_per_sqrt_h: float = Field(description="deg/h/√h")
    quantum_arcsec: float = Field(description="arcsec")


class Temperature(Part):
    """Temperature of a run, for a picture."""

    time_h: tuple[float, ...] = Field(description="h")
    value_c: tuple[float, ...] = Field(description="C")


class PlannedRun(Part):
    """One run of the profile."""

    profile: str = Field(description="its name")
    hours: float = Field(description="h")
    temperature: Temperature = Field(description="at the sensor")


class DetectionLimit(Part):
    """Smallest size of a cause that is found in 95 % of cases."""

    value: Figure = Field(description="null: never")
    unit: str = Field(description="of `value`")
    parameter: str | None = Field(description="that the limit depends on; null: none")
    over: tuple[tuple[float, Figure], ...] = Field(description="pairs of parameter and limit")


class PlanLimit(Part):
    """From which size on the profile will show a cause."""

    id: str = Field(description="of the catalogue of causes")
    family: str = Field(description="of the cause")
    detection_limit: DetectionLimit = Field(description="what these runs will find")


class Separability(Part):
    """From which size on a cause is recognised from the others."""

    id: str = Field(description="the cause that is there")
    parameter: str | None = Field(description="name of its parameter; null: none")
    value: Figure = Field(description="of its parameter")
    d: dict[str, float] = Field(description="size, in standard deviations, from which each other cause is ruled out")


class Hard(Part):
    """Two causes that are hard to separate."""

    pair: tuple[str, str] = Field(description="ids")
    d: float = Field(description="size from which they are separated")
    add: str = Field(description="what would part them")


class Accuracy(Part):
    """Predicted accuracy after some of the runs."""

    hours: float = Field(description="chamber hours until then")
    runs: Count = Field(description="number of runs until then")
    map_error_dph: float = Field(description="error of the map over the whole programme, deg/h")
    rms_dph: float = Field(description="RMS of means over 100 s, deg/h")
    rms_over_floor: float = Field(description="over the noise floor")


class Shortest(Part):
    """The shortest profile that reaches what is required."""

    required: dict[str, float] = Field(description="detection limits by cause")
    runs: tuple[str, ...] | None = Field(description="its runs; null: not reached by any number of them")
    hours: Figure = Field(description="h")
    reached: dict[str, Figure] = Field(description="detection limits by cause")


class TriedRun(Part):
    """What a further run would tell about the pair."""

    profile: str = Field(description="its name")
    hours: float = Field(description="h")
    d: float = Field(description="size from which the pair is separated with it")


class Additions(Part):
    """Further runs, ranked by how they part two causes."""

    pair: tuple[str, str] = Field(description="ids")
    runs: tuple[TriedRun, ...] = Field(description="the first is the profile as it is")


class ThermometerPlace(Part):
    """A node of the gyro as a place for a further thermometer (`--add-thermometer`)."""

    node: str = Field(description="name of the node")
    there: bool = Field(description="whether a thermometer is there")
    difference_c: float = Field(description="RMS of its temperature less the sensor's, about the mean, C")
    unseen_c: float = Field(description="RMS of what map and thermometers that are there do not hold of it, C")
    limit_dph_per_c: Figure = Field(
        description="amplitude of a part of the bias that follows it from which these runs show it; null: never"
    )


class Plan(Result):
    """What a profile will be able to tell, before it is run (`gyrotc plan`)."""

    schema_: Annotated[Literal["gyrotc.plan/1"], Field(alias="schema")] = "gyrotc.plan/1"
    serial: None = Field(description="a plan is of no gyro")
    axis: None = Field(description="of no axis")
    scenario: str = Field(description="name of the profile")
    hours: float = Field(description="chamber hours")
    noise: AssumedNoise = Field(description="that was assumed")
    bias_range_dph: tuple[float, float] = Field(description="lowest and highest bias of the simulated gyro, deg/h")
    runs: tuple[PlannedRun, ...] = Field(description="of the profile")
    limits: tuple[PlanLimit, ...] = Field(description="what will be found")
    not_testable: dict[str, str] = Field(description="causes that cannot be tested, with the reason")
    separability: tuple[Separability, ...] = Field(description="what can be distinguished from what")
    hard_to_separate: tuple[Hard, ...] = Field(description="the hardest first")
    accuracy: tuple[Accuracy, ...] = Field(description="after each run")
    shortest: Shortest | None = Field(description="where limits were required")
    additions: Additions | None = Field(description="where a pair was given")
    thermometers: tuple[ThermometerPlace, ...] | None = Field(
        default=None,
        description="places for a further thermometer, the most telling first; those that have one last",
    )
