"""A second thermal node: the bias follows its temperature difference to the sensor (gas flow, alignment).

    tau dz/dt = T − z,    bias += a (z − T)

Source: in the two arms of the discharge Langmuir flow drags the light and cancels only while both are alike; a
temperature difference unbalances them (Podgorski and Aronowitz, "Langmuir flow effects in the laser gyro", IEEE
J. Quantum Electronics 4, 1968).
"""

from __future__ import annotations

import numpy as np

from .base import Array, Features, History, Parameter, Scene, Term, Values
from .memory import MemoryState, lagged
from .operators import first_order

__all__ = ["TERM", "Reference"]


def _bias(scene: Scene, values: Values, rng: np.random.Generator) -> Array:
    second_c = first_order(values["tau_s"], scene.time_s, scene.node_c)
    return np.asarray(values["amplitude_dph_per_c"] * (second_c - scene.node_c))


def _features(history: History, values: Values) -> Features:
    z, memory = lagged(history, values["tau_s"])
    return Features((z - history.temperature_c)[:, None], memory.known)


def _amplitudes(weights: Array) -> dict[str, float]:
    return {"amplitude_dph_per_c": float(weights[0])}


class Reference(MemoryState):
    """amplitude · (z − T)."""

    def __init__(self, values: Values, block_s: float, dtype: type[np.floating]) -> None:
        super().__init__(values["tau_s"], block_s, dtype)
        self._amplitude = dtype(values["amplitude_dph_per_c"])

    def value(self) -> float:
        """deg/h."""
        return float(self._dtype(self._amplitude * self._dtype(self.z - self.temperature)))


TERM = Term(
    id="thermal_gradient",
    family="thermal_memory",
    kind="add",
    equation="tau dz/dt = T - z; bias += amplitude (z - T)",
    source="Langmuir flow and alignment follow temperature differences in the block "
    "(Podgorski and Aronowitz 1968, Aronowitz and Lim 1979)",
    parameters=(
        Parameter("tau_s", "s", 60.0, 8000.0),
        Parameter("amplitude_dph_per_c", "deg/h/C", 1e-6, 1e-2, linear=True, signed=True),
    ),
    bias=_bias,
    features=_features,
    amplitudes=_amplitudes,
    reference=Reference,
)
