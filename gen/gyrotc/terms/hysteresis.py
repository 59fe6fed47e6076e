"""Rate-independent hysteresis: a play operator, as mounts, glue joints and mirror contacts show.

    z = max(T − w, min(T + w, z)),    bias += a (z − T)

Source: the play of Krasnosel'skii and Pokrovskii, Systems with Hysteresis, Springer 1989.
"""

from __future__ import annotations

import numpy as np

from .base import Array, Features, History, Parameter, Scene, Term, Values
from .operators import play

__all__ = ["TERM", "Reference"]


def _bias(scene: Scene, values: Values, rng: np.random.Generator) -> Array:
    z = play(values["width_c"], scene.cavity_c)
    return np.asarray(values["amplitude_dph_per_c"] * (z - scene.cavity_c))


def _features(history: History, values: Values) -> Features:
    """z starts at T; known from the first excursion over the whole width 2w on."""
    temperature = history.temperature_c
    z = play(values["width_c"], temperature)
    span = np.maximum.accumulate(temperature) - np.minimum.accumulate(temperature)
    return Features((z - temperature)[:, None], span >= 2.0 * values["width_c"])


def _amplitudes(weights: Array) -> dict[str, float]:
    return {"amplitude_dph_per_c": float(weights[0])}


class Reference:
    """z ← max(T − w, min(T + w, z)); amplitude · (z − T)."""

    def __init__(self, values: Values, block_s: float, dtype: type[np.floating]) -> None:
        self._dtype = dtype
        self._width = dtype(values["width_c"])
        self._amplitude = dtype(values["amplitude_dph_per_c"])
        self.z = self.temperature = dtype(0.0)

    def start(self, value: float) -> None:
        """Play without slack on either side at the first valid temperature, C."""
        self.z = self.temperature = self._dtype(value)

    def step(self, mean: float) -> None:
        """Takes in the mean temperature of a block, C."""
        self.temperature = self._dtype(mean)
        low = self._dtype(self.temperature - self._width)
        high = self._dtype(self.temperature + self._width)
        self.z = max(low, min(high, self.z))

    def value(self) -> float:
        """deg/h."""
        return float(self._dtype(self._amplitude * self._dtype(self.z - self.temperature)))


TERM = Term(
    id="hysteresis",
    family="hysteresis",
    kind="add",
    equation="z = max(T - w, min(T + w, z)); bias += amplitude (z - T)",
    source="play operator of Prandtl and Ishlinskii (Visintin 1994; Brokate and Sprekels 1996)",
    parameters=(
        Parameter("width_c", "C", 0.5, 40.0),
        Parameter("amplitude_dph_per_c", "deg/h/C", 1e-6, 1e-3, linear=True, signed=True),
    ),
    bias=_bias,
    features=_features,
    amplitudes=_amplitudes,
    reference=Reference,
)
