"""What the terms of the thermal memory share: a first-order state, as columns and as a recursion."""

from __future__ import annotations

import numpy as np

from .base import Features, History
from .operators import first_order

__all__ = ["KNOWN_AFTER", "MemoryState", "lagged"]

KNOWN_AFTER = 3.0  # time constants after which a record has forgotten what was before it


def lagged(history: History, tau_s: float) -> tuple[np.ndarray[tuple[int], np.dtype[np.float64]], Features]:
    """State z of the recorded temperature and, as columns, (z, dz/dt in C/min)."""
    z = first_order(tau_s, history.time_s, history.temperature_c)
    slope = (history.temperature_c - z) * (60.0 / tau_s)
    known = history.time_s - history.time_s[0] >= KNOWN_AFTER * tau_s
    return z, Features(np.column_stack((z, slope)), known)


class MemoryState:
    """z ← z + a (T − z), a = 1 − exp(−block_s/tau_s); `dtype` rounds every operation."""

    def __init__(self, tau_s: float, block_s: float, dtype: type[np.floating]) -> None:
        self._dtype = dtype
        self._gain = dtype(-np.expm1(-block_s / tau_s))
        self._rate = dtype(block_s / tau_s)
        self.z = dtype(0.0)
        self.temperature = dtype(0.0)

    def start(self, value: float) -> None:
        """Rest at the first valid temperature, C."""
        self.z = self.temperature = self._dtype(value)

    def step(self, mean: float) -> None:
        """Takes in the mean temperature of a block, C."""
        self.temperature = self._dtype(mean)
        self.z = self._dtype(self.z + self._dtype(self._gain * self._dtype(self.temperature - self.z)))

    def slope(self) -> float:
        """dz/dt = (T − z)/tau, C per block."""
        return float(self._dtype(self._dtype(self.temperature - self.z) * self._rate))
