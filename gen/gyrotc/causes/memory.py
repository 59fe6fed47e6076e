"""What the causes of the thermal memory share: columns of a first-order state, and their experiments."""

from __future__ import annotations

import numpy as np

from ..target.operators import first_order
from .base import Features, History

__all__ = ["COLD_STARTS", "CORNERS", "KNOWN_AFTER", "RATES", "lagged"]

KNOWN_AFTER = 3.0  # time constants after which a record has forgotten what was before it: e^-3 is 5 %

RATES = "ramps at two more rates with holds of an hour after each; a second thermometer at the cavity"
CORNERS = "steps or 5 C/min corners recorded with 10-s rows; a synchronisation pulse in both recordings"
COLD_STARTS = "a cold start at a constant chamber temperature, at two temperatures; a hot restart"


def lagged(history: History, tau_s: float) -> tuple[np.ndarray[tuple[int], np.dtype[np.float64]], Features]:
    """State z of the recorded temperature and, as columns, (z, dz/dt in C/min)."""
    z = first_order(tau_s, history.time_s, history.temperature_c)
    slope = (history.temperature_c - z) * (60.0 / tau_s)
    known = history.time_s - history.time_s[0] >= KNOWN_AFTER * tau_s
    return z, Features(np.column_stack((z, slope)), known)
