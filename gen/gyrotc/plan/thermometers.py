"""Where a further thermometer would tell most: at the node whose temperature the others do not say.

A part of the bias that follows T_node − T_sensor shows by what no map of (T, dT/dt) and no thermometer that is there
already can hold of that difference. The amplitude that is found in 95 % of cases has d = 6 (docs/diagnosis.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..common.errors import InputError
from ..common.orthonormal import orthonormal
from ..diagnose.gains import Gains
from ..simulate.campaign import Noise
from .programme import node_temperatures
from .sensitivity import Sensitivity

__all__ = ["Place", "places"]


_D_FOUND = 6.0  # about where most causes are found, as in `separate`
_LEAST_C = 1e-4  # no thermometer tells less than this


@dataclass(frozen=True)
class Place:
    """A node of the gyro as a place for a thermometer.

    Attributes:
        node: Its name.
        there: Whether a thermometer is there.
        apart_c: RMS of its temperature less that of the sensor, about the mean, C.
        unseen_c: RMS of what neither the map nor the thermometers that are there hold of it, C.
        limit_dph_per_c: Amplitude of a part of the bias that follows it from which these runs show it; None: never.
    """

    node: str
    there: bool
    apart_c: float
    unseen_c: float
    limit_dph_per_c: float | None


def places(scenario: str | Path, sensitivity: Sensitivity, *, noise: Noise, seed: int) -> list[Place]:
    """Every node but the sensor's own, the most telling first.

    Raises:
        InputError: The scenario's gyro has no other node.
    """
    found = node_temperatures(scenario, noise=noise, seed=seed)
    if len(found.runs[0]) < 2:
        raise InputError(f"{scenario}, gyro.node", "one node", "further nodes, where a thermometer could be")
    records = sensitivity.programme.records
    apart = {
        node: records.average([run[node] - run[found.sensor] for run in found.runs])
        for node in found.runs[0]
        if node != found.sensor
    }
    gains = Gains(sensitivity.search)
    there = [node for node in apart if node in found.there]
    ranked = []
    for node, column in apart.items():
        others = [apart[o] for o in there if o != node]
        white, plain = gains.whiten(column), column - column.mean()
        q = orthonormal(gains.map, *([gains.whiten(np.column_stack(others))] if others else []))
        own = white - q @ (q.T @ white)
        held = np.column_stack([sensitivity.bank.map, *others, np.ones(len(column))])
        rest = column - held @ np.linalg.lstsq(held, column, rcond=1e-9)[0]
        unseen = float(np.sqrt(np.mean(rest**2)))
        norm = float(np.linalg.norm(own)) / gains.scale
        limit = _D_FOUND / norm if unseen > _LEAST_C else None
        ranked.append(Place(node, node in there, float(np.sqrt(np.mean(plain**2))), unseen, limit))
    return sorted(ranked, key=lambda place: (place.there, place.limit_dph_per_c or np.inf))
