"""Chamber, instrument and programme: how the air follows the profile, and the nodes of the instrument the air.

A second-order closed loop, T'' + 2ζω T' + ω² T = ω² programme, whose lag behind a ramp is 2ζ/ω. With ζ < 1 it
overshoots at every corner, by exp(−πζ/√(1−ζ²)) of a step. On top comes the slow wave of a controller that
switches its heater, and an error of the setpoint that stays for a run. Jumps are as fast as the chamber can.

C_i dT_i/dt = G_i,air (T_air − T_i) + Σ_j G_ij (T_j − T_i) + P_i(t)

The network is linear and symmetric, so it is solved in its own modes: each one is a first-order recursion
whose coefficients are exact (matrix exponential) for an air temperature that is linear between two grid
points and a power that is constant there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import cont2discrete, lfilter, lfiltic

from ..common.arrays import FloatArray

if TYPE_CHECKING:
    from .scenario import Chamber

__all__ = ["ThermalNetwork", "air"]


def air(chamber: Chamber, programme_c: FloatArray, dt_s: float, rng: np.random.Generator) -> FloatArray:
    """Air temperature for a programme on a grid of `dt_s`, C; starts settled on its first value."""
    offset = rng.normal(0.0, chamber.setpoint_sigma_c)
    phase = rng.uniform(0.0, 2.0 * np.pi)
    settled = _follow(chamber, programme_c - programme_c[0], dt_s)
    time_s = dt_s * np.arange(len(programme_c))
    ripple = chamber.ripple_c * np.sin(2.0 * np.pi * time_s / chamber.ripple_s + phase)
    return np.asarray(programme_c[0] + settled + offset + ripple)


def _follow(chamber: Chamber, departure_c: FloatArray, dt_s: float) -> FloatArray:
    """The loop's answer to a programme that starts at 0, exact for one that is linear between the points."""
    omega = 2.0 * chamber.damping / chamber.lag_s
    plant = ([omega**2], [1.0, 2.0 * chamber.damping * omega, omega**2])
    numerator, denominator, _ = cont2discrete(plant, dt_s, method="foh")
    rest = lfiltic(numerator.ravel(), denominator, y=[0.0, 0.0], x=[0.0, 0.0])
    return np.asarray(lfilter(numerator.ravel(), denominator, departure_c, zi=rest)[0])


@dataclass(frozen=True, slots=True)
class ThermalNetwork:
    """Nodes of the instrument in the chamber's air.

    Attributes:
        names: Node names.
        capacity: Heat capacities, J/K, shape (n,).
        to_air: Conductances to the air, W/K, shape (n,).
        between: Symmetric conductances between the nodes, W/K, shape (n, n), zero diagonal.
        power: Electrical power that heats each node while the instrument is on, W, shape (n,).
    """

    names: tuple[str, ...]
    capacity: FloatArray
    to_air: FloatArray
    between: FloatArray
    power: FloatArray

    def laplacian(self) -> FloatArray:
        """L in C dT/dt = −L T + G_air T_air + P, W/K, shape (n, n)."""
        return np.asarray(np.diag(self.to_air + self.between.sum(axis=1)) - self.between)

    def steady(self, air_c: float, on: bool) -> FloatArray:
        """Temperatures after a long time at `air_c`, C, shape (n,)."""
        heat = self.to_air * air_c + (self.power if on else 0.0)
        return np.asarray(np.linalg.solve(self.laplacian(), heat))

    def respond(self, air_c: FloatArray, on: FloatArray, dt_s: float) -> FloatArray:
        """Temperatures of all nodes over time, from the steady state at the first air temperature, power off.

        Args:
            air_c: Air temperature at the grid points, C, shape (time,); linear between them.
            on: 1.0 where power is on in the interval that starts at a grid point, else 0.0, shape (time,).
            dt_s: Grid, s.

        Returns:
            C, shape (n, time).
        """
        root = np.sqrt(self.capacity)
        rates, vectors = np.linalg.eigh(self.laplacian() / np.outer(root, root))
        into, out = vectors.T / root, vectors / root[:, None]  # heat into modes, modes into temperatures
        start = into @ (self.capacity * self.steady(float(air_c[0]), on=False))
        heat = np.outer(into @ self.to_air, air_c)
        electrical = np.outer(into @ self.power, on)
        modes = [
            _mode(float(rates[i]) * dt_s, heat[i] / rates[i], electrical[i] / rates[i], float(start[i]))
            for i in range(len(rates))
        ]
        return np.asarray(out @ np.array(modes))


def _mode(step: float, sloped: FloatArray, held: FloatArray, start: float) -> FloatArray:
    """dm/dt = sloped + held − m, time in units of the mode's time constant, on a grid of `step`.

    `sloped` is linear between the points, `held` constant after each.
    """
    lost = -float(np.expm1(-step))
    late = 1.0 - lost / step  # weight of an interval's end point
    forced = late * sloped[1:] + (lost - late) * sloped[:-1] + lost * held[:-1]
    rest = lfilter([1.0], [1.0, lost - 1.0], forced, zi=[(1.0 - lost) * start])[0]
    return np.concatenate(([start], rest))
