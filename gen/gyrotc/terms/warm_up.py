"""Warm-up: fades with the time since power-on whatever T does (discharge, electrodes, electronics).

bias += A exp(−t_on/tau)
"""

from __future__ import annotations

import numpy as np

from .base import Array, Features, History, Needs, Parameter, Scene, Term, Values

__all__ = ["TERM", "Reference"]


def _bias(scene: Scene, values: Values, rng: np.random.Generator) -> Array:
    return np.asarray(values["amplitude_dph"] * _fading(scene.on_s, values["tau_s"]))


def _fading(on_s: Array, tau_s: float) -> Array:
    return np.where(on_s >= 0.0, np.exp(-np.maximum(on_s, 0.0) / tau_s), 0.0)


def _features(history: History, values: Values) -> Features:
    """Nothing is known where the time of power-on is not."""
    if history.on_s is None:
        none = np.zeros(len(history.time_s))
        return Features(none[:, None], none.astype(bool))
    return Features(_fading(history.on_s, values["tau_s"])[:, None], history.on_s >= 0.0)


def _amplitudes(weights: Array) -> dict[str, float]:
    return {"amplitude_dph": float(weights[0])}


class Reference:
    """amplitude · exp(−t_on/tau), multiplied down by one factor for each block."""

    def __init__(self, values: Values, block_s: float, dtype: type[np.floating]) -> None:
        self._dtype = dtype
        self._decay = dtype(np.exp(-block_s / values["tau_s"]))
        self._value = dtype(values["amplitude_dph"])

    def start(self, value: float) -> None:
        """The clock runs from power-on, not from the first valid temperature."""

    def step(self, mean: float) -> None:
        """A block has passed."""
        self._value = self._dtype(self._decay * self._value)

    def value(self) -> float:
        """deg/h."""
        return float(self._value)


TERM = Term(
    id="warm_up",
    family="power_on",
    kind="add",
    equation="bias += amplitude exp(-t_on/tau)",
    source="start-up drift: discharge, clean-up of the gas at the electrodes, dither, electronics",
    parameters=(
        Parameter("tau_s", "s", 200.0, 8000.0),
        Parameter("amplitude_dph", "deg/h", 1e-5, 1e-1, linear=True, signed=True),
    ),
    needs=Needs(power_on=True),
    bias=_bias,
    features=_features,
    amplitudes=_amplitudes,
    reference=Reference,
)
