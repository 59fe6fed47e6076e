"""The best cubic over temperature for autopilots that know nothing else, in their own float32, and what it loses.

PX4 (TemperatureCompensation, `calc_thermal_offsets_3D`): x0 + x1 d + x2 d² + x3 d³ with d² and d³ multiplied first.
ArduPilot (AP_InertialSensor, `TCal::polynomial_eval`): (c0 + (c1 + c2 d) d) d 1e-6, the constant in the gyro's offset.
Both clip the temperature to their range and work in rad/s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed
from ..model import Model

__all__ = ["Autopilot", "Cubic", "best_cubic"]

Autopilot = Literal["px4", "ardupilot"]
Words = NDArray[np.float32]

_RAD_S = np.pi / 180.0 / 3600.0  # of one deg/h
_SCALE = np.float32(1e-6)  # ArduPilot's, so that its parameters are easy to read
_ORDERS = 4  # of a cubic


@dataclass(frozen=True, slots=True)
class Cubic:
    """A cubic as an autopilot holds it.

    Attributes:
        autopilot: Whose arithmetic it is in.
        reference_c, lowest_c, highest_c: Temperatures in float32.
        x: Coefficients of d⁰ ... d³, rad/s (ArduPilot: from d¹ on in 1e-6 rad/s).
        rms_dph, largest_dph: What it loses against the map where training was, rates of temperature included.
        flat_dph: RMS of the map itself there.
    """

    autopilot: Autopilot
    reference_c: np.float32
    lowest_c: np.float32
    highest_c: np.float32
    x: tuple[np.float32, np.float32, np.float32, np.float32]
    rms_dph: float
    largest_dph: float
    flat_dph: float

    def offset(self, temperature_c: NDArray[np.floating]) -> Words:
        """What the autopilot subtracts, rad/s, in its own operations; shape as given."""
        seen = np.clip(np.asarray(temperature_c, dtype=np.float32), self.lowest_c, self.highest_c)
        return _evaluated(self.autopilot, seen - self.reference_c, self.x)


def _evaluated(autopilot: Autopilot, d: Words, x: tuple[np.float32, ...]) -> Words:
    if autopilot == "px4":
        square = d * d
        return np.asarray(x[0] + x[1] * d + x[2] * square + x[3] * (square * d), dtype=np.float32)
    return np.asarray(x[0] + (x[1] + (x[2] + x[3] * d) * d) * d * _SCALE, dtype=np.float32)


def best_cubic(model: Model, autopilot: Autopilot) -> Cubic:
    """Least squares over the cells where training was; each coefficient is rounded with the lower ones fitted anew.

    Raises:
        CheckFailed: ArduPilot corrects nothing where the middle of the range is not above 0 C.
    """
    t, r = model.trained_inputs()
    y = model.map_dph(t, r)
    low, high = (np.float32(edge) for edge in model.envelope.temperature_c)
    middle = (high + low) * np.float32(0.5)
    if autopilot == "ardupilot" and middle <= 0:
        raise CheckFailed(
            f"ArduPilot corrects nothing where the middle of the range is not above 0 C: {middle:.1f} C"
        )
    d = (t.astype(np.float32) - middle).astype(np.float64)
    unit = np.array([1.0, *([1.0 if autopilot == "px4" else float(_SCALE)] * (_ORDERS - 1))])
    columns = d[:, None] ** np.arange(_ORDERS) * unit
    x = np.zeros(_ORDERS, dtype=np.float32)
    rest = y * _RAD_S
    for order in reversed(range(_ORDERS)):
        scale = np.abs(columns[:, : order + 1]).max(axis=0)
        found = np.linalg.lstsq(columns[:, : order + 1] / scale, rest, rcond=None)[0] / scale
        x[order] = np.float32(found[order])
        rest = rest - columns[:, order] * float(x[order])
    coefficients = (x[0], x[1], x[2], x[3])
    lost = _evaluated(autopilot, t.astype(np.float32) - middle, coefficients).astype(np.float64) / _RAD_S - y
    return Cubic(
        autopilot, middle, low, high, coefficients, float(np.sqrt(np.mean(lost**2))), float(np.abs(lost).max()),
        float(np.sqrt(np.mean(y**2))),
    )  # fmt: skip
