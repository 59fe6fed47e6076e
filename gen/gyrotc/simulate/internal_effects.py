"""Effects of temperature differences and of the laser inside the instrument: bias, true states, readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..causes.base import Scene
from ..common.arrays import FloatArray
from .grid import CELL_S, REFERENCE_C
from .laser import LaserStates, laser_bias, laser_readings, laser_states
from .readings import channel_values, thermometer_readings
from .scenario import Channel, Scenario


@dataclass(frozen=True, slots=True)
class InternalEffects:
    """Effects inside the instrument in one run, from the start of the chamber programme, shape (n,) each.

    Attributes:
        bias_dph: Part of the bias that comes from differences of nodes and from the laser, deg/h.
        nodes_c: True temperatures by node, C.
        laser: States of the laser; None: the scenario has none.
        states: States that the truth keeps; empty if the scenario has no thermometers, differences or laser.
    """

    bias_dph: FloatArray
    nodes_c: Mapping[str, FloatArray]
    laser: LaserStates | None
    states: dict[str, FloatArray]


def internal_effects(
    scenario: Scenario, nodes_c: Mapping[str, FloatArray], scene: Scene, rng: np.random.Generator
) -> InternalEffects:
    """Compute the effects of node differences and laser; `rng` draws the losses that no temperature moves."""
    bias = np.zeros(len(scene.time_s))
    for one in scenario.difference:
        x = nodes_c[one.node] - nodes_c[one.against]
        bent = x / np.sqrt(1.0 + (x / one.saturation_c) ** 2)
        bias = bias + one.dph_per_c * bent * (1.0 + one.growth_per_c * (scene.cavity_c - REFERENCE_C))
    laser = scenario.laser
    if not (scenario.thermometer or scenario.difference or laser):
        return InternalEffects(bias, nodes_c, None, {})
    states = {f"{name}_c": values for name, values in nodes_c.items()}
    if laser is None:
        return InternalEffects(bias, nodes_c, None, states)
    wander = Channel(name="loss", wander_sigma=laser.contamination_ppm, wander_tau_s=laser.contamination_tau_s)
    found = laser_states(
        laser,
        nodes_c[laser.mirror_node],
        nodes_c[laser.gas_node],
        nodes_c[laser.path_node],
        scene.day,
        channel_values(wander, np.zeros(len(bias)), CELL_S, rng),
    )
    states |= {"loss_ppm": found.loss_ppm, "gain_ppm": found.gain_ppm, "stroke": found.stroke}
    return InternalEffects(bias + laser_bias(laser, found), nodes_c, found, states)


def readings_inside(
    scenario: Scenario, internal: InternalEffects, air_c: FloatArray, scene: Scene, seeds: np.random.SeedSequence
) -> dict[str, FloatArray]:
    """Draw readings of further thermometers and of the laser's signals, by column, shape (n,)."""
    of_laser, *children = seeds.spawn(1 + len(scenario.thermometer))
    readings = {
        one.name: thermometer_readings(
            one, internal.nodes_c[one.node], air_c, scene.time_s, scene.day, np.random.default_rng(child)
        )
        for one, child in zip(scenario.thermometer, children, strict=True)
    }
    if scenario.laser and internal.laser:
        readings |= laser_readings(scenario.laser, internal.laser, np.random.default_rng(of_laser))
    return readings
