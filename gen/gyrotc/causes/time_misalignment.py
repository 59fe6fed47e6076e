"""The temperature record is late or early: another clock, a filter's delay. Mended in the data, not in C.

recorded T(t) = T(t − shift)
"""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from ..mirror.recursions import delayed
from .base import ADVICE_MORE_RATES, CORNERS, Cause, CauseValues, History, Parameter, Reach, Scene, SearchRule, Wording

_NEAR_S = 50.0 * np.arange(1, 13)  # of the grid, to either side
_FAR_S = np.arange(700.0, 1201.0, 100.0)
"""Beyond it: between two of them falls 0.02 % of the energy of a smooth map, between two of the near ones 0.15 %."""
_FAR_SHARE = 0.1  # of the longest run: farther shifts put too much of a run's ends out of sight
_MARGIN_S = 150.0  # beside the shift itself: half the window of dT/dt, and a block


def _record(scene: Scene, values: CauseValues) -> FloatArray:
    return delayed(values["shift_s"], scene.time_s, scene.sensed_c)


def _features(history: History, values: CauseValues) -> FloatArray:
    true_c = delayed(-values["shift_s"], history.time_s, history.temperature_c)
    return np.column_stack((true_c, 60.0 * np.gradient(true_c, history.time_s)))


def _grid(reach: Reach) -> list[CauseValues]:
    most = _FAR_SHARE * reach.longest_s
    steps = np.concatenate([_NEAR_S, [s for s in _FAR_S if s <= most]])
    return [{"shift_s": float(s)} for s in np.concatenate([-steps[::-1], steps])]


def _mended(
    time_s: FloatArray, temperature_c: FloatArray, slope: FloatArray, values: CauseValues
) -> tuple[FloatArray, FloatArray]:
    """Not a number where the temperature of that time was not recorded."""
    later = time_s + values["shift_s"]
    true_c, true_slope = (np.interp(later, time_s, x, left=np.nan, right=np.nan) for x in (temperature_c, slope))
    return true_c, true_slope


def _unseen_s(values: CauseValues) -> float:
    return abs(values["shift_s"]) + _MARGIN_S


def _repair(values: CauseValues) -> str:
    return f"temperature_late_s = {values['shift_s']:.0f}"


CAUSE = Cause(
    id="time_misalignment",
    family="thermal_memory",
    rank=30,
    kind="input",
    equation="T_recorded(t) = T(t - shift); bias = f(T, dT/dt)",
    source="clocks of two recorders, group delay of a filter in one channel only",
    parameters=(Parameter("shift_s", "s", 5.0, 1200.0, signed=True),),
    words=Wording(
        name="Temperature and rate are not recorded at the same time",
        signature="residual follows the second derivative of T at the corners of ramps",
        remedy="mend the clocks or the filter of the recording; no term on the target",
        experiment=ADVICE_MORE_RATES,
        beside={"cavity_lag": CORNERS, "thermal_gradient": CORNERS},
        advice="Mend the clocks or filters of the recording; no term on the target stands for them, where the "
        "thermometer is read in time.",
    ),
    search=SearchRule(
        price=2,
        grid=_grid,
        over="shift_s",
        width=lambda here, span_c: 45.0,
        step=5.0,
        imitates=True,
    ),
    mended=_mended,
    unseen_s=_unseen_s,
    repair=_repair,
    record=_record,
    features=_features,
)
