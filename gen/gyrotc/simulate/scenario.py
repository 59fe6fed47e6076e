"""Scenario files: what is simulated, in TOML, checked before anything is computed.

A scenario names a gyro (thermal network, range of its bias), a chamber, the sensor, profiles (one chamber programme
each) and sets (which profiles are run, when, and in which role). docs/simulation.md describes every key.
"""

from __future__ import annotations

import sys
from datetime import datetime
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from ..errors import InputError
from .profile import Step

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["Chamber", "NoiseLevels", "Profile", "RunSet", "Scenario", "Sensor", "names", "read"]

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Chamber(_Strict):
    """The chamber's air and how well it follows its programme."""

    lag_s: Positive = 120.0
    setpoint_sigma_c: NonNegative = 0.1


class Node(_Strict):
    """One node of the instrument's thermal network."""

    heat_capacity_j_per_k: Positive
    power_w: NonNegative = 0.0
    to_air_w_per_k: NonNegative = 0.0
    to: dict[str, Positive] = {}


def _default_nodes() -> dict[str, Node]:
    """Case, glass block and cavity (bore surface, mirrors, gas): self-heating 8 K, cavity 20 s behind the block."""
    return {
        "case": Node(heat_capacity_j_per_k=1500.0, power_w=14.75, to_air_w_per_k=2.5, to={"block": 1.0}),
        "block": Node(heat_capacity_j_per_k=800.0, to={"cavity": 3.0}),
        "cavity": Node(heat_capacity_j_per_k=60.0, power_w=1.5),
    }


class Gyro(_Strict):
    """The instrument: its serial (`{seed}` is filled in), the range of its bias and its thermal network."""

    serial: Annotated[str, Field(pattern=r"^[A-Za-z0-9._{}-]{1,56}$")] = "SIM-{seed}"
    bias_dph: tuple[float, float] = (5.8e-3, 8.5e-3)
    node: dict[str, Node] = Field(default_factory=_default_nodes)
    cavity_node: str = "cavity"

    @model_validator(mode="after")
    def _check(self) -> Gyro:
        if self.bias_dph[0] >= self.bias_dph[1]:
            raise ValueError("bias_dph: the lower end comes first")
        known = set(self.node)
        for name, node in self.node.items():
            if unknown := set(node.to) - known:
                raise ValueError(f"node {name} conducts to {sorted(unknown)}, which are no nodes")
        if self.cavity_node not in known:
            raise ValueError(f"cavity_node {self.cavity_node!r} is no node")
        if not any(node.to_air_w_per_k > 0.0 for node in self.node.values()):
            raise ValueError("no node conducts to the air")
        return self


class Sensor(_Strict):
    """The temperature sensor that the product carries: read once a second."""

    node: str = "block"
    lag_s: NonNegative = 10.0
    noise_c: NonNegative = 0.01
    resolution_c: NonNegative = 0.01


class NoiseLevels(_Strict):
    """Noise of the rate in the terms of IEEE Std 647, annex C."""

    arw_deg_per_sqrt_h: NonNegative = 0.0
    bias_instability_dph: NonNegative = 0.0
    rate_random_walk_dph_per_sqrt_h: NonNegative = 0.0
    quantum_arcsec: NonNegative = 0.0


class Profile(_Strict):
    """One chamber programme, when power comes on in it and what of it is recorded (minutes from its start)."""

    start_c: float
    power_on_min: NonNegative = 0.0
    record_from_min: NonNegative = 0.0
    record_min: Positive
    steps: Annotated[list[Step], Field(min_length=1)]


class RunSet(_Strict):
    """Profiles that are run one after the other."""

    role: Literal["train", "exam"] = "train"
    started: datetime
    every_h: Positive = 24.0
    profiles: Annotated[list[str], Field(min_length=1)]


class Scenario(_Strict):
    """A whole campaign."""

    title: str
    gyro: Gyro = Field(default_factory=Gyro)
    chamber: Chamber = Field(default_factory=Chamber)
    sensor: Sensor = Field(default_factory=Sensor)
    noise: NoiseLevels | None = None
    profile: Annotated[dict[str, Profile], Field(min_length=1)]
    set: Annotated[list[RunSet], Field(min_length=1)]

    @model_validator(mode="after")
    def _check(self) -> Scenario:
        for index, run_set in enumerate(self.set):
            if unknown := [name for name in run_set.profiles if name not in self.profile]:
                raise ValueError(f"set {index + 1} runs {unknown}, which are no profiles")
        if self.sensor.node not in self.gyro.node:
            raise ValueError(f"sensor.node {self.sensor.node!r} is no node of the gyro")
        return self


def names() -> list[str]:
    """Names of the scenarios that come with gyrotc."""
    folder = resources.files(__package__).joinpath("..", "scenarios")
    return sorted(Path(entry.name).stem for entry in folder.iterdir() if entry.name.endswith(".toml"))


def read(scenario: str | Path) -> tuple[str, Scenario]:
    """A scenario by name, or from a file.

    Returns:
        Its name (file stem) and the checked scenario.

    Raises:
        InputError: no such scenario or file, no TOML, or a key or value that cannot be.
    """
    where, text = _text(scenario)
    try:
        content: dict[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(where, str(error), "TOML") from error
    try:
        return Path(where).stem, Scenario.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{where}, {field}" if field else where, first["msg"]) from error


def _text(scenario: str | Path) -> tuple[str, str]:
    path = Path(scenario)
    packaged = resources.files(__package__).joinpath("..", "scenarios", f"{scenario}.toml")
    if isinstance(scenario, str) and path.suffix == "" and packaged.is_file():
        return f"{scenario}.toml", packaged.read_text("utf-8")
    try:
        return str(path), path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        known = ", ".join(names())
        raise InputError(str(scenario), "no such scenario", f"a TOML file or one of: {known}") from error
