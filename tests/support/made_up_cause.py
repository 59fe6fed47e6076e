"""A cause that the catalogue does not have, in one file as any other: the bias follows the rate of a second node.

    tau dz/dt = T − z,    bias += b dz/dt

On the target it is a memory with the amplitude −60 b/tau.
"""

from __future__ import annotations

import numpy as np
from gyrotc.causes import (
    ADVICE_MORE_RATES,
    Cause,
    CauseValues,
    History,
    Parameter,
    Scene,
    SearchRule,
    Tabled,
    Wording,
    geometric,
    lagged,
    memory_gain,
    weights_of,
)
from gyrotc.common import FloatArray
from gyrotc.mirror import TableKind, first_order

TAU = Parameter("tau_s", "s", 60.0, 8000.0)


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    z = first_order(values["tau_s"], scene.time_s, scene.node_c)
    return np.asarray(values["slope_dph_min_per_c"] * (scene.node_c - z) * 60.0 / values["tau_s"])


def _features(history: History, values: CauseValues) -> FloatArray:
    return lagged(history, values["tau_s"])[:, 1:]


def _record(values: CauseValues, block_s: float) -> list[float]:
    amplitude = -60.0 * values["slope_dph_min_per_c"] / values["tau_s"]
    return [memory_gain(block_s, values["tau_s"]), amplitude, 0.0]


CAUSE = Cause(
    id="slow_rate",
    family="thermal_memory",
    rank=25,
    kind="add",
    equation="tau dz/dt = T - z; bias += slope dz/dt",
    source="made up",
    parameters=(
        TAU,
        Parameter("slope_dph_min_per_c", "deg/h per C/min", 1e-6, 1e-1, linear=True, signed=True),
    ),
    words=Wording(
        name="The bias follows the temperature rate of a second node",
        signature="residual follows the ramp and fades in holds",
        remedy="one first-order state and a linear term",
        experiment=ADVICE_MORE_RATES,
    ),
    search=SearchRule(price=2, grid=geometric(TAU, 24), over=TAU.name, imitates=True),
    table=Tabled(TableKind.MEMORY, _record),
    bias=_bias,
    features=_features,
    amplitudes=weights_of("slope_dph_min_per_c"),
)
