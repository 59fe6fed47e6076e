"""A recorded channel that the bias follows with a slope that depends on the temperature.

bias += (slope + growth (T − reference_c)) (channel − reference)
"""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from ..common.inputs import PLAUSIBLE_C
from ..mirror.kinds import TableKind
from .auxiliary import channel_of
from .base import Cause, CauseValues, History, Needs, Parameter, Scene, Tabled, Telling, Wording, weights_of

_LINEAR = ("slope_dph_per_unit", "slope_dph_per_unit_per_c")


def _columns(temperature_c: FloatArray, channel: FloatArray, values: CauseValues) -> FloatArray:
    """The line, and the line times the temperature, shape (n, 2)."""
    away = channel - values["reference"]
    return np.stack([away, (temperature_c - values["reference_c"]) * away], axis=1)


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    weights = [values[name] for name in _LINEAR]
    return np.asarray(_columns(scene.cavity_c, channel_of(scene.channel), values) @ weights)


def _features(history: History, values: CauseValues) -> FloatArray:
    return _columns(history.temperature_c, channel_of(history.channel), values)


def _record(values: CauseValues, block_s: float) -> list[float]:
    slope, growth = (values[name] for name in _LINEAR)
    return [slope, values["reference"], growth, values["reference_c"]]


CAUSE = Cause(
    id="auxiliary_product",
    family="auxiliary",
    rank=102,
    kind="add",
    equation="bias += (slope + growth (T - reference_c)) (channel - reference)",
    source="gain and losses of the laser change with temperature, and with them how the bias follows a channel; "
    "needs the channel",
    parameters=(
        Parameter("reference", "unit", -1e9, 1e9, signed=True),
        Parameter("reference_c", "C", *PLAUSIBLE_C, signed=True),
        Parameter("slope_dph_per_unit", "deg/h/unit", 1e-9, 1e3, linear=True, signed=True),
        Parameter("slope_dph_per_unit_per_c", "deg/h/unit/C", 1e-9, 1e3, linear=True, signed=True),
    ),
    words=Wording(
        name="The bias follows a recorded channel with a slope that depends on temperature",
        signature="residual is proportional to the channel, more at some temperatures than at others",
        remedy="a line in the channel times a line in temperature, or a better supply or shield",
        experiment="vary the channel by hand at two constant temperatures",
        telling=Telling.CHANNEL,
    ),
    table=Tabled(TableKind.PRODUCT, _record),
    needs=Needs(channel=True),
    bias=_bias,
    features=_features,
    amplitudes=weights_of(*_LINEAR),
)
