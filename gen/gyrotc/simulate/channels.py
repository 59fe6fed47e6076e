"""Auxiliary channels of a simulated recording: supply, discharge current, pressure, magnetic field, ..."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from ..common.arrays import FloatArray

if TYPE_CHECKING:
    from .scenario import Channel

__all__ = ["channel_readings", "channel_values"]


def channel_values(channel: Channel, air_c: FloatArray, dt_s: float, rng: np.random.Generator) -> FloatArray:
    """What the quantity really does: level, a part that goes with the air, a wandering part, steps."""
    points = len(air_c)
    value = channel.level + channel.per_air_c * (air_c - 20.0)
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
    """What the recorder reads of it."""
    return np.asarray(true + rng.normal(0.0, channel.noise, len(true)))
