"""A second thermal node: the bias follows its temperature difference to the sensor (gas flow, alignment).

    tau dz/dt = T − z,    bias += a (z − T)

Source: in the two arms of the discharge Langmuir flow drags the light and cancels only while both are alike; a
temperature difference unbalances them (Podgorski and Aronowitz, "Langmuir flow effects in the laser gyro", IEEE
J. Quantum Electronics 4, 1968).
"""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from ..mirror.kinds import TableKind
from ..mirror.recursions import first_order
from .base import (
    ADVICE_MORE_RATES,
    Cause,
    CauseValues,
    History,
    Parameter,
    Scene,
    SearchRule,
    SingleCycle,
    Tabled,
    Wording,
    geometric,
    half_block_before,
    lagged,
    memory_gain,
    weights_of,
)


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    second_c = first_order(values["tau_s"], scene.time_s, scene.node_c)
    return np.asarray(values["amplitude_dph_per_c"] * (second_c - scene.node_c))


def _features(history: History, values: CauseValues) -> FloatArray:
    return lagged(history, values["tau_s"])[:, :1] - history.temperature_c[:, None]


_TAU = Parameter("tau_s", "s", 60.0, 8000.0)


def _record(values: CauseValues, block_s: float) -> list[float]:
    tau_s = values["tau_s"]
    return [memory_gain(block_s, tau_s), values["amplitude_dph_per_c"] * half_block_before(block_s, tau_s), 0.0]


CAUSE = Cause(
    id="thermal_gradient",
    family="thermal_memory",
    rank=20,
    kind="add",
    equation="tau dz/dt = T - z; bias += amplitude (z - T)",
    source="Langmuir flow and alignment follow temperature differences in the block "
    "(Podgorski and Aronowitz 1968, Aronowitz and Lim 1979)",
    parameters=(_TAU, Parameter("amplitude_dph_per_c", "deg/h/C", 1e-6, 1e-2, linear=True, signed=True)),
    words=Wording(
        name="The bias follows a temperature difference inside the gyro",
        signature="residual follows the ramp with the same size at every temperature and fades in holds",
        remedy="one first-order state and a linear term",
        experiment=ADVICE_MORE_RATES,
        advice="In the gyro it shrinks with a better thermal path between block and housing, with a cover against the "
        "air stream of the chamber, or with a second thermometer where the gradient begins. A fixture that tilts with "
        "a temperature of its own shows the same through Earth's rate (5e-5 deg/h for each arcsec at 45 degrees): "
        "repeat a run with the gyro rotated by 180 degrees; what then changes its sign is the fixture's.",
    ),
    search=SearchRule(
        price=2,
        grid=geometric(_TAU, 24),
        over=_TAU.name,
        twice=True,
        imitates=True,
        cycle=SingleCycle(points=48, usual=True),
    ),
    table=Tabled(TableKind.MEMORY, _record),
    bias=_bias,
    features=_features,
    amplitudes=weights_of("amplitude_dph_per_c"),
)
