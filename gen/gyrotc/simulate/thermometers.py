"""Further thermometers of the instrument: each at a node of its own, with lag, offset, noise and steps of its own."""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from ..target.operators import first_order
from .signals import Thermometer

__all__ = ["quantised_c", "thermometer_readings"]


def thermometer_readings(
    one: Thermometer,
    node_c: FloatArray,
    air_c: FloatArray,
    time_s: FloatArray,
    day: float,
    rng: np.random.Generator,
) -> FloatArray:
    """What a thermometer shows, C.

    Args:
        one: The thermometer.
        node_c: True temperature of its node, C, shape (n,).
        air_c: Air around the instrument, C, the same.
        time_s: s, the same.
        day: Days since the first run: a contact may have come loose.
        rng: Draws its noise.
    """
    lag_s, there_c = one.lag_s, node_c
    if one.loose_from_day is not None and day >= one.loose_from_day:
        lag_s, there_c = one.loose_lag_s, node_c + one.loose_share * (air_c - node_c)
    shown = first_order(lag_s, time_s, there_c) + one.offset_c
    return quantised_c(shown + rng.normal(0.0, one.noise_c, len(shown)), one.resolution_c)


def quantised_c(reading_c: FloatArray, resolution_c: float) -> FloatArray:
    """Readings in whole steps of a converter, C; 0: as they are."""
    if not resolution_c:
        return reading_c
    return np.asarray(resolution_c * np.round(reading_c / resolution_c))
