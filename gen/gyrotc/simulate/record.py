"""One simulated run, cell by cell: chamber, thermal nodes, causes, bias, readings and noise, in this order."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..causes import CATALOGUE
from ..causes.base import Scene
from ..common.arrays import FloatArray
from ..common.inputs import need_memory
from ..mirror.recursions import first_order
from . import profile
from .angle_noise import cell_noise, quantised
from .bias_map import BiasMap
from .chamber import chamber_air
from .grid import CELL_S
from .internal_effects import internal_effects, readings_inside
from .readings import channel_readings, channel_values, sensor_readings
from .scenario import Profile, Scenario
from .thermal import thermal_network

_ARRAYS = 24  # arrays with a value a cell that a run holds, besides those of nodes and channels


@dataclass(frozen=True, slots=True)
class SimulatedRecord:
    """One simulated run, a value a cell.

    Attributes:
        reading_c: Temperature readings, one at the start of every cell, C, shape (cells,).
        channels: Readings by column: further thermometers, signals of the laser, auxiliary channels; shape (cells,).
        states: True temperatures of the nodes, C, and states of the laser, by name; shape (cells,).
        air_c: Air in the chamber at the cells' edges, C, shape (cells + 1,).
        cavity_c: Temperature of the cavity at the cells' edges, which the bias follows, C, shape (cells + 1,).
        bias_dph: Bias at the cells' edges, deg/h, shape (cells + 1,).
        true_arcsec: Angle of the bias since the start of the record, arcsec, shape (cells + 1,).
        rough_arcsec: Angle of bias and noise, arcsec, shape (cells + 1,).
        angle_arcsec: Angle as it is read, in steps of the quantum if there is one, arcsec, shape (cells + 1,).
        white_arcsec: Standard deviation of the white noise in each cell, arcsec, shape (cells,).
        quantum_arcsec: Step in which the angle is read, arcsec; 0: none.
        power_on_s: Power-on on the record's clock, s.
        seeds: Seeds of what is finer than a cell.
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
    """Simulate one run of a profile, `day` days after the first one.

    The chamber, the sensor, the noise and each cause are drawn from seeds of their own, so switching one of them on
    changes nothing else.

    Raises:
        InputError: The run is too long for the memory that may be used.
    """
    world, sensing, noisy, fine, causal, inner = seeds.spawn(6)
    first, cells = _cells(run.record_from_min), _cells(run.record_min)
    arrays = _ARRAYS + 3 * len(scenario.gyro.node) + 2 * len(scenario.columns())
    need_memory(8.0 * arrays * (first + cells), "record_from_min and record_min of a profile", f"{cells} s")
    inside = slice(first, first + cells + 1)
    air_c, nodes_c, scene, true_channels = _scene(scenario, run, first + cells + 1, day, world)
    scene, bias = _bias(scenario, scene, true_channels, bias_map, causal)
    internal = internal_effects(scenario, nodes_c, scene, np.random.default_rng(inner.spawn(1)[0]))
    bias = bias + internal.bias_dph
    sensor_seeds, channel_seeds = sensing.spawn(2)
    reading = sensor_readings(scenario.sensor, scene.sensed_c, np.random.default_rng(sensor_seeds))
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
        channels=_of_record(readings_inside(scenario, internal, air_c, scene, inner) | of_channels, inside),
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


def _scene(
    scenario: Scenario, run: Profile, points: int, day: float, seeds: np.random.SeedSequence
) -> tuple[FloatArray, dict[str, FloatArray], Scene, dict[str, FloatArray]]:
    """Simulate air, nodes, the scene that causes see, and true channels from the start of the programme on."""
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
    """Apply the causes, and return the scene as they change it and the bias in deg/h."""
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


def _of_record(columns: dict[str, FloatArray], inside: slice) -> dict[str, FloatArray]:
    """Cut columns to the cells that are recorded."""
    return {name: values[inside][:-1] for name, values in columns.items()}


def _read_angle(angle: FloatArray, quantum_arcsec: float, seeds: np.random.SeedSequence) -> FloatArray:
    """Return the angle in steps of the quantum, arcsec; 0: as it is."""
    if not quantum_arcsec:
        return angle
    phase = np.random.default_rng(seeds.spawn(1)[0]).random(len(angle))
    return quantised(angle, quantum_arcsec, phase)


def _cells(minutes: float) -> int:
    """Return the number of cells nearest to a time."""
    return round(60.0 * minutes / CELL_S)
