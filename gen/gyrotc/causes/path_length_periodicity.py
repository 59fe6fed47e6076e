"""Path-length periodicity: the phase of backscatter turns with the optical path, so the bias waves over T.

    bias += A cos(2 pi T/P + phi)

The period P is lambda/(alpha L): 11 C for a 0.28 m path, 633 nm and alpha = 2e-7/C.
Source: Aronowitz, "Fundamentals of the ring laser gyro", in Optical Gyros and their Application, RTO AGARDograph
339, 1999.
"""

from __future__ import annotations

import math

import numpy as np

from ..common.arrays import FloatArray
from ..mirror.kinds import TableKind
from .base import (
    OVERTONES,
    Cause,
    CauseValues,
    History,
    Parameter,
    Reach,
    Scene,
    SearchRule,
    Tabled,
    Telling,
    Wording,
    turns,
)


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    phase = 2.0 * math.pi * scene.cavity_c / values["period_c"] + values["phase_rad"]
    return np.asarray(values["amplitude_dph"] * np.cos(phase))


def _features(history: History, values: CauseValues) -> FloatArray:
    angle = 2.0 * math.pi * history.temperature_c / values["period_c"]
    numbers = range(1, 2 + int(values.get(OVERTONES, 0)))
    columns = [wave(number * angle) for number in numbers for wave in (np.cos, np.sin)]
    return np.column_stack(columns)


def _amplitudes(weights: FloatArray) -> dict[str, float]:
    """a cos x + b sin x = A cos(x + phase)."""
    return {
        "amplitude_dph": float(np.hypot(weights[0], weights[1])),
        "phase_rad": float(np.arctan2(-weights[1], weights[0])),
    }


_PERIOD = Parameter("period_c", "C", 3.0, 60.0)


def _grid(reach: Reach) -> list[CauseValues]:
    """Even in waves over the range: from 0.7 of it on a wave is no longer distinguished from the map."""
    longest = min(_PERIOD.high, 0.7 * reach.span_c)
    if longest <= _PERIOD.low:
        return []
    waves = np.arange(1.0 / longest, 1.0 / _PERIOD.low, 1.0 / (3.0 * reach.span_c))
    return [{_PERIOD.name: float(1.0 / w)} for w in waves]


def _overtone(values: CauseValues, number: float) -> dict[str, float]:
    return {_PERIOD.name: values[_PERIOD.name] / number}


def _record(values: CauseValues, block_s: float) -> list[float]:
    return [1.0 / values["period_c"], turns(values["phase_rad"]), values["amplitude_dph"]]


CAUSE = Cause(
    id="path_length_periodicity",
    family="static_map",
    rank=90,
    kind="add",
    equation="bias += amplitude cos(2 pi T/period + phase)",
    source="backscatter phase under path-length control (Rodloff 1987)",
    parameters=(
        _PERIOD,
        Parameter("amplitude_dph", "deg/h", 1e-6, 1e-2, linear=True),
        Parameter("phase_rad", "rad", -math.pi, math.pi, linear=True, default=0.0),
    ),
    words=Wording(
        name="The bias is periodic in temperature",
        signature="residual waves over T with one period and the same phase heating and cooling",
        remedy="a sine and a cosine of T, with overtones where the wave is no sine",
        experiment="one slow ramp over the full range in both directions",
        telling=Telling.STATIC,
        beside={"map_too_coarse": "one slow ramp over the full range (0.5 C/min)"},
    ),
    search=SearchRule(
        price=3,
        grid=_grid,
        over=_PERIOD.name,
        needed_d=6.6,
        width=lambda here, span_c: here**2 / (4.0 * span_c),
        twice=True,
    ),
    table=Tabled(TableKind.HARMONIC, _record),
    bias=_bias,
    features=_features,
    amplitudes=_amplitudes,
    overtone=_overtone,
)
