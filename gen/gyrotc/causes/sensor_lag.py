"""The sensor lags the cavity: a negative control.

If tau dT_s/dt = T − T_s then T = T_s + tau dT_s/dt exactly, so f(T) is again a static function of (T_s,
dT_s/dt):
a static map absorbs it and nothing in its residual can show it. There is nothing to fit and no reference.
"""

from __future__ import annotations

from ..common.arrays import FloatArray
from ..mirror.recursions import first_order
from .base import ADVICE_MORE_RATES, Cause, CauseValues, Parameter, Scene, Wording


def _record(scene: Scene, values: CauseValues) -> FloatArray:
    return first_order(values["tau_s"], scene.time_s, scene.sensed_c)


CAUSE = Cause(
    id="sensor_lag",
    family="control",
    rank=110,
    kind="record",
    equation="tau dT_s/dt = T - T_s; f(T) = f(T_s + tau dT_s/dt)",
    source="identity; a static map of (T_s, dT_s/dt) absorbs it",
    parameters=(Parameter("tau_s", "s", 10.0, 1000.0),),
    words=Wording(
        name="The temperature sensor lags the cavity",
        signature="none: a static map absorbs it",
        remedy="none is needed",
        experiment=ADVICE_MORE_RATES,
    ),
    record=_record,
)
