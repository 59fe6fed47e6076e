"""What goes on inside the instrument beside its sensor: further thermometers, differences of nodes, the laser."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..causes.base import Scene
from ..common.arrays import FloatArray
from .channels import channel_values
from .laser import LaserStates, laser_bias, laser_readings, laser_states
from .noise import CELL_S
from .scenario import Channel, Scenario
from .signals import NodeDifference
from .thermometers import thermometer_readings

__all__ = ["Internal", "internal_of", "internal_readings"]

_REFERENCE_C = 20.0  # at which the parameters of a difference hold, as those of the laser


@dataclass(frozen=True, slots=True)
class Internal:
    """One run inside the instrument, from the start of the chamber programme, shape (n,) each.

    Attributes:
        bias_dph: What differences of nodes and the laser add to the bias, deg/h.
        nodes_c: True temperatures by node, C.
        laser: States of the laser, where the scenario has one.
        states: What truth keeps; empty where the scenario has neither thermometers nor differences nor laser.
    """

    bias_dph: FloatArray
    nodes_c: Mapping[str, FloatArray]
    laser: LaserStates | None
    states: dict[str, FloatArray]


def internal_of(
    scenario: Scenario, nodes_c: Mapping[str, FloatArray], scene: Scene, rng: np.random.Generator
) -> Internal:
    """Differences and laser of a run; `rng` draws what no temperature moves."""
    bias = np.zeros(len(scene.time_s))
    for one in scenario.difference:
        bias = bias + _difference(one, nodes_c[one.node] - nodes_c[one.against], scene.cavity_c)
    laser = scenario.laser
    if not (scenario.thermometer or scenario.difference or laser):
        return Internal(bias, nodes_c, None, {})
    states = {f"{name}_c": values for name, values in nodes_c.items()}
    if laser is None:
        return Internal(bias, nodes_c, None, states)
    wander = Channel(
        name="loss", wander_sigma=laser.contamination_ppm, wander_tau_s=laser.contamination_tau_s
    )
    found = laser_states(
        laser,
        nodes_c[laser.mirror_node],
        nodes_c[laser.gas_node],
        nodes_c[laser.path_node],
        scene.day,
        channel_values(wander, np.zeros(len(bias)), CELL_S, rng),
    )
    states |= {"loss_ppm": found.loss_ppm, "gain_ppm": found.gain_ppm, "stroke": found.stroke}
    return Internal(bias + laser_bias(laser, found), nodes_c, found, states)


def _difference(one: NodeDifference, x: FloatArray, cavity_c: FloatArray) -> FloatArray:
    bent = x / np.sqrt(1.0 + (x / one.saturation_c) ** 2)
    return np.asarray(one.dph_per_c * bent * (1.0 + one.growth_per_c * (cavity_c - _REFERENCE_C)))


def internal_readings(
    scenario: Scenario, internal: Internal, air_c: FloatArray, scene: Scene, seeds: np.random.SeedSequence
) -> dict[str, FloatArray]:
    """Readings of further thermometers and of the laser's signals, by column, shape (n,)."""
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
