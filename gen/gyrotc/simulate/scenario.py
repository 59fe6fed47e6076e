"""Scenario files: what is simulated, in TOML, checked before anything is computed.

A scenario names a gyro (thermal network, range of its bias), a chamber, the sensor, profiles (one chamber
programme each), sets (which profiles are run, when, and in which role) and causes of the catalogue.
`gyrotc simulate` takes one; docs/simulation.md describes it.
"""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from ..causes import CATALOGUE
from ..common.errors import InputError
from ..common.inputs import read_toml, refuse_above, refused
from ..recordings.description import Instant
from .profile import AboveZero, ChamberCelsius, Step

# Larger values have no meaning in any field, and their products are no numbers.
_MAX_VALUE = 1e9

Identifier = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
Value = Annotated[float, Field(ge=-_MAX_VALUE, le=_MAX_VALUE)]
NonNegative = Annotated[float, Field(ge=0.0, le=_MAX_VALUE)]
Minutes = Annotated[float, Field(ge=0.0, le=1e7)]

_FOLDER = Path(__file__).parent / "scenarios"
_OWN_COLUMNS = {"time_s", "temperature_c", "rate_dph", "pulses"}  # of every recording, so no channel has such a name


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Thermometer(_Strict):
    """A further thermometer, recorded as a column.

    From `loose_from_day` on its contact is loose: it shows the temperature `loose_share` of the way from its node to
    the air, with the lag `loose_lag_s`.
    """

    name: Identifier
    node: str
    lag_s: NonNegative = 10.0
    offset_c: Value = 0.0
    noise_c: NonNegative = 0.01
    resolution_c: NonNegative = 0.01
    loose_from_day: NonNegative | None = None
    loose_lag_s: NonNegative = 300.0
    loose_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5


class NodeDifference(_Strict):
    """A part of the bias that follows the temperature difference of two nodes.

    bias += dph_per_c · x/√(1 + (x/saturation_c)²) · (1 + growth_per_c (T_cavity − 20)), x = T_node − T_against
    """

    node: str
    against: str
    dph_per_c: Value
    saturation_c: AboveZero = 1e6
    growth_per_c: Value = 0.0


class Laser(_Strict):
    """The discharge and the cavity as the gyro itself sees them: beam intensity and path-length voltage.

    Units stand in the names; `laser.py` has the equations. Gain and losses are shares of the light of one round trip,
    1e-6; `walk_ppm` is the additional loss of the beam with the moving mirror half a wavelength off the middle of its
    stroke.
    """

    intensity: Identifier = "intensity_v"
    path_voltage: Identifier = "path_length_v"
    mirror_node: str = "cavity"
    gas_node: str = "gas"
    path_node: str = "block"
    loss_ppm: AboveZero = 300.0
    loss_ppm_per_c: Value = 0.1
    contamination_ppm: NonNegative = 6.0
    contamination_tau_s: AboveZero = 7200.0
    walk_ppm: NonNegative = 20.0
    gain_ppm: AboveZero = 900.0
    gain_per_c: Value = -1e-3
    gas_c: Value = 50.0
    depletion_day: AboveZero = 10000.0
    intensity_level_v: AboveZero = 2.0
    intensity_noise_v: NonNegative = 5e-4
    wavelength_nm: AboveZero = 632.8
    path_mm: AboveZero = 280.0
    expansion_ppm_per_c: Value = 0.03
    expansion_ppm_per_c2: Value = 1e-4
    mirror_nm_per_c: Value = 0.0
    reset_share: Annotated[float, Field(ge=0.5, le=2.0)] = 0.6
    stroke_v: AboveZero = 60.0
    stroke_noise_v: NonNegative = 0.02
    null_dph_per_ppm: Value = 1e-4
    null_growth_per_c: Value = 0.0
    stroke_dph: Value = 5e-4

    @model_validator(mode="after")
    def _check(self) -> Laser:
        if self.gain_ppm <= self.loss_ppm:
            raise ValueError("gain_ppm is not above loss_ppm, so that no light oscillates; raise it, or lower the loss")
        return self


class Chamber(_Strict):
    """The chamber's air and how well it follows its programme."""

    lag_s: AboveZero = 120.0
    damping: Annotated[float, Field(ge=0.2, le=2.0)] = 0.7
    ripple_c: NonNegative = 0.2
    ripple_s: AboveZero = 180.0
    setpoint_sigma_c: NonNegative = 0.1
    max_c_per_min: AboveZero = 10.0


class Node(_Strict):
    """One node of the instrument's thermal network."""

    heat_capacity_j_per_k: AboveZero
    power_w: NonNegative = 0.0
    to_air_w_per_k: NonNegative = 0.0
    to: dict[str, AboveZero] = {}


def _default_nodes() -> dict[str, Node]:
    """Return a network that heats the block by 8 K; the cavity follows it in 20 s, the gas is 30 K warmer."""
    return {
        "case": Node(heat_capacity_j_per_k=1500.0, power_w=14.75, to_air_w_per_k=2.5, to={"block": 1.0}),
        "block": Node(heat_capacity_j_per_k=800.0, to={"cavity": 3.0}),
        "cavity": Node(heat_capacity_j_per_k=60.0, to={"gas": 0.05}),
        "gas": Node(heat_capacity_j_per_k=0.5, power_w=1.5),
    }


class Gyro(_Strict):
    """The instrument: serial number (`{seed}` is filled in), range of its bias, thermal network."""

    serial: Annotated[str, Field(pattern=r"^[A-Za-z0-9._{}-]{1,56}$")] = "SIM-{seed}"
    bias_dph: tuple[Value, Value] = (5.8e-3, 8.5e-3)
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
        if lonely := known - self._joined():
            raise ValueError(f"no heat goes from {sorted(lonely)} to the air")
        return self

    def _joined(self) -> set[str]:
        """Return the nodes from which a chain of conductances leads to the air."""
        joined = {name for name, node in self.node.items() if node.to_air_w_per_k > 0.0}
        links = [(name, other) for name, node in self.node.items() for other in node.to]
        for _ in self.node:
            joined |= {a for a, b in links if b in joined} | {b for a, b in links if a in joined}
        return joined


class Sensor(_Strict):
    """The temperature sensor that the product carries: read once a second."""

    node: str = "block"
    lag_s: NonNegative = 10.0
    noise_c: NonNegative = 0.01
    resolution_c: NonNegative = 0.01
    offset_c: Annotated[float, Field(ge=-10.0, le=10.0)] = 0.0


class NoiseLevels(_Strict):
    """Noise of the rate; the first four in the terms of IEEE Std 647, annex C."""

    arw_deg_per_sqrt_h: NonNegative = 0.0
    bias_instability_dph: NonNegative = 0.0
    rate_random_walk_dph_per_sqrt_h: NonNegative = 0.0
    quantum_arcsec: NonNegative = 0.0
    arw_growth_per_c: Value = 0.0
    arw_growth_per_c_per_min: NonNegative = 0.0
    outliers_per_h: NonNegative = 0.0
    outlier_arcsec: NonNegative = 0.2


class Channel(_Strict):
    """A recorded auxiliary channel."""

    name: Identifier
    level: Value = 0.0
    per_air_c: Value = 0.0
    wander_sigma: NonNegative = 0.0
    wander_tau_s: AboveZero = 1800.0
    steps_per_h: NonNegative = 0.0
    step_sigma: NonNegative = 0.0
    noise: NonNegative = 0.0


class ScenarioCause(BaseModel):
    """A cause of the catalogue that acts: its id, its parameters, and the channel that it follows if it needs one."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    id: str
    channel: str | None = None
    __pydantic_extra__: dict[str, Value] = Field(init=False)

    @model_validator(mode="after")
    def _check(self) -> ScenarioCause:
        if self.id not in CATALOGUE:
            raise ValueError(f"no cause {self.id!r}; there are {', '.join(CATALOGUE)}")
        term = CATALOGUE[self.id]
        known = {parameter.name: parameter for parameter in term.parameters}
        if unknown := set(self.__pydantic_extra__) - set(known):
            raise ValueError(f"{self.id} has no {sorted(unknown)}; it has {', '.join(known)}")
        needed = {name for name, parameter in known.items() if parameter.default is None}
        spared = set(term.table.optional) if term.table is not None else set()
        if missing := needed - spared - set(self.__pydantic_extra__):
            raise ValueError(f"{self.id} needs {sorted(missing)}")
        if term.needs.channel != (self.channel is not None):
            raise ValueError(f"{self.id} {'needs a' if term.needs.channel else 'has no'} channel")
        return self

    def values(self) -> dict[str, float]:
        """Return all parameters, defaults filled in."""
        defaults = {p.name: p.default for p in CATALOGUE[self.id].parameters if p.default is not None}
        return {**defaults, **self.__pydantic_extra__}


class Profile(_Strict):
    """One chamber programme; power-on and the recorded part are in minutes from its start."""

    start_c: ChamberCelsius
    power_on_min: Minutes = 0.0
    record_from_min: Minutes = 0.0
    record_min: Annotated[Minutes, Field(ge=1.0)]
    steps: Annotated[list[Step], Field(min_length=1)]


class RunSet(_Strict):
    """Profiles that are run one after the other, every `every_h` hours."""

    role: Literal["train", "exam"] = "train"
    started: Instant
    every_h: AboveZero = 24.0
    profiles: Annotated[list[str], Field(min_length=1)]

    @model_validator(mode="after")
    def _check(self) -> RunSet:
        last_s = self.started.timestamp() + 3600.0 * self.every_h * (len(self.profiles) - 1)
        if last_s > datetime.now(timezone.utc).timestamp() + 86400.0:
            raise ValueError("started, every_h: the last run starts after today; start earlier or wait less")
        return self


class Scenario(_Strict):
    """A whole campaign."""

    title: str
    gyro: Gyro = Field(default_factory=Gyro)
    chamber: Chamber = Field(default_factory=Chamber)
    sensor: Sensor = Field(default_factory=Sensor)
    noise: NoiseLevels = Field(default_factory=NoiseLevels)
    thermometer: list[Thermometer] = []
    difference: list[NodeDifference] = []
    laser: Laser | None = None
    channel: list[Channel] = []
    cause: list[ScenarioCause] = []
    profile: Annotated[dict[str, Profile], Field(min_length=1)]
    set: Annotated[list[RunSet], Field(min_length=1)]

    @model_validator(mode="after")
    def _check(self) -> Scenario:
        for index, run_set in enumerate(self.set):
            if unknown := [name for name in run_set.profiles if name not in self.profile]:
                raise ValueError(f"set {index + 1} runs {unknown}, which are no profiles")
        for place, node in self._places():
            if node not in self.gyro.node:
                raise ValueError(f"{place} {node!r} is no node of the gyro")
        channels = [channel.name for channel in self.channel]
        columns = self.columns()
        if len(set(columns)) < len(columns) or _OWN_COLUMNS & set(columns):
            raise ValueError(f"names of channels {columns} repeat, or are columns of every recording")
        for cause in self.cause:
            if cause.channel is not None and cause.channel not in channels:
                raise ValueError(f"{cause.id} follows {cause.channel!r}, which is no channel")
        return self

    def columns(self) -> list[str]:
        """Return the names of the recorded columns: thermometers, signals of the laser, auxiliary channels."""
        of_laser = [self.laser.intensity, self.laser.path_voltage] if self.laser else []
        return [t.name for t in self.thermometer] + of_laser + [channel.name for channel in self.channel]

    def _places(self) -> list[tuple[str, str]]:
        """List each place that names a node, with the name."""
        named = [("sensor.node", self.sensor.node)]
        named += [(f"node of thermometer {t.name}", t.node) for t in self.thermometer]
        named += [("node of a difference", n) for d in self.difference for n in (d.node, d.against)]
        if self.laser:
            laser = self.laser
            named += [("a node of the laser", n) for n in (laser.mirror_node, laser.gas_node, laser.path_node)]
        return named


def names() -> list[str]:
    """Return the names of the scenarios that come with gyrotc."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def read(scenario: str | Path) -> tuple[str, Scenario]:
    """Read a scenario by name, or from a file.

    With `extends = "name"` a file begins from another scenario: tables are merged key by key, other values replaced.

    Returns:
        Name (stem of the file) and checked scenario.

    Raises:
        InputError: There is no such scenario or file, it is no TOML, or a key or value is not valid.
    """
    where = _place(scenario)
    try:
        checked = Scenario.model_validate(_content(where, ()))
    except ValidationError as error:
        raise refused(error, lambda field: f"{where}, field {field}" if field else str(where), Scenario) from error
    refuse_above("runs", sum(len(run_set.profiles) for run_set in checked.set), str(where), "runs")
    return where.stem, checked


def _place(scenario: str | Path) -> Path:
    packaged = _FOLDER / f"{scenario}.toml"
    return packaged if str(scenario) in names() else Path(scenario)


def _content(where: Path, below: tuple[Path, ...]) -> dict[str, Any]:
    expected = f"a TOML file or one of: {', '.join(names())}"
    try:
        content = read_toml(where, expected)
    except InputError as error:
        found = "no such scenario" if error.found == "does not exist" else error.found
        raise InputError(error.where, found, error.expected) from error
    if "extends" not in content:
        return content
    ground = _place(str(content.pop("extends")))
    if ground in below:
        raise InputError(str(where), f"extends {ground.stem}, which extends it")
    return _merged(_content(ground, (*below, where)), content)


def _merged(ground: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Merge tables key by key and replace anything else."""
    merged = dict(ground)
    for key, value in over.items():
        both = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = _merged(merged[key], value) if both else value
    return merged
