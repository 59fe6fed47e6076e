"""`truth.json` beside simulated recordings: what was drawn, and the noise that was really added."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from .base import Numbered, Part

__all__ = ["SimulatedTruth", "TrueLot", "TrueRun"]


class TrueRun(Part):
    """What was simulated in one run."""

    file: str = Field(description="as in `dataset.toml`")
    noise: str = Field(description="file of its noise, mean of every step, deg/h, by its path in the folder")
    noise_step_s: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(description="length of a step, s")
    bias_dph: tuple[float, float] = Field(description="lowest and highest true bias, deg/h")
    states: dict[str, str] | None = Field(
        default=None,
        description="of a gyro with further thermometers, differences of nodes or a laser: files of its true states by "
        "name (temperatures of the nodes, C; losses and gain, 1e-6; stroke, half wavelengths), mean of every step",
    )


class TrueLot(Part):
    """Where a gyro of a simulated lot stands in it."""

    units: int = Field(description="gyros in the lot")
    family: Annotated[float, Field(ge=0.0, le=1.0)] = Field(
        description="correlation of each parameter between two units of one cluster"
    )
    clusters: int = Field(description="groups with a center of their own")
    cluster: int = Field(description="number of the group, from 0; of a stranger that of none: -1")
    stranger: bool = Field(description="whether it shares nothing with the lot but the scenario")
    scores: dict[str, float] = Field(description="every parameter that was drawn, in standard deviations")


class SimulatedTruth(Numbered):
    """What a simulated data set really is; only `evaluate` and tests open it."""

    schema_: Annotated[Literal["gyrotc.truth/1"], Field(alias="schema")] = "gyrotc.truth/1"
    scenario: str = Field(description="name or file of the scenario")
    seed: int = Field(description="of everything that was drawn")
    noise: dict[str, Any] = Field(description="levels of the noise, as in the scenario")
    map: dict[str, Any] = Field(
        description="the bias of the gyro over temperature and its rate, as it was drawn"
    )
    causes: tuple[dict[str, Any], ...] = Field(description="`id`, `channel` and parameters of each cause")
    plan: dict[str, Any] = Field(
        description="gyro, chamber, sensor and what is recorded of the scenario: thermometers, laser, channels"
    )
    runs: tuple[TrueRun, ...] = Field(description="every run")
    lot: TrueLot | None = Field(default=None, description="of a gyro of a lot")
