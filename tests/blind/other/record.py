"""One recording: a gyro, its chamber and its noise, drawn anew for each, and the folder that a user would have."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np

from . import noise as noises
from .grammar import draw_kind
from .heat import STEP_S, Array, Heat, draw_body, programme, run_heat
from .mechanisms import CATALOGUE, OF_MAP, Scene, draw_map, rate_of
from .noise import PowerLaw
from .yardstick import Yardstick

IMITATED = 0.5
"""Share of a foreign effect that no single cause of the catalogue may imitate."""

_LEFT = 0.02  # share that the static map must leave of an effect: what it holds nobody can see
_STEEPEST = 20.0  # contrast of the map: steeper ones no gyro has
_TRIES = 40
_EPOCH = datetime(2026, 5, 4, 7, tzinfo=timezone.utc)


@dataclass
class Truth:
    """What is hidden in one recording."""

    stratum: str
    name: str = ""
    k: float = 0.0
    beyond: bool = False
    kind: str = ""
    imitated: float = 0.0
    row_s: int = 10
    declared: str = "right"
    alpha: float = 1.0


@dataclass
class Recording:
    """Rows of every run: temperature, rate, supply, at `truth.row_s`."""

    truth: Truth
    tables: list[Array]
    roles: list[str]
    day: list[float]
    on_s: list[float]
    sheet: dict[str, float] = field(default_factory=dict)


def draw_recording(seed: int, number: int, stratum: str, name: str, *, hours: float = 5.0) -> Recording:
    """The number-th recording of a run, from its seed alone."""
    rng = np.random.default_rng([seed, 90, number])
    scene, lead, roles = _scene(rng, hours)
    level = noises.draw_noise(rng)
    truth = Truth(stratum, name, alpha=level.alpha)
    truth.row_s = int(rng.choice([1, 10, 10, 60]))
    train = [k for k, role in enumerate(roles) if role == "train"]
    extra, contrast = _hidden(truth, scene, Yardstick(scene, train, level), rng)
    tables = []
    offset = float(rng.uniform(-0.02, 0.02))
    bits = _Bits(rng, level)
    for k, h in enumerate(scene.heat):
        bias = offset + contrast * scene.map(h.sensor, rate_of(h.sensor)) + extra[k]
        tables.append(_rows(h, bias, scene.supply[k], level, truth.row_s, bits, rng))
    truth.declared = str(rng.choice(["right", "right", "none", "wrong", "wrong", "wrong"]))
    return Recording(truth, tables, roles, scene.day, lead, _sheet(truth, level, rng))


def _scene(rng: np.random.Generator, hours: float) -> tuple[Scene, list[float], list[str]]:
    """A campaign of temperatures of its own: five or six training runs and one for the exam."""
    body = draw_body(rng)
    count = int(rng.integers(5, 7))
    drawn = [programme(rng, hours * float(rng.uniform(0.8, 1.2))) for _ in range(count)]
    drawn.append(programme(rng, 0.6 * hours))
    again = int(rng.integers(2**31))

    def heat(lit: bool) -> list[Heat]:
        same = np.random.default_rng(again)
        return [run_heat(body, command, lead, same, lit=lit) for command, lead in drawn]

    runs = heat(True)
    day = np.cumsum(rng.uniform(0.6, 9.0, len(runs))).tolist()
    scene = Scene(runs, lambda: heat(False), day, draw_map(rng), [_supply(h, rng) for h in runs])
    return scene, [lead for _, lead in drawn], ["train"] * count + ["exam"]


def _supply(h: Heat, rng: np.random.Generator) -> Array:
    """Wanders on its own, and a little with the load of the chamber beside it."""
    knots = rng.normal(0.0, 0.08, h.sensor.size // 300 + 3)
    slow = np.interp(np.arange(h.sensor.size), np.arange(knots.size) * 300.0, knots)
    return np.asarray(12.0 + slow + 0.02 * np.sign(np.gradient(h.air)) + rng.normal(0, 0.004, h.sensor.size))


def _hidden(truth: Truth, scene: Scene, yardstick: Yardstick, rng: np.random.Generator) -> tuple[list[Array], float]:
    """What is added to the map, for each run at `STEP_S`, deg/h, and the map's own contrast."""
    nothing = [np.zeros(h.sensor.size) for h in scene.heat]
    if truth.stratum == "clean":
        return nothing, 1.0
    truth.k = float(np.exp(rng.uniform(np.log(1.5), np.log(6.0))))
    for _ in range(_TRIES):
        if truth.stratum == "foreign":
            kind = draw_kind(scene.heat, rng)
            shape, truth.kind = kind.values, kind.text
        else:
            shape, truth.beyond = CATALOGUE[truth.name](scene, rng)
        rest, left = yardstick.seen(shape)
        d = float(np.linalg.norm(rest))
        size = 6.0 * truth.k / max(d, 1e-300)
        if truth.name in OF_MAP:
            if size <= _STEEPEST:
                return [size * s for s in shape], size
            scene.map = draw_map(rng)
            continue
        far = truth.stratum == "foreign" and left >= _LEFT
        truth.imitated = yardstick.imitated([size * s for s in shape]) if far else 0.0
        if truth.stratum != "foreign" or (left >= _LEFT and truth.imitated <= IMITATED):
            size *= float(rng.choice([-1.0, 1.0]))
            return [size * s for s in shape], 1.0
    truth.stratum, truth.name, truth.k, truth.kind = "not drawn", "", 0.0, ""
    return nothing, 1.0


@dataclass(frozen=True)
class _Bits:
    """Resolution of the converters: angle in arcsec, temperature in C (the ADC and its reference noise)."""

    angle: float
    temperature: float

    def __init__(self, rng: np.random.Generator, level: PowerLaw) -> None:
        object.__setattr__(self, "angle", level.white_dph * 10.0 * float(rng.uniform(0.05, 2.0)))
        object.__setattr__(self, "temperature", float(rng.choice([0.001, 0.004, 0.0156, 0.0625])))


def _rows(
    h: Heat, bias: Array, supply: Array, level: PowerLaw, row_s: int, bits: _Bits, rng: np.random.Generator
) -> Array:
    """Columns time, temperature, rate, supply: means over a row of what converters gave each second."""
    seconds = round(h.sensor.size * STEP_S) // row_s * row_s
    at, nodes = np.arange(seconds) + 0.5, np.arange(h.sensor.size) * STEP_S
    t = np.interp(at, nodes, h.sensor) + rng.normal(0.0, 0.4 * bits.temperature + 0.002, seconds)
    t = np.round(t / bits.temperature) * bits.temperature
    rate = np.interp(at, nodes, bias) + noises.draw(level, seconds, rng)
    angle = np.r_[0.0, np.cumsum(rate)]  # 1 deg/h is 1 arcsec/s
    rate = np.diff(np.floor(angle / bits.angle + rng.uniform()) * bits.angle)
    columns = [t, rate, np.interp(at, nodes, supply)]
    means = [c.reshape(-1, row_s).mean(axis=1) for c in columns]
    return np.column_stack([(np.arange(means[0].size) + 1.0) * row_s, *means])


def _sheet(truth: Truth, level: PowerLaw, rng: np.random.Generator) -> dict[str, float]:
    """What the data set declares: half are wrong, in level or without the slow part."""
    if truth.declared == "none":
        return {}
    sheet = level.sheet()
    if truth.declared == "wrong":
        sheet["arw_deg_per_sqrt_h"] *= float(np.exp(rng.uniform(np.log(1.3), np.log(2.5)))) ** float(
            rng.choice([-1, 1])
        )
        if rng.uniform() < 0.5:
            del sheet["bias_instability_dph"]
    return sheet


def write(recording: Recording, folder: Path, serial: str) -> None:
    """A dataset.toml and one CSV per run; no word of the truth."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["schema = 1", f"serial = {json.dumps(serial)}", 'earth_rate = "none"']
    if recording.sheet:
        lines += ["", "[noise]", *(f"{name} = {value!r}" for name, value in recording.sheet.items())]
    for k, table in enumerate(recording.tables):
        name = f"run-{k + 1:02d}.csv"
        started = (_EPOCH + timedelta(days=recording.day[k])).isoformat()
        lines += ["", "[[run]]", f'file = "{name}"', f'role = "{recording.roles[k]}"']
        lines += [f'environment = "programme {k + 1}"', f"started = {started}"]
        lines += [f"power_on_s = {-recording.on_s[k]!r}"]
        np.savetxt(
            folder / name,
            table,
            fmt=["%.0f", "%.5f", "%.9f", "%.5f"],
            delimiter=",",
            header="time_s,temperature_c,rate_dph,supply_v",
            comments="",
        )
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def reported(truth: Truth) -> dict[str, Any]:
    """The truth for a row of results."""
    return {**vars(truth)}
