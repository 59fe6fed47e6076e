"""Warm-up: fades with the time since power-on whatever T does (discharge, electrodes, electronics).

bias += A exp(−t_on/tau)
"""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from ..mirror.kinds import TableKind
from .base import (
    COLD_STARTS,
    Cause,
    CauseValues,
    History,
    Needs,
    Parameter,
    Scene,
    SearchRule,
    Tabled,
    Telling,
    Wording,
    geometric,
    half_block_before,
    octaves_per_block,
    weights_of,
)


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    return np.asarray(values["amplitude_dph"] * _fading(scene.on_s, values["tau_s"]))


def _fading(on_s: FloatArray, tau_s: float) -> FloatArray:
    return np.where(on_s >= 0.0, np.exp(-np.maximum(on_s, 0.0) / tau_s), 0.0)


def _features(history: History, values: CauseValues) -> FloatArray:
    """0 where the time of power-on is not known, or so long before the run that nothing is left of a warm-up."""
    on_s, tau_s = history.on_s, values["tau_s"]
    if on_s is None or on_s[0] > _OVER * tau_s:
        return np.zeros((len(history.time_s), 1))
    return _fading(on_s, tau_s)[:, None]


_OVER = 7.0  # time constants after which less than a thousandth is left: what fades then began later than power-on
_TAU = Parameter("tau_s", "s", 200.0, 8000.0)


def _record(values: CauseValues, block_s: float) -> list[float]:
    tau_s = values["tau_s"]
    middle = 1.0 / half_block_before(block_s, tau_s)  # the target counts to the start of a block
    return [octaves_per_block(block_s, tau_s), values["amplitude_dph"] * middle]


CAUSE = Cause(
    id="warm_up",
    family="power_on",
    rank=50,
    kind="add",
    equation="bias += amplitude exp(-t_on/tau)",
    source="start-up drift: discharge, clean-up of the gas at the electrodes, dither, electronics",
    parameters=(_TAU, Parameter("amplitude_dph", "deg/h", 1e-5, 1e-1, linear=True, signed=True)),
    words=Wording(
        name="The bias settles after power-on whatever the temperature is",
        signature="residuals of all runs agree over the time since power-on",
        remedy="one exponential of the time since power-on",
        experiment="cold starts at two constant chamber temperatures, and a hot restart",
        telling=Telling.COLD_START,
        beside={"thermal_gradient": COLD_STARTS, "cavity_lag": COLD_STARTS},
        recording="note the time of power-on of every run (power_on_s)",
        advice="In use, wait for three time constants after power-on; in the gyro, it shrinks with less power in the "
        "housing.",
    ),
    search=SearchRule(price=2, grid=geometric(_TAU, 12), over=_TAU.name, imitates=True),
    table=Tabled(TableKind.WARM_UP, _record),
    needs=Needs(power_on=True),
    bias=_bias,
    features=_features,
    amplitudes=weights_of("amplitude_dph"),
)
