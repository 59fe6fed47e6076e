"""The cavity lags the temperature sensor: the bias acts on a filtered temperature.

tau dz/dt = T − z,    bias = f(z, dz/dt)    instead of f(T, dT/dt)
"""

from __future__ import annotations

import numpy as np

from .base import Array, Features, History, Parameter, Scene, Term, Values
from .memory import MemoryState, lagged
from .operators import first_order

__all__ = ["TERM", "Reference"]


def _cavity(scene: Scene, values: Values) -> Array:
    return first_order(values["tau_s"], scene.time_s, scene.cavity_c)


def _features(history: History, values: Values) -> Features:
    return lagged(history, values["tau_s"])[1]


class Reference(MemoryState):
    """Adds nothing of its own: the map sees (`z`, `slope()`) instead of (T, dT/dt)."""

    def value(self) -> float:
        """Nothing is added, deg/h."""
        return 0.0


def _reference(values: Values, block_s: float, dtype: type[np.floating]) -> Reference:
    return Reference(values["tau_s"], block_s, dtype)


TERM = Term(
    id="cavity_lag",
    family="thermal_memory",
    kind="input",
    equation="tau dz/dt = T - z; bias = f(z, dz/dt)",
    source="first-order heat conduction from the sensor into the cavity; glass ceramics conduct poorly",
    parameters=(Parameter("tau_s", "s", 60.0, 4000.0),),
    cavity=_cavity,
    features=_features,
    reference=_reference,
)
