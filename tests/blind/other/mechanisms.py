"""What the tool has names for, made by other physics: volumes of heat, relays, an etalon, leaking helium.

A mechanism takes a `Scene` and gives, for each run, its bias at `STEP_S` for amplitude 1, deg/h, and whether its
parameter lies beyond what the tool looks through. No parameter of the tool is known to be exact here: heat has many
time constants, relays many widths.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .heat import STEP_S, Array, Heat

_RELAYS = 300


@dataclass(frozen=True)
class Map:
    """Static bias of the sensor's temperature (C) and its rate (C/min): activated and saturating parts, no spline."""

    weights: Array
    places: Array
    widths: Array
    flow: float
    flow_c: float

    def __call__(self, t: Array, r: Array) -> Array:
        x = (t[:, None] - self.places) / self.widths
        return np.arctan(x) @ self.weights + self.flow * r / np.sqrt(1.0 + (r / 6.0) ** 2) * (1.0 + t / self.flow_c)


def draw_map(rng: np.random.Generator) -> Map:
    """Smooth over -45 ... 75 C: nothing in it is narrower than 25 C."""
    return Map(
        rng.normal(0.0, 8e-4, 5),
        rng.uniform(-60.0, 90.0, 5),
        rng.uniform(25.0, 60.0, 5),
        float(rng.uniform(-1.5, 1.5)) * 1e-4,
        float(rng.uniform(150.0, 400.0)),
    )


@dataclass
class Scene:
    """What a mechanism may look at.

    Attributes:
        heat: Every run.
        dark: The same runs without a discharge (made on demand).
        day: Date of each.
        map: The static map.
        supply: A recorded channel at `STEP_S`, V.
    """

    heat: list[Heat]
    dark: Callable[[], list[Heat]]
    day: list[float]
    map: Map
    supply: list[Array] = field(default_factory=list)


Effect = tuple[list[Array], bool]
Mechanism = Callable[[Scene, np.random.Generator], Effect]


def rate_of(t: Array) -> Array:
    """C/min."""
    return np.asarray(np.gradient(t) * 60.0 / STEP_S)


def gradient(scene: Scene, rng: np.random.Generator) -> Effect:
    """Gas flows from the warm to the cold end: the mirror's temperature less the sensor's."""
    shape = [h.mirror - h.sensor for h in scene.heat]
    return shape, not 60.0 < _delay_of(scene, "mirror") < 4000.0


def cavity(scene: Scene, rng: np.random.Generator) -> Effect:
    """The map knows the middle of the block, the thermometer its edge."""
    out = []
    for h in scene.heat:
        seen = scene.map(h.mirror, rate_of(h.mirror))
        out.append(seen - scene.map(h.sensor, rate_of(h.sensor)))
    return out, not 60.0 < _delay_of(scene, "mirror") < 4000.0


def _delay_of(scene: Scene, part: str) -> float:
    """Delay of a part behind the sensor that explains its lead best on the steepest ramps, s."""
    top = max(scene.heat, key=lambda h: float(np.abs(rate_of(h.sensor)).max()))
    rate = rate_of(top.sensor) / 60.0
    lead = top.sensor - getattr(top, part)
    return float((lead @ rate) / max(rate @ rate, 1e-12))


def late_record(scene: Scene, rng: np.random.Generator) -> Effect:
    """The recorder's queue: temperatures are stamped late or early, by up to half an hour."""
    shift = float(np.exp(rng.uniform(np.log(200), np.log(1800)))) * float(rng.choice([-1, 1]))
    out = []
    for h in scene.heat:
        t = h.sensor
        at = np.arange(t.size) * STEP_S
        true = np.interp(at + shift, at, t)
        out.append(scene.map(true, rate_of(true)) - scene.map(t, rate_of(t)))
    return out, abs(shift) > 1200.0


def relays(scene: Scene, rng: np.random.Generator) -> Effect:
    """Preisach: hundreds of domains, each with a place and a width of its own, flip with the sensor's temperature."""
    width = float(np.exp(rng.uniform(np.log(1.5), np.log(16.0))))
    place = rng.normal(15.0, 30.0, _RELAYS)
    half = width * np.exp(rng.normal(0.0, 0.5, _RELAYS))
    up, down = place + half, place - half
    out = []
    for h in scene.heat:
        state = np.where(h.sensor[0] > place, 1.0, -1.0)
        mean = np.empty(h.sensor.size)
        for k, t in enumerate(h.sensor.tolist()):
            state = np.where(t > up, 1.0, np.where(t < down, -1.0, state))
            mean[k] = state.mean()
        out.append(mean)
    return out, False


def switched_on(scene: Scene, rng: np.random.Generator) -> Effect:
    """The discharge heats the block from inside: what that adds between mirror and middle, which no sensor shows."""
    lit, dark = scene.heat, scene.dark()
    risen = [(a.deep - a.sensor) - (b.deep - b.sensor) for a, b in zip(lit, dark, strict=True)]
    settled = max(float(np.abs(r).max()) for r in risen) or 1.0
    slow = float(np.exp(rng.uniform(np.log(300), np.log(6000))))  # getter and gas, behind the heat
    return [
        np.exp(-((h.on_s / slow) ** 0.8)) + 0.3 * (1.0 - r / settled) for h, r in zip(lit, risen, strict=True)
    ], slow > 4000.0


def run_offsets(scene: Scene, rng: np.random.Generator) -> Effect:
    """A few mode numbers of the cavity: each power-on takes one of seven levels."""
    levels = rng.integers(-3, 4, len(scene.heat)).astype(float)
    levels[0] += 2.0 * (np.ptp(levels) == 0.0)
    return [np.full(h.sensor.size, v) for h, v in zip(scene.heat, levels, strict=True)], False


def leak(scene: Scene, rng: np.random.Generator) -> Effect:
    """Helium through glass: the bias follows a power of the days since the first run."""
    power = float(rng.uniform(0.6, 1.3))
    return [
        np.full(h.sensor.size, (d - scene.day[0]) ** power) for h, d in zip(scene.heat, scene.day, strict=True)
    ], False


def start(scene: Scene, rng: np.random.Generator) -> Effect:
    """The mode that the cavity locks to follows the length that it had when it was switched on, not quite in a line."""
    bend = float(rng.uniform(-0.003, 0.003))
    soaked = [h.soak_c - 20.0 for h in scene.heat]
    return [np.full(h.sensor.size, s + bend * s * s) for h, s in zip(scene.heat, soaked, strict=True)], False


def etalon(scene: Scene, rng: np.random.Generator) -> Effect:
    """Backscatter of a plate: Airy's function of temperature, no sine."""
    period = float(np.exp(rng.uniform(np.log(3.0), np.log(30.0))))
    finesse, phase = float(rng.uniform(0.3, 4.0)), float(rng.uniform(0, np.pi))
    return [
        1.0 / (1.0 + finesse * np.sin(np.pi * h.sensor / period + phase) ** 2) for h in scene.heat
    ], not 4.0 < period < 25.0


def kinks(scene: Scene, rng: np.random.Generator) -> Effect:
    """An adhesive's glass transition, a relay of the housing: two narrow steps of the static map."""
    at, wide, size = rng.uniform(-25, 55, 2), rng.uniform(1.0, 3.0, 2), rng.choice([-1.0, 1.0], 2)
    return [
        sum(s * np.tanh((h.sensor - a) / w) for a, w, s in zip(at, wide, size, strict=True)) for h in scene.heat
    ], False


def supply(scene: Scene, rng: np.random.Generator) -> Effect:
    """The discharge current, recorded as a voltage."""
    return [v - 12.0 for v in scene.supply], False


CATALOGUE: dict[str, Mechanism] = {
    "thermal_gradient": gradient,
    "cavity_lag": cavity,
    "time_misalignment": late_record,
    "hysteresis": relays,
    "warm_up": switched_on,
    "turn_on_offset": run_offsets,
    "ageing": leak,
    "power_on_temperature": start,
    "path_length_periodicity": etalon,
    "map_too_coarse": kinks,
    "auxiliary": supply,
}
"""By the name that the tool should give."""

OF_MAP = ("cavity_lag", "time_misalignment")
"""Their size is that of the map itself."""
