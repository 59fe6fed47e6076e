"""Static structure finer than any map of `train` resolves. It looks like memory, and no term of a table holds it.

bias += A tanh((T − T0)/w)
"""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from .base import Cause, CauseValues, History, Parameter, Scene, SearchRule, Telling, Wording, anywhere


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    return np.asarray(values["amplitude_dph"] * np.tanh((scene.cavity_c - values["at_c"]) / values["width_c"]))


def _features(history: History, values: CauseValues) -> FloatArray:
    """Hat functions of T, one each `width_c` over −60 ... 100 C: any shape of that fineness is in their span."""
    nodes = np.arange(-60.0, 100.0, values["width_c"])
    distance = np.abs(history.temperature_c[:, None] - nodes) / values["width_c"]
    return np.asarray(np.maximum(0.0, 1.0 - distance))


CAUSE = Cause(
    id="map_too_coarse",
    family="static_map",
    rank=80,
    kind="static",
    equation="bias += amplitude tanh((T - at)/width)",
    source="a steep place in the static map",
    parameters=(
        Parameter("width_c", "C", 2.0, 10.0, default=3.0),
        Parameter("at_c", "C", -40.0, 70.0, default=20.0),
        Parameter("amplitude_dph", "deg/h", 1e-5, 1e-2, linear=True, signed=True),
    ),
    words=Wording(
        name="The static map is too coarse",
        signature="residual repeats over T, heating and cooling alike, finer than the map",
        remedy="no map follows it, and more centers hardly help: count it in the error budget, or find its source in "
        "the gyro, such as a relay, a resonance or the glass transition of an adhesive",
        experiment="one slow ramp over the full range in both directions",
        telling=Telling.STATIC,
    ),
    search=SearchRule(price=1, grid=anywhere, needed_d=9.0),
    bias=_bias,
    features=_features,
)
