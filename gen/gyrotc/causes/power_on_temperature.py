"""Power-on temperature: every power-on sets an offset by the temperature that it finds. In no map: it knows one T.

bias += slope · (T at power-on − 20 C), for the whole run
"""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from .base import (
    Cause,
    CauseValues,
    History,
    Needs,
    Parameter,
    Scene,
    SearchRule,
    Telling,
    Wording,
    anywhere,
    weights_of,
)

_REPEATED = "the same hold after power-ons at three temperatures, each twice"
ROOM_C = 20.0  # room temperature: where an offset counts as none, and a fixture is aligned


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    found_c = scene.node_c[int(np.argmax(scene.on_s >= 0.0))]
    return np.full(len(scene.time_s), values["slope_dph_per_c"] * (found_c - ROOM_C))


def _features(history: History, values: CauseValues) -> FloatArray:
    """The first reading stands for the temperature at power-on: a run that was soaked before it had the same."""
    found_c = float(history.temperature_c[0])
    return np.full((len(history.time_s), 1), found_c - ROOM_C)


CAUSE = Cause(
    id="power_on_temperature",
    family="between_runs",
    rank=65,
    kind="add",
    equation="bias += slope (T at power-on - 20 C), for the whole run",
    source="start-up of discharge and path-length control: the mode that is taken depends on the length found",
    parameters=(Parameter("slope_dph_per_c", "deg/h/C", 1e-7, 1e-1, linear=True, signed=True),),
    words=Wording(
        name="Every power-on sets an offset by the temperature that it finds",
        signature="means of the runs follow the temperature at power-on",
        remedy="no map holds it: switch on at one temperature, or re-zero in the first minutes at rest",
        experiment=_REPEATED,
        telling=Telling.REPEATS,
        beside={"turn_on_offset": _REPEATED, "ageing": _REPEATED},
        recording="record three runs or more that are switched on at different temperatures, with their power_on_s",
    ),
    search=SearchRule(price=1, grid=anywhere, imitates=True),
    needs=Needs(runs=3, power_on=True),
    bias=_bias,
    features=_features,
    amplitudes=weights_of("slope_dph_per_c"),
)
