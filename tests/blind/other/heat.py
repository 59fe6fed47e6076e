"""Heat in a gyro by finite volumes: case, contact, glass ceramic in cells, a mirror on it; and a chamber that switches.

One space coordinate, from the case to the middle of the block (the other half is the same). Backward Euler in time,
with the conductivity and the heat capacity of the present temperatures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEP_S = 5.0

_CELLS = 8  # of half the block
_CASE = 2 * 2.4e6  # J/(m3 K) of aluminium, both faces of a wall
_GLASS = 2.02e6  # J/(m3 K) of a glass ceramic at 20 C
_GLASS_PER_C = 1.4e-3  # and its change with temperature
_CONDUCTS, _CONDUCTS_PER_C = 1.46, 8e-4  # W/(m K)


@dataclass(frozen=True)
class Body:
    """A gyro as heat sees it. Conductances in W/(m2 K), lengths in m, power in W/m2."""

    to_air: float
    case_m: float
    contact: float
    half_m: float
    mirror_m: float
    mirror_contact: float
    discharge: float
    sensor_cell: int
    ripple_c: float
    ripple_s: float


@dataclass(frozen=True)
class Heat:
    """Temperatures of one run at `STEP_S` from its first row on, C; `on_s` is the time since power-on, s.

    `soak_c` is what everything had when it was switched on.
    """

    sensor: Array
    deep: Array
    mirror: Array
    case: Array
    air: Array
    on_s: Array
    soak_c: float


def draw_body(rng: np.random.Generator) -> Body:
    """The mirror's bond reaches from a good one (a memory of minutes) to a bad one (hours)."""

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    return Body(
        to_air=between(35, 90),
        case_m=between(0.002, 0.005),
        contact=between(80, 400),
        half_m=between(0.008, 0.022),
        mirror_m=between(0.003, 0.006),
        mirror_contact=between(2.5, 60),
        discharge=between(40, 150),
        sensor_cell=int(rng.integers(0, 3)),
        ripple_c=between(0.05, 1.0),
        ripple_s=between(150, 900),
    )


def run_heat(body: Body, command: Array, lead_s: float, rng: np.random.Generator, *, lit: bool = True) -> Heat:
    """A gyro soaked at the first temperature, switched on `lead_s` before the programme begins.

    Args:
        command: The chamber's programme at `STEP_S`, C; it begins with the first row.
        lit: Whether the discharge heats at all.
    """
    lead = round(lead_s / STEP_S)
    wanted = np.concatenate([np.full(lead, command[0]), command])
    air = _chamber(body, wanted, rng)
    state = np.full(_CELLS + 2, wanted[0])  # case, cells of the block, mirror
    out = np.empty((wanted.size, state.size))
    for k, outside in enumerate(air.tolist()):
        out[k] = state
        state = _step(body, state, outside, body.discharge if lit else 0.0)
    out = out[lead:]
    on_s = (np.arange(command.size) + lead) * STEP_S
    return Heat(
        out[:, 1 + body.sensor_cell],
        out[:, _CELLS],
        out[:, -1],
        out[:, 0],
        air[lead:],
        on_s,
        float(wanted[0]),
    )


def _step(body: Body, state: Array, outside: float, power: float) -> Array:
    """One backward step of all volumes."""
    dx = body.half_m / _CELLS
    glass = state[1:-1]
    capacity = np.r_[_CASE * body.case_m, _GLASS * (1.0 + _GLASS_PER_C * (glass - 20.0)) * dx, _GLASS * body.mirror_m]
    between = (_CONDUCTS + _CONDUCTS_PER_C * (0.5 * (glass[1:] + glass[:-1]) - 20.0)) / dx
    chain = np.r_[1.0 / (1.0 / body.contact + 0.5 * dx / _CONDUCTS), between]
    matrix = np.zeros((state.size, state.size))
    at = np.arange(_CELLS)
    matrix[at, at] += chain
    matrix[at + 1, at + 1] += chain
    matrix[at, at + 1] -= chain
    matrix[at + 1, at] -= chain
    held, bond = 1, body.mirror_contact  # the mirror sits on the outermost cell, beside the thermometer
    for i, j in ((held, held), (-1, -1)):
        matrix[i, j] += bond
    matrix[held, -1] -= bond
    matrix[-1, held] -= bond
    matrix[0, 0] += body.to_air
    source = np.zeros(state.size)
    source[0] = body.to_air * outside
    source[_CELLS] = power  # the discharge runs in the middle
    inertia = capacity / STEP_S
    matrix[np.arange(state.size), np.arange(state.size)] += inertia
    return np.linalg.solve(matrix, inertia * state + source)


def _chamber(body: Body, wanted: Array, rng: np.random.Generator) -> Array:
    """Air that a thermostat keeps: it follows late, and its switching leaves a saw-tooth that depends on the load."""
    air, heating = float(wanted[0]), True
    slope = 2.0 * body.ripple_c / body.ripple_s * 2.0  # C/s up and down, while the programme stands
    out = np.empty(wanted.size)
    for k, goal in enumerate(wanted.tolist()):
        out[k] = air
        if air > goal + body.ripple_c:
            heating = False
        elif air < goal - body.ripple_c:
            heating = True
        push = slope if heating else -slope
        far = goal - air
        air += STEP_S * (push + far / 120.0 * (abs(far) > body.ripple_c))
    return np.asarray(out + rng.normal(0.0, 0.02, out.size))


def programme(rng: np.random.Generator, hours: float) -> tuple[Array, float]:
    """A programme drawn leg by leg, and how long before its first row the gyro was switched on, s."""
    steps = round(hours * 3600.0 / STEP_S)
    level = float(rng.uniform(-40, 65))
    if rng.uniform() < 0.25:
        return np.full(steps, level), float(rng.choice([0.0, 1800.0, 3600.0]))
    parts: list[Array] = []
    total = 0
    while total < steps:
        goal = float(np.clip(rng.uniform(-45, 72), -45, 72))
        rate = float(np.exp(rng.uniform(np.log(0.4), np.log(6.0)))) / 60.0  # C/s
        ramp = max(round(abs(goal - level) / rate / STEP_S), 1)
        hold = round(float(rng.uniform(300, 4000)) / STEP_S)
        parts += [np.linspace(level, goal, ramp, endpoint=False), np.full(hold, goal)]
        total, level = total + ramp + hold, goal
    return np.concatenate(parts)[:steps], float(rng.choice([0.0, 0.0, 600.0, 3600.0]))
