"""A recorded channel that the bias follows along a bent line: a straight line and two Gaussians of one width.

bias += slope (channel − reference) + first exp(−((channel − reference)/width)²)
    + second exp(−((channel − second_center)/width)²)

The reference is the first center: with the line that costs a table no word of its own.
"""

from __future__ import annotations

import math

import numpy as np

from ..common.arrays import FloatArray
from ..mirror.kinds import TableKind
from .auxiliary import channel_of
from .base import Cause, CauseValues, History, Needs, Parameter, Scene, Tabled, Telling, Wording, weights_of

_OCTAVES = math.sqrt(math.log2(math.e))  # exp(−x²) = 2^−(this x)²


def _columns(channel: FloatArray, values: CauseValues) -> FloatArray:
    """The line and both Gaussians, shape (n, 3)."""
    away = channel - values["reference"]
    bells = [np.exp(-((d / values["width"]) ** 2)) for d in (away, channel - values["second_center"])]
    return np.stack([away, *bells], axis=1)


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    weights = [values[name] for name in _LINEAR]
    return np.asarray(_columns(channel_of(scene.channel), values) @ weights)


def _features(history: History, values: CauseValues) -> FloatArray:
    return _columns(channel_of(history.channel), values)


def _record(values: CauseValues, block_s: float) -> list[float]:
    slope, first, second = (values[name] for name in _LINEAR)
    gain = _OCTAVES / values["width"]
    return [slope, gain, values["reference"], first, values["second_center"], second]


_LINEAR = ("slope_dph_per_unit", "first_dph", "second_dph")

CAUSE = Cause(
    id="auxiliary_curve",
    family="auxiliary",
    rank=101,
    kind="add",
    equation="bias += slope (channel - reference) + first exp(-((channel - reference) / width)^2) "
    "+ second exp(-((channel - second_center) / width)^2)",
    source="additive models; losses and Langmuir flow saturate, so the bias bends over the channel; needs the channel",
    parameters=(
        Parameter("reference", "unit", -1e9, 1e9, signed=True),
        Parameter("second_center", "unit", -1e9, 1e9, signed=True),
        Parameter("width", "unit", 1e-6, 1e9),
        Parameter("slope_dph_per_unit", "deg/h/unit", 1e-9, 1e3, linear=True, signed=True),
        Parameter("first_dph", "deg/h", 1e-9, 1e3, linear=True, signed=True),
        Parameter("second_dph", "deg/h", 1e-9, 1e3, linear=True, signed=True),
    ),
    words=Wording(
        name="The bias follows a recorded channel along a bent line",
        signature="residual is a bent function of the channel, the same at every temperature",
        remedy="a line and two Gaussians in the channel, or a better supply or shield",
        experiment="vary the channel by hand over its whole range at a constant temperature",
        telling=Telling.CHANNEL,
    ),
    table=Tabled(TableKind.CURVE, _record),
    needs=Needs(channel=True),
    bias=_bias,
    features=_features,
    amplitudes=weights_of(*_LINEAR),
)
