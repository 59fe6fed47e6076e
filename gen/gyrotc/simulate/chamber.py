"""The chamber's air temperature for a programme.

The chamber is a second-order closed loop, T'' + 2ζω T' + ω² T = ω² programme, whose lag behind a ramp is 2ζ/ω. With
ζ < 1 it overshoots at every corner, by exp(−πζ/√(1−ζ²)) of a step. On top come the slow wave of a controller that
switches its heater, and an error of the setpoint that stays for a run.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import cont2discrete, lfilter, lfiltic

from ..common.arrays import FloatArray
from .scenario import Chamber


def chamber_air(chamber: Chamber, programme_c: FloatArray, dt_s: float, rng: np.random.Generator) -> FloatArray:
    """Simulate the air for a programme on a grid of `dt_s` seconds, C; it starts settled on its first value."""
    offset = rng.normal(0.0, chamber.setpoint_sigma_c)
    phase = rng.uniform(0.0, 2.0 * np.pi)
    settled = _follow(chamber, programme_c - programme_c[0], dt_s)
    time_s = dt_s * np.arange(len(programme_c))
    ripple = chamber.ripple_c * np.sin(2.0 * np.pi * time_s / chamber.ripple_s + phase)
    return np.asarray(programme_c[0] + settled + offset + ripple)


def _follow(chamber: Chamber, departure_c: FloatArray, dt_s: float) -> FloatArray:
    """Return the loop's answer to a programme that starts at 0, exact for one that is linear between the points."""
    omega = 2.0 * chamber.damping / chamber.lag_s
    plant = ([omega**2], [1.0, 2.0 * chamber.damping * omega, omega**2])
    numerator, denominator, _ = cont2discrete(plant, dt_s, method="foh")
    rest = lfiltic(numerator.ravel(), denominator, y=[0.0, 0.0], x=[0.0, 0.0])
    return np.asarray(lfilter(numerator.ravel(), denominator, departure_c, zi=rest)[0])
