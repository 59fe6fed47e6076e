"""One simulated run once a second: chamber, thermal nodes, causes, bias, thermometers, channels, noise.

The chamber is a second-order closed loop, T'' + 2ζω T' + ω² T = ω² programme, whose lag behind a ramp is 2ζ/ω. With
ζ < 1 it overshoots at every corner, by exp(−πζ/√(1−ζ²)) of a step. On top comes the slow wave of a controller that
switches its heater, and an error of the setpoint that stays for a run. Jumps are as fast as the chamber can.

C_i dT_i/dt = G_i,air (T_air − T_i) + Σ_j G_ij (T_j − T_i) + P_i(t)

The network of nodes is linear and symmetric, so it is solved in its own modes: each one is a first-order recursion
whose coefficients are exact (matrix exponential) for an air temperature that is linear between two grid points and a
power that is constant there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import cont2discrete, lfilter, lfiltic

from ..causes import CATALOGUE
from ..causes.base import Scene
from ..common.arrays import FloatArray
from ..common.inputs import need_memory
from ..mirror.recursions import first_order
from . import profile
from .gyro import (
    CELL_S,
    BiasMap,
    cell_noise,
    channel_readings,
    channel_values,
    internal_of,
    internal_readings,
    quantised,
    quantised_c,
)
from .scenario import Chamber, Gyro, Profile, Scenario


def chamber_air(chamber: Chamber, programme_c: FloatArray, dt_s: float, rng: np.random.Generator) -> FloatArray:
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


_ARRAYS = 24  # of a value a second, besides nodes and channels


@dataclass(frozen=True, slots=True)
class SimulatedRecord:
    """What one run is made of, once a second.

    Attributes:
        reading_c: Temperature readings, one at the start of every cell, C, shape (cells,).
        channels: Readings of the auxiliary channels, further thermometers and the laser's signals first, the same.
        states: True temperatures of the nodes, C, and states of the laser, where a scenario asks for such, the same.
        air_c: Air in the chamber at the cells' edges, C, shape (cells + 1,).
        cavity_c: Temperature that the bias acts on, the same.
        bias_dph: Bias at the cells' edges, deg/h, shape (cells + 1,).
        true_arcsec: Its angle since the start of the record, shape (cells + 1,).
        rough_arcsec: Angle of bias and noise, shape (cells + 1,).
        angle_arcsec: The same as it is read: quantised, if the gyro has a quantum.
        white_arcsec: Standard deviation of the white noise in each cell, shape (cells,).
        quantum_arcsec: 0: none.
        power_on_s: Power-on on the record's clock, s.
        seeds: For what is finer than a cell.
    """

    reading_c: FloatArray
    channels: dict[str, FloatArray]
    states: dict[str, FloatArray]
    air_c: FloatArray
    cavity_c: FloatArray
    bias_dph: FloatArray
    true_arcsec: FloatArray
    rough_arcsec: FloatArray
    angle_arcsec: FloatArray
    white_arcsec: FloatArray
    quantum_arcsec: float
    power_on_s: float
    seeds: np.random.SeedSequence


def record(
    scenario: Scenario, run: Profile, bias_map: BiasMap, day: float, seeds: np.random.SeedSequence
) -> SimulatedRecord:
    """Simulates one run of a profile, `day` days after the first one.

    What is drawn for the chamber, the sensor, the noise and each cause has its own seed: switching one of
    them on changes nothing else.
    """
    world, sensing, noisy, fine, causal, inner = seeds.spawn(6)
    first, cells = _cells(run.record_from_min), _cells(run.record_min)
    arrays = _ARRAYS + 3 * len(scenario.gyro.node) + 2 * len(scenario.columns())
    need_memory(8.0 * arrays * (first + cells), "record_from_min and record_min of a profile", f"{cells} s")
    inside = slice(first, first + cells + 1)
    air_c, nodes_c, scene, true_channels = _scene(scenario, run, first + cells + 1, day, world)
    scene, bias = _bias(scenario, scene, true_channels, bias_map, causal)
    internal = internal_of(scenario, nodes_c, scene, np.random.default_rng(inner.spawn(1)[0]))
    bias = bias + internal.bias_dph
    sensor_seeds, channel_seeds = sensing.spawn(2)
    reading = _readings(scenario, scene.sensed_c, np.random.default_rng(sensor_seeds))
    of_channels = {
        channel.name: channel_readings(channel, true_channels[channel.name], np.random.default_rng(child))
        for channel, child in zip(scenario.channel, channel_seeds.spawn(len(scenario.channel)), strict=True)
    }
    cavity = scene.cavity_c[inside]
    rough = cell_noise(noisy, scenario.noise, cavity[:-1], 60.0 * np.diff(cavity) / CELL_S)
    there = bias[inside]
    true = np.concatenate(([0.0], np.cumsum(0.5 * CELL_S * (there[1:] + there[:-1]))))
    gathered = true + np.concatenate(([0.0], np.cumsum(rough.angle_arcsec)))
    return SimulatedRecord(
        reading_c=reading[inside][:-1],
        channels=_of_record(internal_readings(scenario, internal, air_c, scene, inner) | of_channels, inside),
        states=_of_record(internal.states, inside),
        air_c=air_c[inside],
        cavity_c=cavity,
        bias_dph=there,
        true_arcsec=true,
        rough_arcsec=gathered,
        angle_arcsec=_read_angle(gathered, scenario.noise.quantum_arcsec, noisy),
        white_arcsec=rough.white_arcsec,
        quantum_arcsec=scenario.noise.quantum_arcsec,
        power_on_s=CELL_S * (_cells(run.power_on_min) - first),
        seeds=fine,
    )


def _of_record(columns: dict[str, FloatArray], inside: slice) -> dict[str, FloatArray]:
    return {name: values[inside][:-1] for name, values in columns.items()}


def thermal_network(gyro: Gyro) -> ThermalNetwork:
    """The network that a scenario describes."""
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


def _cells(minutes: float) -> int:
    return round(60.0 * minutes / CELL_S)


def _read_angle(angle: FloatArray, quantum_arcsec: float, seeds: np.random.SeedSequence) -> FloatArray:
    if not quantum_arcsec:
        return angle
    phase = np.random.default_rng(seeds.spawn(1)[0]).random(len(angle))
    return quantised(angle, quantum_arcsec, phase)


def _scene(
    scenario: Scenario, run: Profile, points: int, day: float, seeds: np.random.SeedSequence
) -> tuple[FloatArray, dict[str, FloatArray], Scene, dict[str, FloatArray]]:
    """Air, nodes, what causes see of them, and channels from the start of the programme on."""
    chamber_seeds, channel_seeds = seeds.spawn(2)
    time_s: FloatArray = CELL_S * np.arange(points, dtype=np.float64)
    limit = scenario.chamber.max_c_per_min
    programme = profile.corners(run.steps, run.start_c, float(time_s[-1]), limit)
    programmed = profile.sample_profile(programme, time_s)
    air_c = chamber_air(scenario.chamber, programmed, CELL_S, np.random.default_rng(chamber_seeds))
    on_s = time_s - CELL_S * _cells(run.power_on_min)
    network = thermal_network(scenario.gyro)
    nodes_c = network.respond(air_c, (on_s >= 0.0).astype(np.float64), CELL_S)
    by_name = dict(zip(network.names, nodes_c, strict=True))
    node_c = by_name[scenario.sensor.node]
    true_channels = {
        channel.name: channel_values(channel, air_c, CELL_S, np.random.default_rng(child))
        for channel, child in zip(scenario.channel, channel_seeds.spawn(len(scenario.channel)), strict=True)
    }
    scene = Scene(
        time_s=time_s,
        on_s=on_s,
        node_c=node_c,
        cavity_c=by_name[scenario.gyro.cavity_node],
        sensed_c=first_order(scenario.sensor.lag_s, time_s, node_c),
        channel=None,
        day=day,
    )
    return air_c, by_name, scene, true_channels


def _bias(
    scenario: Scenario,
    scene: Scene,
    true_channels: dict[str, FloatArray],
    bias_map: BiasMap,
    seeds: np.random.SeedSequence,
) -> tuple[Scene, FloatArray]:
    """The scene with what the causes make of it, and the bias in deg/h."""
    causes = [(CATALOGUE[cause.id], cause) for cause in scenario.cause]
    for term, cause in causes:
        if term.cavity is not None:
            scene = replace(scene, cavity_c=term.cavity(scene, cause.values()))
        if term.record is not None:
            scene = replace(scene, sensed_c=term.record(scene, cause.values()))
    slope = 60.0 * np.gradient(scene.cavity_c, CELL_S)
    bias = bias_map(scene.cavity_c, slope)
    for (term, cause), child in zip(causes, seeds.spawn(len(causes)), strict=True):
        if term.bias is not None:
            seen = replace(scene, channel=true_channels[cause.channel]) if cause.channel else scene
            bias = bias + term.bias(seen, cause.values(), np.random.default_rng(child))
    return scene, bias


def _readings(scenario: Scenario, sensed_c: FloatArray, rng: np.random.Generator) -> FloatArray:
    sensor = scenario.sensor
    reading = sensed_c + sensor.offset_c + rng.normal(0.0, sensor.noise_c, len(sensed_c))
    return quantised_c(reading, sensor.resolution_c)
