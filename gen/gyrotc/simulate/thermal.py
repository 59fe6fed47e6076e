"""Temperatures of the instrument's nodes in the chamber's air.

C_i dT_i/dt = G_i,air (T_air − T_i) + Σ_j G_ij (T_j − T_i) + P_i(t)

The network of nodes is linear and symmetric, so it is solved in its own modes: each one is a first-order recursion
whose coefficients are exact (matrix exponential) for an air temperature that is linear between two grid points and a
power that is constant there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from ..common.arrays import FloatArray
from .scenario import Gyro


def thermal_network(gyro: Gyro) -> ThermalNetwork:
    """Return the network of a scenario's gyro."""
    names = tuple(gyro.node)
    between = np.zeros((len(names), len(names)))
    for name, node in gyro.node.items():
        for other, conductance in node.to.items():
            pair = names.index(name), names.index(other)
            between[pair] += conductance
            between[pair[::-1]] += conductance
    nodes = list(gyro.node.values())
    return ThermalNetwork(
        names=names,
        capacity=np.array([node.heat_capacity_j_per_k for node in nodes]),
        to_air=np.array([node.to_air_w_per_k for node in nodes]),
        between=between,
        power=np.array([node.power_w for node in nodes]),
    )


@dataclass(frozen=True, slots=True)
class ThermalNetwork:
    """Nodes of the instrument, n in all, in the chamber's air.

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
        """Return L of C dT/dt = −L T + G_air T_air + P, W/K, shape (n, n)."""
        return np.asarray(np.diag(self.to_air + self.between.sum(axis=1)) - self.between)

    def steady(self, air_c: float, on: bool) -> FloatArray:
        """Return the temperatures after a long time at `air_c`, C, shape (n,)."""
        heat = self.to_air * air_c + (self.power if on else 0.0)
        return np.asarray(np.linalg.solve(self.laplacian(), heat))

    def respond(self, air_c: FloatArray, on: FloatArray, dt_s: float) -> FloatArray:
        """Simulate all nodes, from the steady state at the first air temperature with power off.

        Args:
            air_c: Air temperature at the grid points, C, shape (time,); linear between them.
            on: 1.0 where power is on in the interval that starts at a grid point, else 0.0, shape (time,).
            dt_s: Grid, s.

        Returns:
            Temperatures, C, shape (n, time).
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
    """Solve dm/dt = sloped + held − m, time in units of the mode's time constant, on a grid of `step`.

    `sloped` is linear between the points, `held` constant after each.
    """
    lost = -float(np.expm1(-step))
    late = 1.0 - lost / step  # weight of an interval's end point
    forced = late * sloped[1:] + (lost - late) * sloped[:-1] + lost * held[:-1]
    rest = lfilter([1.0], [1.0, lost - 1.0], forced, zi=[(1.0 - lost) * start])[0]
    return np.concatenate(([start], rest))
