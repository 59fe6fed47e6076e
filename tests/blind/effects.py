"""Bias mechanisms at 1 s, written for the test alone: maps, memories, hysteresis, clocks, foreign ones.

A mechanism takes a `Scene` (the runs of a campaign) and a random generator and returns, per run, the
effect in deg/h at one second for amplitude 1, and its true parameters. Effects of the map (lag,
misalignment) return the difference to the map without them; they scale with the map's contrast.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from .chamber import Exposure

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Map:
    """Static bias of temperature and its rate (C/min): a spline or a rational curve, and a rate term."""

    curve: Callable[[Array], Array]
    tilt: Callable[[Array], Array]

    def __call__(self, t: Array, r: Array) -> Array:
        return self.curve(t) + self.tilt(t) * r / (1.0 + 0.08 * np.abs(r))


def draw_map(rng: np.random.Generator) -> Map:
    """Contrast of about 1.5e-3 deg/h over -45..75 C, smooth; no Gaussians in it."""
    if rng.uniform() < 0.5:
        knots = np.linspace(-60, 90, 7)
        curve: Callable[[Array], Array] = CubicSpline(knots, rng.normal(0, 0.7e-3, 7))
    else:
        a, b, c, d = rng.uniform(-1.2, 1.2, 4) * 1e-3
        w = rng.uniform(35, 70)

        def curve(t: Array) -> Array:
            x = (t - 15.0) / w
            return np.asarray((a + b * x + c * x * x + 0.4 * d * x**3) / (1.0 + 0.35 * x * x))

    g0, g1 = rng.uniform(-1.5, 1.5, 2) * 1e-4
    return Map(curve, lambda t: np.asarray(g0 + g1 * np.tanh((t - 20.0) / 45.0)))


@dataclass
class Scene:
    """What a mechanism may look at."""

    runs: list[Exposure]
    days: list[float]
    map: Map
    channels: dict[str, list[Array]] = field(default_factory=dict)

    def rates(self) -> list[Array]:
        return [np.gradient(x.block_c) * 60.0 for x in self.runs]


Effect = tuple[list[Array], dict[str, float]]
Mechanism = Callable[[Scene, np.random.Generator], Effect]


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def follow(t: Array, tau: float, start: float | None = None) -> Array:
    """First-order lag by Heun's rule, 1 s."""
    out = np.empty_like(t)
    z = float(t[0] if start is None else start)
    step = 1.0 / tau
    for k, (now, then) in enumerate(zip(t.tolist(), [*t[1:].tolist(), float(t[-1])], strict=True)):
        out[k] = z
        slope = (now - z) * step
        z += 0.5 * (slope + (then - z - slope) * step)
    return out


def backlash(t: Array, width: float) -> Array:
    """Play of half-width `width`, found from turning points: the shaft moves only when pushed."""
    out = np.empty_like(t)
    shaft = float(t[0])
    for k, x in enumerate(t.tolist()):
        gap = x - shaft
        if gap > width:
            shaft += gap - width
        elif gap < -width:
            shaft += gap + width
        out[k] = shaft
    return out


def cavity_lag(scene: Scene, rng: np.random.Generator) -> Effect:
    tau = log_uniform(rng, 150, 1500)
    out = []
    for run, rate in zip(scene.runs, scene.rates(), strict=True):
        z = follow(run.block_c, tau)
        out.append(scene.map(z, (run.block_c - z) / tau * 60.0) - scene.map(run.block_c, rate))
    return out, {"tau_s": tau}


def thermal_gradient(scene: Scene, rng: np.random.Generator) -> Effect:
    tau = log_uniform(rng, 250, 2500)
    return [follow(r.block_c, tau) - r.block_c for r in scene.runs], {"tau_s": tau}


def time_misalignment(scene: Scene, rng: np.random.Generator) -> Effect:
    """The recorded temperature comes late (shift > 0): the bias knows T earlier than the record does."""
    shift = round(log_uniform(rng, 200, 550)) * int(rng.choice([-1, 1]))
    out = []
    for run in scene.runs:
        long = np.concatenate([run.before_c, run.block_c, run.after_c])
        rate = np.gradient(long) * 60.0
        n, m = run.before_c.size, run.block_c.size
        moved = slice(n + shift, n + shift + m)
        out.append(scene.map(long[moved], rate[moved]) - scene.map(long[n : n + m], rate[n : n + m]))
    return out, {"shift_s": float(shift)}


def hysteresis(scene: Scene, rng: np.random.Generator) -> Effect:
    width = log_uniform(rng, 2, 18)
    return [backlash(r.block_c, width) - r.block_c for r in scene.runs], {"width_c": width}


def warm_up(scene: Scene, rng: np.random.Generator) -> Effect:
    tau = log_uniform(rng, 500, 4000)
    out = [np.exp(-(np.arange(r.block_c.size) + r.lead_s) / tau) for r in scene.runs]
    return out, {"tau_s": tau}


def turn_on_offset(scene: Scene, rng: np.random.Generator) -> Effect:
    return [np.full(r.block_c.size, rng.normal()) for r in scene.runs], {}


def ageing(scene: Scene, rng: np.random.Generator) -> Effect:
    base = min(scene.days)
    days = [np.full(r.block_c.size, d - base) for r, d in zip(scene.runs, scene.days, strict=True)]
    return days, {}


def power_on_temperature(scene: Scene, rng: np.random.Generator) -> Effect:
    """What the block had at power-on, or ten minutes before the first row, decides over the whole run."""
    return [np.full(r.block_c.size, float(r.before_c[0]) - 20.0) for r in scene.runs], {}


def path_length_periodicity(scene: Scene, rng: np.random.Generator) -> Effect:
    period, phase = log_uniform(rng, 5, 20), rng.uniform(0, 2 * np.pi)
    return [np.sin(2 * np.pi * r.block_c / period + phase) for r in scene.runs], {"period_c": period}


def map_too_coarse(scene: Scene, rng: np.random.Generator) -> Effect:
    """Narrow features of the static map: three resonance-like bumps."""
    at, wide = rng.uniform(-35, 60, 3), rng.uniform(1.5, 3.5, 3)
    size = rng.choice([-1.0, 1.0], 3) * rng.uniform(0.5, 1.0, 3)
    return [
        sum(s / (1.0 + ((r.block_c - a) / w) ** 2) ** 2 for a, w, s in zip(at, wide, size, strict=True))
        for r in scene.runs
    ], {}


def auxiliary(scene: Scene, rng: np.random.Generator) -> Effect:
    return [np.asarray(c - 5.0) for c in scene.channels["supply_v"]], {}


CATALOGUE: dict[str, Mechanism] = {
    "cavity_lag": cavity_lag,
    "thermal_gradient": thermal_gradient,
    "time_misalignment": time_misalignment,
    "hysteresis": hysteresis,
    "warm_up": warm_up,
    "turn_on_offset": turn_on_offset,
    "ageing": ageing,
    "power_on_temperature": power_on_temperature,
    "path_length_periodicity": path_length_periodicity,
    "map_too_coarse": map_too_coarse,
    "auxiliary": auxiliary,
}

FAMILY = {
    "cavity_lag": "thermal_memory",
    "thermal_gradient": "thermal_memory",
    "time_misalignment": "thermal_memory",
    "hysteresis": "hysteresis",
    "warm_up": "power_on",
    "turn_on_offset": "between_runs",
    "ageing": "between_runs",
    "power_on_temperature": "between_runs",
    "path_length_periodicity": "static_map",
    "map_too_coarse": "static_map",
    "auxiliary": "auxiliary",
}


# Foreign mechanisms: none of them is in the catalogue. -------------------------------------------------


def relay_texture(scene: Scene, rng: np.random.Generator) -> Effect:
    """A two-state relay in temperature that multiplies a fine texture."""
    up, gap, period = rng.uniform(5, 40), rng.uniform(8, 25), rng.uniform(9, 18)
    out = []
    for run in scene.runs:
        state, trace = 0.0, np.empty_like(run.block_c)
        for k, x in enumerate(run.block_c.tolist()):
            state = 1.0 if x > up else 0.0 if x < up - gap else state
            trace[k] = state
        out.append(trace * np.sin(2 * np.pi * run.block_c / period))
    return out, {}


def creep(scene: Scene, rng: np.random.Generator) -> Effect:
    """Logarithmic creep after each reversal of the temperature's direction."""
    grain = rng.uniform(100, 400)
    out = []
    for run in scene.runs:
        rate = np.sign(np.gradient(run.block_c)) * (np.abs(np.gradient(run.block_c)) > 3e-4)
        since, sign, trace = 0.0, 0.0, np.empty_like(run.block_c)
        for k, s in enumerate(rate.tolist()):
            if s not in (0.0, sign):
                sign, since = s, 0.0
            since += 1.0
            trace[k] = sign * np.log1p(since / grain)
        out.append(trace)
    return out, {}


def asymmetric_lag(scene: Scene, rng: np.random.Generator) -> Effect:
    """A second node that warms quickly and cools slowly."""
    fast = log_uniform(rng, 200, 600)
    slow = fast * rng.uniform(4, 8)
    out = []
    for run in scene.runs:
        z, trace = float(run.block_c[0]), np.empty_like(run.block_c)
        for k, x in enumerate(run.block_c.tolist()):
            z += (x - z) / (fast if x > z else slow)
            trace[k] = z - x
        out.append(trace)
    return out, {}


def node_product(scene: Scene, rng: np.random.Generator) -> Effect:
    """Product of the temperature and a late second node: no single linear memory."""
    tau = log_uniform(rng, 300, 1500)
    period = rng.uniform(25, 45)
    return [np.sin(2 * np.pi * r.block_c / period) * np.abs(follow(r.block_c, tau) - r.block_c) for r in scene.runs], {}


def dead_zone(scene: Scene, rng: np.random.Generator) -> Effect:
    """A gradient that acts only beyond a threshold."""
    tau, edge = log_uniform(rng, 500, 2000), rng.uniform(4, 10)
    out = []
    for run in scene.runs:
        d = follow(run.block_c, tau) - run.block_c
        out.append(np.sign(d) * np.maximum(np.abs(d) - edge, 0.0) ** 2)
    return out, {}


def peak_memory(scene: Scene, rng: np.random.Generator) -> Effect:
    """The bias keeps a trace of the highest temperature since power-on, which fades."""
    fade = log_uniform(rng, 4000, 15000)
    out = []
    for run in scene.runs:
        peak, trace = float(run.block_c[0]), np.empty_like(run.block_c)
        for k, x in enumerate(run.block_c.tolist()):
            peak = max(x, peak - (peak - x) / fade)
            trace[k] = peak - x
        out.append(np.sqrt(np.maximum(trace, 0.0)))
    return out, {}


def rate_heating(scene: Scene, rng: np.random.Generator) -> Effect:
    """Friction: the square of dT/dt, smoothed, whatever its sign."""
    tau = log_uniform(rng, 600, 2500)
    return [follow(r**2, tau, 0.0) for r in scene.rates()], {}


def thermometer_drift(scene: Scene, rng: np.random.Generator) -> Effect:
    """The thermometer drifts within each run at random: the map is read at the wrong place."""
    out = []
    for run, rate in zip(scene.runs, scene.rates(), strict=True):
        n = run.block_c.size
        drift = np.interp(np.arange(n), np.linspace(0, n, 6), rng.normal(0, 3.0, 6))
        out.append(scene.map(run.block_c + drift, rate) - scene.map(run.block_c, rate))
    return out, {}


def telegraph(scene: Scene, rng: np.random.Generator) -> Effect:
    mean = log_uniform(rng, 900, 4000)
    out = []
    for run in scene.runs:
        flips = rng.uniform(size=run.block_c.size) < 1.0 / mean
        out.append(np.where(np.cumsum(flips) % 2 == 0, 1.0, -1.0))
    return out, {}


def pulses(scene: Scene, rng: np.random.Generator) -> Effect:
    out = []
    for run in scene.runs:
        trace = np.zeros_like(run.block_c)
        for at in rng.integers(0, trace.size, 4):
            trace[at : at + int(rng.uniform(300, 1500))] += rng.choice([-1.0, 1.0])
        out.append(trace)
    return out, {}


def room_cycle(scene: Scene, rng: np.random.Generator) -> Effect:
    """An unrecorded sinusoid in time, of another phase in every run."""
    period = log_uniform(rng, 1500, 8000)
    return [np.sin(2 * np.pi * np.arange(r.block_c.size) / period + rng.uniform(0, 2 * np.pi)) for r in scene.runs], {}


def stick_slip(scene: Scene, rng: np.random.Generator) -> Effect:
    """A stress that grows with the temperature and is released in a jump: a sawtooth without a fixed place."""
    hold = rng.uniform(6, 16)
    out = []
    for run in scene.runs:
        free, trace = float(run.block_c[0]), np.empty_like(run.block_c)
        for k, x in enumerate(run.block_c.tolist()):
            free = x if abs(x - free) > hold else free
            trace[k] = x - free
        out.append(trace)
    return out, {}


def saturating_memory(scene: Scene, rng: np.random.Generator) -> Effect:
    """A gradient whose effect saturates: the sign of a ramp, hardly its size."""
    tau, edge = log_uniform(rng, 900, 3000), rng.uniform(1.0, 4.0)
    return [np.tanh((follow(r.block_c, tau) - r.block_c) / edge) for r in scene.runs], {}


def ringing(scene: Scene, rng: np.random.Generator) -> Effect:
    """A badly damped second-order answer to dT/dt: it rings after every corner of the profile."""
    omega, damping = 2 * np.pi / log_uniform(rng, 1200, 3600), rng.uniform(0.08, 0.25)
    out = []
    for run, rate in zip(scene.runs, scene.rates(), strict=True):
        y, v, trace = float(rate[0]), 0.0, np.empty_like(run.block_c)
        for k, x in enumerate(rate.tolist()):
            v += omega * omega * (x - y) - 2 * damping * omega * v
            y += v
            trace[k] = y - x
        out.append(trace)
    return out, {}


def dose(scene: Scene, rng: np.random.Generator) -> Effect:
    """What heat has done since power-on: the integral of an activated rate, which never goes back."""
    per_c = rng.uniform(0.05, 0.1)
    return [np.cumsum(np.exp(per_c * (r.block_c - 60.0))) / 3600.0 for r in scene.runs], {}


FOREIGN: dict[str, Mechanism] = {
    "relay_texture": relay_texture,
    "creep": creep,
    "asymmetric_lag": asymmetric_lag,
    "node_product": node_product,
    "dead_zone": dead_zone,
    "peak_memory": peak_memory,
    "rate_heating": rate_heating,
    "thermometer_drift": thermometer_drift,
    "stick_slip": stick_slip,
    "saturating_memory": saturating_memory,
    "ringing": ringing,
    "dose": dose,
}
FOREIGN_RANDOM: dict[str, Mechanism] = {"telegraph": telegraph, "pulses": pulses, "room_cycle": room_cycle}
