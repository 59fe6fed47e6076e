"""One simulated run once a second: chamber, thermal nodes, causes, bias, thermometers, channels, noise."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..causes import CATALOGUE
from ..causes.base import Scene
from ..common.arrays import FloatArray
from ..common.inputs import need_memory
from ..target.recursions import first_order
from . import chamber, noise, profile
from . import chamber as thermal
from .gyro import BiasMap, channel_readings, channel_values, internal_of, internal_readings, quantised_c
from .noise import CELL_S
from .scenario import Gyro, Profile, Scenario, ScenarioCause

__all__ = ["SimulatedRecord", "record", "thermal_network"]

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
    _need_room(scenario, first, cells)
    inside = slice(first, first + cells + 1)
    air_c, nodes_c, scene, true_channels = _scene(scenario, run, first + cells + 1, day, world)
    scene, bias = _bias(scenario, scene, true_channels, bias_map, causal)
    internal = internal_of(scenario, nodes_c, scene, np.random.default_rng(inner.spawn(1)[0]))
    bias = bias + internal.bias_dph
    sensor_seeds, channel_seeds = sensing.spawn(2)
    reading = _readings(scenario, scene.sensed_c, np.random.default_rng(sensor_seeds))
    of_channels = _channel_readings(scenario, true_channels, channel_seeds)
    cavity = scene.cavity_c[inside]
    rough = noise.cell_noise(noisy, scenario.noise, cavity[:-1], 60.0 * np.diff(cavity) / CELL_S)
    true = _integral(bias[inside])
    gathered = true + np.concatenate(([0.0], np.cumsum(rough.angle_arcsec)))
    return SimulatedRecord(
        reading_c=reading[inside][:-1],
        channels=_of_record(internal_readings(scenario, internal, air_c, scene, inner) | of_channels, inside),
        states=_of_record(internal.states, inside),
        air_c=air_c[inside],
        cavity_c=cavity,
        bias_dph=bias[inside],
        true_arcsec=true,
        rough_arcsec=gathered,
        angle_arcsec=_read_angle(gathered, scenario.noise.quantum_arcsec, noisy),
        white_arcsec=rough.white_arcsec,
        quantum_arcsec=scenario.noise.quantum_arcsec,
        power_on_s=CELL_S * (_cells(run.power_on_min) - first),
        seeds=fine,
    )


def _need_room(scenario: Scenario, first: int, cells: int) -> None:
    """Refuses a run that would not fit into memory."""
    arrays = _ARRAYS + 3 * len(scenario.gyro.node) + 2 * len(scenario.columns())
    need_memory(8.0 * arrays * (first + cells), "record_from_min and record_min of a profile", f"{cells} s")


def _of_record(columns: dict[str, FloatArray], inside: slice) -> dict[str, FloatArray]:
    return {name: values[inside][:-1] for name, values in columns.items()}


def thermal_network(gyro: Gyro) -> thermal.ThermalNetwork:
    """The network that a scenario describes."""
    names = tuple(gyro.node)
    between = np.zeros((len(names), len(names)))
    for name, node in gyro.node.items():
        for other, conductance in node.to.items():
            pair = names.index(name), names.index(other)
            between[pair] += conductance
            between[pair[::-1]] += conductance
    nodes = list(gyro.node.values())
    return thermal.ThermalNetwork(
        names=names,
        capacity=np.array([node.heat_capacity_j_per_k for node in nodes]),
        to_air=np.array([node.to_air_w_per_k for node in nodes]),
        between=between,
        power=np.array([node.power_w for node in nodes]),
    )


def _cells(minutes: float) -> int:
    return round(60.0 * minutes / CELL_S)


def _integral(bias_dph: FloatArray) -> FloatArray:
    steps = 0.5 * CELL_S * (bias_dph[1:] + bias_dph[:-1])
    return np.concatenate(([0.0], np.cumsum(steps)))


def _read_angle(angle: FloatArray, quantum_arcsec: float, seeds: np.random.SeedSequence) -> FloatArray:
    if not quantum_arcsec:
        return angle
    phase = np.random.default_rng(seeds.spawn(1)[0]).random(len(angle))
    return noise.quantised(angle, quantum_arcsec, phase)


def _scene(
    scenario: Scenario, run: Profile, points: int, day: float, seeds: np.random.SeedSequence
) -> tuple[FloatArray, dict[str, FloatArray], Scene, dict[str, FloatArray]]:
    """Air, nodes, what causes see of them, and channels from the start of the programme on."""
    chamber_seeds, channel_seeds = seeds.spawn(2)
    time_s: FloatArray = CELL_S * np.arange(points, dtype=np.float64)
    limit = scenario.chamber.max_c_per_min
    programme = profile.corners(run.steps, run.start_c, float(time_s[-1]), limit)
    programmed = profile.sample(programme, time_s)
    air_c = chamber.air(scenario.chamber, programmed, CELL_S, np.random.default_rng(chamber_seeds))
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
            seen = _with_channel(scene, cause, true_channels)
            bias = bias + term.bias(seen, cause.values(), np.random.default_rng(child))
    return scene, bias


def _with_channel(scene: Scene, cause: ScenarioCause, true_channels: dict[str, FloatArray]) -> Scene:
    return scene if cause.channel is None else replace(scene, channel=true_channels[cause.channel])


def _readings(scenario: Scenario, sensed_c: FloatArray, rng: np.random.Generator) -> FloatArray:
    sensor = scenario.sensor
    reading = sensed_c + sensor.offset_c + rng.normal(0.0, sensor.noise_c, len(sensed_c))
    return quantised_c(reading, sensor.resolution_c)


def _channel_readings(
    scenario: Scenario, true_channels: dict[str, FloatArray], seeds: np.random.SeedSequence
) -> dict[str, FloatArray]:
    children = seeds.spawn(len(scenario.channel))
    return {
        channel.name: channel_readings(channel, true_channels[channel.name], np.random.default_rng(child))
        for channel, child in zip(scenario.channel, children, strict=True)
    }
