"""One simulated run: chamber, thermal nodes, sensor, bias, and the rows that a recorder would have written.

Physics and noise live on a grid of one second; rows are whole numbers of seconds, or a whole number of rows a second.
Any row length therefore shows the same angle and the same temperature readings.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import noise, profile, thermal
from .biasmap import BiasMap
from .noise import CELL_S
from .scenario import NoiseLevels, Profile, Scenario

__all__ = ["Chunk", "Record", "Rows", "record", "rows"]

Array = NDArray[np.float64]

_CHUNK_ROWS = 100_000


@dataclass(frozen=True, slots=True)
class Record:
    """What one run is made of, once a second.

    Attributes:
        reading_c: Temperature readings, one at the start of every cell, C, shape (cells,).
        true_arcsec: Angle of the bias since the start of the record, at the cells' edges, shape (cells + 1,).
        bias_dph: Bias at the cells' edges, deg/h, shape (cells + 1,).
        angle_arcsec: What is measured before any rounding to pulses: bias and noise, shape (cells + 1,).
        noise_arcsec: The noise of it before quantisation.
        power_on_s: Power-on on the record's clock, s.
        levels: Noise levels.
        seeds: For what is finer than a cell.
    """

    reading_c: Array
    true_arcsec: Array
    bias_dph: Array
    angle_arcsec: Array
    noise_arcsec: Array
    power_on_s: float
    levels: NoiseLevels
    seeds: np.random.SeedSequence


def record(
    scenario: Scenario, run: Profile, bias_map: BiasMap, levels: NoiseLevels, seeds: np.random.SeedSequence
) -> Record:
    """Simulates one run of a profile."""
    chamber_seeds, sensor_seeds, noise_seeds, fine_seeds = seeds.spawn(4)
    first = round(60.0 * run.record_from_min / CELL_S)
    cells = round(60.0 * run.record_min / CELL_S)
    power_on = round(60.0 * run.power_on_min / CELL_S)
    nodes_c, cavity_rate = _nodes(
        scenario, run, np.random.default_rng(chamber_seeds), first + cells + 1, power_on
    )
    recorded = slice(first, first + cells + 1)
    reading = _readings(scenario, nodes_c, np.random.default_rng(sensor_seeds))[recorded][:-1]
    cavity_c = nodes_c[list(scenario.gyro.node).index(scenario.gyro.cavity_node)]
    bias = bias_map(cavity_c[recorded], 60.0 * cavity_rate[recorded])
    true = np.concatenate(([0.0], np.cumsum(0.5 * CELL_S * (bias[1:] + bias[:-1]))))
    rough = np.concatenate(([0.0], np.cumsum(noise.angle_arcsec(noise_seeds, levels, cells))))
    angle = true + rough
    if levels.quantum_arcsec:
        phase = np.random.default_rng(noise_seeds.spawn(1)[0]).random(cells + 1)
        angle = noise.quantised(angle, levels.quantum_arcsec, phase)
    return Record(
        reading_c=reading,
        true_arcsec=true,
        bias_dph=bias,
        angle_arcsec=angle,
        noise_arcsec=rough,
        power_on_s=CELL_S * (power_on - first),
        levels=levels,
        seeds=fine_seeds,
    )


def _network(scenario: Scenario) -> thermal.Network:
    nodes = scenario.gyro.node
    names = tuple(nodes)
    between = np.zeros((len(names), len(names)))
    for name, node in nodes.items():
        for other, conductance in node.to.items():
            pair = names.index(name), names.index(other)
            between[pair] += conductance
            between[pair[::-1]] += conductance
    return thermal.Network(
        names=names,
        capacity=np.array([node.heat_capacity_j_per_k for node in nodes.values()]),
        to_air=np.array([node.to_air_w_per_k for node in nodes.values()]),
        between=between,
        power=np.array([node.power_w for node in nodes.values()]),
    )


def _nodes(
    scenario: Scenario, run: Profile, rng: np.random.Generator, points: int, power_on: int
) -> tuple[Array, Array]:
    """Temperatures of all nodes (C, shape (nodes, points)) and the cavity's rate of change (C/s)."""
    time_s = CELL_S * np.arange(points)
    programme = profile.corners(run.steps, run.start_c, float(time_s[-1]))
    programmed = profile.sample(programme, time_s) + rng.normal(0.0, scenario.chamber.setpoint_sigma_c)
    air_c = thermal.first_order(scenario.chamber.lag_s, CELL_S, programmed)
    on = (np.arange(points) >= power_on).astype(np.float64)
    network = _network(scenario)
    nodes_c = network.respond(air_c, on, CELL_S)
    cavity = network.names.index(scenario.gyro.cavity_node)
    rate = network.heat_flow(nodes_c, air_c, on)[cavity] / network.capacity[cavity]
    return nodes_c, rate


def _readings(scenario: Scenario, nodes_c: Array, rng: np.random.Generator) -> Array:
    sensor = scenario.sensor
    node_c = nodes_c[list(scenario.gyro.node).index(sensor.node)]
    reading = thermal.first_order(sensor.lag_s, CELL_S, node_c)
    reading = reading + rng.normal(0.0, sensor.noise_c, len(reading))
    return sensor.resolution_c * np.round(reading / sensor.resolution_c) if sensor.resolution_c else reading


@dataclass(frozen=True, slots=True)
class Rows:
    """Row length: `cells` cells a row, or `per_cell` rows a cell; one of both is 1."""

    cells: int
    per_cell: int

    @property
    def row_s(self) -> float:
        """Seconds a row."""
        return CELL_S * self.cells / self.per_cell


@dataclass(frozen=True, slots=True)
class Chunk:
    """Consecutive rows: start of the row (s), mean temperature reading (C), angle at the edges (arcsec, one more)."""

    time_s: Array
    temperature_c: Array
    edge_arcsec: Array


def rows(record: Record, length: Rows) -> Iterator[Chunk]:
    """The rows of a record, in chunks; a last row that is not full is left out."""
    rng, phases = (np.random.default_rng(child) for child in record.seeds.spawn(2))
    total = len(record.reading_c)
    step = max(1, _CHUNK_ROWS // length.per_cell) * length.cells
    for start in range(0, total - total % length.cells, step):
        stop = min(start + step, total - total % length.cells)
        readings = record.reading_c[start:stop]
        if length.per_cell == 1:
            temperature = readings.reshape(-1, length.cells).mean(axis=1)
            edges = record.angle_arcsec[start : stop + 1 : length.cells]
        else:
            temperature = np.repeat(readings, length.per_cell)
            edges = _fine_edges(record, start, stop, length.per_cell, rng, phases)
        first = start * length.per_cell // length.cells
        yield Chunk(length.row_s * np.arange(first, first + len(temperature)), temperature, edges)


def _fine_edges(
    record: Record, start: int, stop: int, parts: int, rng: np.random.Generator, phases: np.random.Generator
) -> Array:
    """Angle at the edges of `parts` rows in each cell; full seconds as they are, in between a parabola and a bridge."""
    share = np.arange(1, parts) / parts
    bias = record.bias_dph[start : stop + 1, None]
    smooth = CELL_S * share * (bias[:-1] + 0.5 * share * (bias[1:] - bias[:-1]))
    base = (record.true_arcsec + record.noise_arcsec)[start : stop + 1]
    grown = np.diff(record.noise_arcsec[start : stop + 1])[:, None] * share
    sigma = noise.white_sigma_arcsec(record.levels.arw_deg_per_sqrt_h)
    inner = base[:-1, None] + smooth + grown + noise.bridge_arcsec(rng, stop - start, parts, sigma)
    if record.levels.quantum_arcsec:
        inner = noise.quantised(inner, record.levels.quantum_arcsec, phases.random(inner.shape))
    edges = np.empty((stop - start) * parts + 1)
    edges[::parts] = record.angle_arcsec[start : stop + 1]
    edges[:-1].reshape(-1, parts)[:, 1:] = inner
    return edges
