"""Thermal network of the instrument: nodes with heat capacities, conductances between them, electrical power.

    C_i dT_i/dt = G_i,air (T_air − T_i) + Σ_j G_ij (T_j − T_i) + P_i(t)

The network is linear and symmetric, so it is solved in its own modes: each one is a first-order recursion whose
coefficients are exact (matrix exponential) for an air temperature that is linear between two grid points and a power
that is constant there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

__all__ = ["Network", "first_order"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Network:
    """Nodes of the instrument in the chamber's air.

    Attributes:
        names: Node names.
        capacity: Heat capacities, J/K, shape (n,).
        to_air: Conductances to the air, W/K, shape (n,).
        between: Symmetric conductances between the nodes, W/K, shape (n, n), zero diagonal.
        power: Electrical power that heats each node while the instrument is on, W, shape (n,).
    """

    names: tuple[str, ...]
    capacity: Array
    to_air: Array
    between: Array
    power: Array

    def modes(self) -> tuple[Array, Array, Array]:
        """Rates (1/s, positive), modes from nodes and nodes from modes: T = out · m, dm/dt = −λ m + into · q/C.

        `into` acts on heat flows in W.
        """
        root = np.sqrt(self.capacity)
        laplacian = np.diag(self.to_air + self.between.sum(axis=1)) - self.between
        rates, vectors = np.linalg.eigh(laplacian / np.outer(root, root))
        return rates, vectors.T / root, vectors / root[:, None]

    def steady(self, air_c: float, on: bool) -> Array:
        """Temperatures (C, shape (n,)) after a long time at `air_c`."""
        laplacian = np.diag(self.to_air + self.between.sum(axis=1)) - self.between
        heat = self.to_air * air_c + (self.power if on else 0.0)
        return np.asarray(np.linalg.solve(laplacian, heat))

    def heat_flow(self, nodes_c: Array, air_c: Array, on: Array) -> Array:
        """Net heat into every node, W: shape (n, time) like `nodes_c`; `air_c`, `on` of shape (time,)."""
        exchange = self.between @ nodes_c - (self.to_air + self.between.sum(axis=1))[:, None] * nodes_c
        return np.asarray(exchange + np.outer(self.to_air, air_c) + np.outer(self.power, on))

    def respond(self, air_c: Array, on: Array, dt_s: float) -> Array:
        """Temperatures of all nodes over time, from the steady state at the first air temperature, power off.

        Args:
            air_c: Air temperature at the grid points, C, shape (time,); linear between them.
            on: 1.0 where power is on during the interval that starts at a grid point, else 0.0, shape (time,).
            dt_s: Grid, s.

        Returns:
            C, shape (n, time).
        """
        rates, into, out = self.modes()
        start = into @ (self.capacity * self.steady(float(air_c[0]), on=False))
        air_gain = into @ self.to_air
        power_gain = into @ self.power
        modes = np.empty((len(rates), len(air_c)))
        for index, rate in enumerate(rates):
            drive = air_gain[index] * air_c
            constant = power_gain[index] * on
            modes[index] = _mode(float(rate), dt_s, drive, constant, float(start[index]))
        return out @ modes


def _mode(rate: float, dt_s: float, drive: Array, constant: Array, start: float) -> Array:
    """dm/dt = −rate · m + drive (linear between points) + constant (held), exactly on the grid."""
    x = rate * dt_s
    decay = np.exp(-x)
    held = -np.expm1(-x) / rate  # ∫ exp(−rate s) ds
    late = (1.0 - -np.expm1(-x) / x) / rate  # weight of the interval's end point
    forced = late * drive[1:] + (held - late) * drive[:-1] + held * constant[:-1]
    rest, _ = lfilter([1.0], [1.0, -decay], forced, zi=[decay * start])
    return np.concatenate(([start], rest))


def first_order(tau_s: float, dt_s: float, driven: Array, start: float | None = None) -> Array:
    """tau dz/dt = driven − z on a grid, exact for an input that is linear between the points.

    Starts at `start` (default: the first input). `tau_s` = 0 gives the input itself.
    """
    if tau_s == 0.0:
        return driven.copy()
    rate = 1.0 / tau_s
    first = float(driven[0]) if start is None else start
    return _mode(rate, dt_s, rate * driven, np.zeros_like(driven), first)
