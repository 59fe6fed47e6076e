"""Readings of thermometers and of auxiliary channels."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from ..common.arrays import FloatArray
from ..mirror.recursions import first_order
from .grid import REFERENCE_C
from .scenario import Channel, Sensor, Thermometer


def sensor_readings(sensor: Sensor, sensed_c: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Draw the readings of the product's own sensor from the temperature behind its lag, C, shape (n,)."""
    return _quantised(sensed_c + sensor.offset_c + rng.normal(0.0, sensor.noise_c, len(sensed_c)), sensor.resolution_c)


def thermometer_readings(
    one: Thermometer, node_c: FloatArray, air_c: FloatArray, time_s: FloatArray, day: float, rng: np.random.Generator
) -> FloatArray:
    """Draw the readings of a further thermometer, C, shape (n,).

    Args:
        one: The thermometer.
        node_c: True temperature of its node, C, shape (n,).
        air_c: Air around the instrument, C, shape (n,).
        time_s: Time, s, shape (n,).
        day: Days since the first run; from `loose_from_day` on the contact is loose.
        rng: Draws its noise.
    """
    lag_s, there_c = one.lag_s, node_c
    if one.loose_from_day is not None and day >= one.loose_from_day:
        lag_s, there_c = one.loose_lag_s, node_c + one.loose_share * (air_c - node_c)
    shown = first_order(lag_s, time_s, there_c) + one.offset_c
    return _quantised(shown + rng.normal(0.0, one.noise_c, len(shown)), one.resolution_c)


def channel_values(channel: Channel, air_c: FloatArray, dt_s: float, rng: np.random.Generator) -> FloatArray:
    """Draw the true quantity behind a channel: level, a part that goes with the air, a wandering part, steps."""
    points = len(air_c)
    value = channel.level + channel.per_air_c * (air_c - REFERENCE_C)
    if channel.wander_sigma:
        decay = float(np.exp(-dt_s / channel.wander_tau_s))
        start = rng.normal(0.0, channel.wander_sigma)
        pushes = rng.normal(0.0, channel.wander_sigma * np.sqrt(1.0 - decay**2), points)
        value = value + lfilter([1.0], [1.0, -decay], pushes, zi=[decay * start])[0]
    if channel.steps_per_h:
        steps = rng.random(points) < channel.steps_per_h * dt_s / 3600.0
        heights = rng.normal(0.0, channel.step_sigma, int(steps.sum()) + 1)
        value = value + heights[np.cumsum(steps)]
    return np.asarray(value)


def channel_readings(channel: Channel, true: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Draw the readings of the quantity."""
    return np.asarray(true + rng.normal(0.0, channel.noise, len(true)))


def _quantised(reading_c: FloatArray, resolution_c: float) -> FloatArray:
    """Return readings in whole steps of a converter, C; 0: as they are."""
    if not resolution_c:
        return reading_c
    return np.asarray(resolution_c * np.round(reading_c / resolution_c))
