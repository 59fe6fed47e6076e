"""`truth.json` beside simulated recordings: what was drawn, and the noise that was really added."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from .base import Numbered, Part

__all__ = ["SimulatedTruth", "TrueRun"]


class TrueRun(Part):
    """What was simulated in one run."""

    file: str = Field(description="as in `dataset.toml`")
    noise: str = Field(description="file of its noise, mean of every step, deg/h, by its path in the folder")
    noise_step_s: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(description="length of a step, s")
    bias_dph: tuple[float, float] = Field(description="lowest and highest true bias, deg/h")


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
    plan: dict[str, Any] = Field(description="gyro, chamber, sensor and channels of the scenario")
    runs: tuple[TrueRun, ...] = Field(description="every run")
