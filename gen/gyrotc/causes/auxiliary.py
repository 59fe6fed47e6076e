"""A recorded channel (supply, discharge current, pressure, magnetic field) that the bias follows.

bias += slope (channel − reference)
"""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..mirror.kinds import TableKind
from .base import (
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
    anywhere,
)


def channel_of(channel: FloatArray | None) -> FloatArray:
    """The channel that a term names.

    Raises:
        InputError: It names none.
    """
    if channel is None:
        raise InputError("auxiliary", "no channel is named", '"channel", the name of a recorded column')
    return channel


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    departure = channel_of(scene.channel) - values["reference"]
    return np.asarray(values["slope_dph_per_unit"] * departure)


def _features(history: History, values: CauseValues) -> FloatArray:
    """The channel as it is; its reference is a constant that the map holds."""
    return channel_of(history.channel)[:, None]


def _amplitudes(weights: FloatArray) -> dict[str, float]:
    return {"slope_dph_per_unit": float(weights[0]), "reference": 0.0}


def _record(values: CauseValues, block_s: float) -> list[float]:
    return [values["slope_dph_per_unit"], values["reference"]]


CAUSE = Cause(
    id="auxiliary",
    family="auxiliary",
    rank=100,
    kind="add",
    equation="bias += slope (channel - reference)",
    source="null shift from discharge current, supply, pressure or magnetic field; needs the channel",
    parameters=(
        Parameter("slope_dph_per_unit", "deg/h/unit", 1e-9, 1e3, linear=True, signed=True),
        Parameter("reference", "unit", -1e9, 1e9, linear=True, default=0.0),
    ),
    words=Wording(
        name="The bias follows a recorded channel",
        signature="residual is proportional to the channel, and not to the channel shifted in time",
        remedy="a linear term in the channel, or a better supply or shield",
        experiment="vary the channel by hand at a constant temperature",
        telling=Telling.CHANNEL,
    ),
    search=SearchRule(price=1, grid=anywhere),
    table=Tabled(TableKind.AUXILIARY, _record),
    needs=Needs(channel=True),
    bias=_bias,
    features=_features,
    amplitudes=_amplitudes,
)
