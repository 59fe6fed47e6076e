"""`plan.json`: what a programmed profile will be able to tell."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Count, Figure, Part, Result

__all__ = [
    "Accuracy",
    "Additions",
    "AssumedNoise",
    "DetectionLimit",
    "Hard",
    "Plan",
    "PlanLimit",
    "PlannedRun",
    "Separability",
    "Shortest",
    "Temperature",
    "ThermometerPlace",
    "TriedRun",
]  # fmt: skip


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
    """From which size on a cause is told from the others."""

    id: str = Field(description="the cause that is there")
    parameter: str | None = Field(description="name of its parameter; null: none")
    value: Figure = Field(description="of its parameter")
    d: dict[str, float] = Field(
        description="size, in standard deviations, from which each other cause is ruled out"
    )


class Hard(Part):
    """Two causes that are hard to tell apart."""

    pair: tuple[str, str] = Field(description="ids")
    d: float = Field(description="size from which they are told apart")
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
    d: float = Field(description="size from which the pair is told apart with it")


class Additions(Part):
    """Further runs, ranked by how they part two causes."""

    pair: tuple[str, str] = Field(description="ids")
    runs: tuple[TriedRun, ...] = Field(description="the first is the profile as it is")


class ThermometerPlace(Part):
    """A node of the gyro as a place for a further thermometer (`--add-thermometer`)."""

    node: str = Field(description="name of the node")
    there: bool = Field(description="whether a thermometer is there")
    apart_c: float = Field(description="RMS of its temperature less the sensor's, about the mean, C")
    unseen_c: float = Field(
        description="RMS of what map and thermometers that are there do not hold of it, C"
    )
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
    bias_range_dph: tuple[float, float] = Field(
        description="lowest and highest bias of the simulated gyro, deg/h"
    )
    runs: tuple[PlannedRun, ...] = Field(description="of the profile")
    limits: tuple[PlanLimit, ...] = Field(description="what will be found")
    not_testable: dict[str, str] = Field(description="causes that cannot be tested, with the reason")
    separability: tuple[Separability, ...] = Field(description="what can be told from what")
    hard_to_separate: tuple[Hard, ...] = Field(description="the hardest first")
    accuracy: tuple[Accuracy, ...] = Field(description="after each run")
    shortest: Shortest | None = Field(description="where limits were required")
    additions: Additions | None = Field(description="where a pair was given")
    thermometers: tuple[ThermometerPlace, ...] | None = Field(
        default=None,
        description="places for a further thermometer, the most telling first; those that have one last",
    )
