"""The cavity lags the temperature sensor: the bias acts on a filtered temperature.

tau dz/dt = T − z,    bias = f(z, dz/dt)    instead of f(T, dT/dt)
"""

from __future__ import annotations

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
    Tabled,
    Wording,
    blocks_per_tau,
    geometric,
    lagged,
    memory_gain,
)


def _cavity(scene: Scene, values: CauseValues) -> FloatArray:
    return first_order(values["tau_s"], scene.time_s, scene.cavity_c)


def _features(history: History, values: CauseValues) -> FloatArray:
    return lagged(history, values["tau_s"])


_TAU = Parameter("tau_s", "s", 60.0, 4000.0)


def _record(values: CauseValues, block_s: float) -> list[float]:
    return [memory_gain(block_s, values["tau_s"]), 0.0, blocks_per_tau(block_s, values["tau_s"])]


CAUSE = Cause(
    id="cavity_lag",
    family="thermal_memory",
    rank=10,
    kind="input",
    equation="tau dz/dt = T - z; bias = f(z, dz/dt)",
    source="first-order heat conduction from the sensor into the cavity; glass ceramics conduct poorly",
    parameters=(_TAU,),
    words=Wording(
        name="The cavity lags the temperature sensor",
        signature="residual loops over T that widen with the ramp rate and close in holds with the time constant",
        remedy="one first-order state: the map sees the cavity's temperature",
        experiment=ADVICE_MORE_RATES,
        advice="In the gyro it goes away with a thermometer on the block, which reads what the bias follows.",
    ),
    search=SearchRule(price=2, grid=geometric(_TAU, 22), over=_TAU.name, imitates=True),
    table=Tabled(TableKind.MEMORY, _record),
    cavity=_cavity,
    features=_features,
)
