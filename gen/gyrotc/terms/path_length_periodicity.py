"""Path-length periodicity: the phase of backscatter turns with the optical path, so the bias waves over T.

    bias += A cos(2 pi T/P + phi)

The period P is lambda/(alpha L): 11 C for a 0.28 m path, 633 nm and alpha = 2e-7/C.
Source: Aronowitz, "Fundamentals of the ring laser gyro", in Optical Gyros and their Application, RTO AGARDograph
339, 1999.
"""

from __future__ import annotations

import math

import numpy as np

from .base import Array, Features, History, Parameter, Scene, Term, Values

__all__ = ["TERM", "Reference"]


def _bias(scene: Scene, values: Values, rng: np.random.Generator) -> Array:
    phase = 2.0 * math.pi * scene.cavity_c / values["period_c"] + values["phase_rad"]
    return np.asarray(values["amplitude_dph"] * np.cos(phase))


def _features(history: History, values: Values) -> Features:
    angle = 2.0 * math.pi * history.temperature_c / values["period_c"]
    known = np.ones(len(angle), dtype=bool)
    return Features(np.column_stack((np.cos(angle), np.sin(angle))), known)


def _amplitudes(weights: Array) -> dict[str, float]:
    """a cos x + b sin x = A cos(x + phase)."""
    return {
        "amplitude_dph": float(np.hypot(weights[0], weights[1])),
        "phase_rad": float(np.arctan2(-weights[1], weights[0])),
    }


class Reference:
    """amplitude · cos(2π T/period + phase); the cosine is taken in float64 and rounded."""

    def __init__(self, values: Values, block_s: float, dtype: type[np.floating]) -> None:
        self._dtype = dtype
        self._values = dict(values)
        self._temperature = 0.0

    def start(self, value: float) -> None:
        """First valid temperature, C."""
        self._temperature = value

    def step(self, mean: float) -> None:
        """Takes in the mean temperature of a block, C."""
        self._temperature = mean

    def value(self) -> float:
        """deg/h."""
        angle = 2.0 * math.pi * self._temperature / self._values["period_c"] + self._values["phase_rad"]
        return float(self._dtype(self._values["amplitude_dph"] * math.cos(angle)))


TERM = Term(
    id="path_length_periodicity",
    family="static_map",
    kind="add",
    equation="bias += amplitude cos(2 pi T/period + phase)",
    source="backscatter phase under path-length control (Rodloff 1987)",
    parameters=(
        Parameter("period_c", "C", 3.0, 60.0),
        Parameter("amplitude_dph", "deg/h", 1e-6, 1e-2, linear=True),
        Parameter("phase_rad", "rad", -math.pi, math.pi, linear=True, default=0.0),
    ),
    bias=_bias,
    features=_features,
    amplitudes=_amplitudes,
    reference=Reference,
)
