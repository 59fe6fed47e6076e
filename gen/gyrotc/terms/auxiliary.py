"""A recorded channel (supply, discharge current, pressure, magnetic field) that the bias follows.

bias += slope (channel − reference)
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from .base import Array, Features, History, Needs, Parameter, Scene, Term, Values

__all__ = ["TERM", "Reference"]


def _channel(channel: Array | None) -> Array:
    if channel is None:
        raise InputError("auxiliary", "no channel is named", '"channel", the name of a recorded column')
    return channel


def _bias(scene: Scene, values: Values, rng: np.random.Generator) -> Array:
    departure = _channel(scene.channel) - values["reference"]
    return np.asarray(values["slope_dph_per_unit"] * departure)


def _features(history: History, values: Values) -> Features:
    """The channel as it is; its reference is a constant that the map holds."""
    channel = _channel(history.channel)
    return Features(channel[:, None], np.isfinite(channel))


def _amplitudes(weights: Array) -> dict[str, float]:
    return {"slope_dph_per_unit": float(weights[0]), "reference": 0.0}


class Reference:
    """slope · (block mean of the channel − reference)."""

    def __init__(self, values: Values, block_s: float, dtype: type[np.floating]) -> None:
        self._dtype = dtype
        self._slope = dtype(values["slope_dph_per_unit"])
        self._reference = dtype(values["reference"])
        self._mean = self._reference

    def start(self, value: float) -> None:
        """First sample of the channel."""
        self._mean = self._dtype(value)

    def step(self, mean: float) -> None:
        """Mean of the channel over a block."""
        self._mean = self._dtype(mean)

    def value(self) -> float:
        """deg/h."""
        return float(self._dtype(self._slope * self._dtype(self._mean - self._reference)))


TERM = Term(
    id="auxiliary",
    family="auxiliary",
    kind="add",
    equation="bias += slope (channel - reference)",
    source="null shift from discharge current, supply, pressure or magnetic field; needs the channel",
    parameters=(
        Parameter("slope_dph_per_unit", "deg/h/unit", 1e-9, 1e3, linear=True, signed=True),
        Parameter("reference", "unit", -1e9, 1e9, linear=True, logarithmic=False, default=0.0),
    ),
    needs=Needs(channel=True),
    bias=_bias,
    features=_features,
    amplitudes=_amplitudes,
    reference=Reference,
)
