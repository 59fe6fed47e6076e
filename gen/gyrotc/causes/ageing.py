"""Ageing between the runs: helium loss, wear of the electrodes, creep. Never extrapolated by a table.

bias += slope · d0 log(1 + day/d0): a straight line for a large d0 (the default), and the same amount for
every log unit of time, slope · d0, for a small one.
"""

from __future__ import annotations

import math

import numpy as np

from ..common.arrays import FloatArray
from .base import Cause, CauseValues, History, Needs, Parameter, Reach, Scene, SearchRule, Telling, Wording, weights_of

_STRAIGHT = math.inf


def _passed(day: float, d0_day: float) -> float:
    return day if math.isinf(d0_day) else d0_day * math.log1p(day / d0_day)


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    amount = values["slope_dph_per_day"] * _passed(scene.day, values["d0_day"])
    return np.full(len(scene.time_s), amount)


def _features(history: History, values: CauseValues) -> FloatArray:
    """0 for a run without a date: nothing is known of it."""
    amount = _passed(history.day, values.get("d0_day", _STRAIGHT)) if history.day is not None else 0.0
    return np.full((len(history.time_s), 1), amount)


def _grid(reach: Reach) -> list[CauseValues]:
    """A straight line, and a course that is logarithmic from the second day on."""
    return [{"d0_day": _STRAIGHT}, {"d0_day": 2.0}]


CAUSE = Cause(
    id="ageing",
    family="between_runs",
    rank=70,
    kind="add",
    equation="bias += slope d0 log(1 + day/d0)",
    source="long-term bias drift; d0 large: linear",
    parameters=(
        Parameter("d0_day", "day", 0.1, _STRAIGHT, default=_STRAIGHT),
        Parameter("slope_dph_per_day", "deg/h/day", 1e-7, 1e-2, linear=True, signed=True),
    ),
    words=Wording(
        name="The bias drifts from run to run with the date",
        signature="means of the runs follow the calendar",
        remedy="calibrate again in time; a table must not extrapolate it",
        experiment="three or more repeats of one hold with power cycles between them",
        telling=Telling.REPEATS,
        recording="record on three dates or more and note them (started)",
    ),
    search=SearchRule(price=1, grid=_grid),
    needs=Needs(runs=3, dates=3),
    bias=_bias,
    features=_features,
    amplitudes=weights_of("slope_dph_per_day"),
)
