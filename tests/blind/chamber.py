"""Chamber programmes and the thermal nodes of a gyro, integrated second by second.

Nodes: chamber air (follows the programme late, overshoots, ripples), case, block. The block carries the
thermometer and is heated by the discharge from power-on. Explicit Euler with a step of 1 s; the fastest
time constant is above 60 s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
HOUR = 3600


@dataclass(frozen=True)
class Unit:
    """Thermal constants of one gyro (s, C), drawn anew for every campaign."""

    air_s: float
    case_s: float
    block_s: float
    heating_c: float
    heating_s: float
    ripple_c: float
    ripple_s: float


@dataclass(frozen=True)
class Exposure:
    """One run in the chamber, second by second from the first recorded row on.

    `block_c` is the true temperature at the thermometer; `before_c` and `after_c` are what it was in the
    ten minutes before and after the record. `lead_s` is the time from power-on to the first row.
    """

    name: str
    block_c: Array
    before_c: Array
    after_c: Array
    lead_s: float
    load: Array


def draw_unit(rng: np.random.Generator) -> Unit:
    """A gyro whose time constants lie around those of a glass block in a metal case."""
    return Unit(
        air_s=rng.uniform(90, 200),
        case_s=rng.uniform(450, 800),
        block_s=rng.uniform(600, 1100),
        heating_c=rng.uniform(5, 10),
        heating_s=rng.uniform(1800, 3000),
        ripple_c=rng.uniform(0.05, 0.3),
        ripple_s=rng.uniform(400, 900),
    )


def steps(start: float, legs: Sequence[tuple[float, float, float]], seconds: int) -> Array:
    """Programme from (rate C/min, target C, hold s) legs, repeated until `seconds` are filled."""
    out = np.empty(seconds)
    level, n = start, 0
    while n < seconds:
        for rate, target, hold in legs:
            per_s = rate / 60.0 * (1.0 if target > level else -1.0)
            moving = max(round(abs(target - level) / abs(per_s)), 1)
            ramp = np.linspace(level, target, moving + 1)[1:]
            leg = np.concatenate([ramp, np.full(round(hold), target)])[: seconds - n]
            out[n : n + leg.size] = leg
            n += leg.size
            level = target
            if n >= seconds:
                break
    return out


def expose(unit: Unit, name: str, programme: Array, soak_c: float, lead_s: int, rng: np.random.Generator) -> Exposure:
    """Runs one programme: soaked and dark until power-on, `lead_s` at the first temperature, then recorded."""
    extra = 600
    total = extra + lead_s + programme.size + extra
    command = np.concatenate([np.full(extra + lead_s, programme[0]), programme, np.full(extra, programme[-1])])
    phase = rng.uniform(0, 2 * np.pi)
    ripple = unit.ripple_c * np.sin(2 * np.pi * np.arange(total) / unit.ripple_s + phase)
    air = case = block = soak_c
    warm = 0.0
    trace = np.empty(total)
    load = np.empty(total)
    for k in range(total):
        load[k] = command[k] - air
        air += (command[k] + ripple[k] - air) / unit.air_s
        case += (air - case) / unit.case_s
        warm += ((unit.heating_c if k >= extra else 0.0) - warm) / unit.heating_s
        block += (case + warm - block) / unit.block_s
        trace[k] = block
    first, last = extra + lead_s, extra + lead_s + programme.size
    return Exposure(
        name, trace[first:last], trace[first - extra : first], trace[last:], float(lead_s), load[first:last]
    )


def paper_programmes(rng: np.random.Generator, hours: float) -> list[tuple[str, Array, float, int]]:
    """Six environments as in the paper, jittered: three held temperatures, three ramp rates."""
    seconds = round(hours * HOUR)
    runs = []
    for name, level in (("20 C", 20.0), ("-40 C", -40.0), ("60 C", 60.0)):
        at = level + rng.uniform(-2, 2)
        runs.append((name, np.full(seconds, at), at, HOUR))
    for rate in (1.0, 3.0, 5.0):
        speed = rate * rng.uniform(0.92, 1.08)
        high, low, hold = 60 + rng.uniform(-3, 3), -40 + rng.uniform(-3, 3), rng.uniform(1.6, 2.2) * HOUR
        start = rng.uniform(-3, 3)
        legs = [(speed, high, hold), (speed, low, hold)]
        runs.append((f"ramp {rate:g} C/min", steps(start, legs, seconds), start, 0))
    return runs


def separating_programmes(rng: np.random.Generator, hours: float) -> list[tuple[str, Array, float, int]]:
    """Holds from both sides, mixed rates, nested loops and cold starts, in the same hours."""
    seconds = round(hours * HOUR)
    runs: list[tuple[str, Array, float, int]] = []
    for level in (20.0, -20.0):
        at = level + rng.uniform(-3, 3)
        runs.append(("cold start", np.full(seconds, at), at, 0))
    for _ in range(2):
        up = [(float(rng.choice([1.0, 3.0, 5.0])), t, rng.uniform(1200, 2100)) for t in (-20, 0, 20, 40, 60)]
        down = [(float(rng.choice([1.0, 3.0, 5.0])), t, rng.uniform(1200, 2100)) for t in (40, 20, 0, -20, -40)]
        runs.append(("staircase", steps(-40 + rng.uniform(-2, 2), up + down, seconds), -40.0, 0))
    for order in (1, -1):
        peaks = [60, -40, 45, -25, 30, -10, 20, 5][::order]
        legs = [(float(rng.choice([1.0, 3.0, 5.0])), p + rng.uniform(-3, 3), rng.uniform(900, 2400)) for p in peaks]
        runs.append(("nested loops", steps(10 + rng.uniform(-2, 2), legs, seconds), 10.0, 0))
    rate = rng.uniform(2, 4)
    runs.append(("ramp", steps(0.0, [(rate, 60, 3600), (rate, -40, 3600)], seconds), 0.0, 0))
    return runs
