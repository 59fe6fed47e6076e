"""The temperature record is late or early: another clock, a filter's delay. Mended in the data, not in C.

recorded T(t) = T(t − shift)
"""

from __future__ import annotations

import numpy as np

from .base import Array, Features, History, Parameter, Scene, Term, Values
from .operators import delayed

__all__ = ["TERM"]


def _record(scene: Scene, values: Values) -> Array:
    return delayed(values["shift_s"], scene.time_s, scene.sensed_c)


def _features(history: History, values: Values) -> Features:
    shift = values["shift_s"]
    true_c = delayed(-shift, history.time_s, history.temperature_c)
    then = history.time_s + shift
    known = (then >= history.time_s[0]) & (then <= history.time_s[-1])
    return Features(np.column_stack((true_c, 60.0 * np.gradient(true_c, history.time_s))), known)


TERM = Term(
    id="time_misalignment",
    family="thermal_memory",
    kind="input",
    equation="T_recorded(t) = T(t - shift); bias = f(T, dT/dt)",
    source="clocks of two recorders, group delay of a filter in one channel only",
    parameters=(Parameter("shift_s", "s", 5.0, 1200.0, signed=True),),
    record=_record,
    features=_features,
)
