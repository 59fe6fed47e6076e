"""The static map of a simulated gyro: its bias over the temperature T of its cavity and the rate r = dT/dt.

shape(T, r) = s(T) + r/√(1 + (r/r0)²) · (a + b atan((T − T1)/w1)) + c (√(1 + (r/r1)²) − 1)
    bias = offset + scale · shape

s(T) is a cubic spline through random knots, a rational well (losses around a working point) and an arctangent
(alignment that goes over from one state to another). The second part is a gas flow that saturates and whose effect
depends on T; the third is even in r. None of it is a Gaussian: the map shares no family of functions with the model
that is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from ..common.arrays import FloatArray

T_RANGE_C = (-36.0, 71.0)  # of the cavity in a chamber at −40 ... 60 C, self-heating included
KNOTS = 7  # of the spline, evenly over T_RANGE_C
R_LIMIT_C_PER_MIN = 2.5  # of the cavity: half of the fastest ramp of a chamber, which it follows slowly


@dataclass(frozen=True, slots=True)
class BiasMap:
    """The static map of one gyro; `parameters` are those of its shape."""

    parameters: dict[str, Any]
    scale_dph: float
    offset_dph: float
    _spline: CubicSpline = field(repr=False)

    def __call__(self, cavity_c: FloatArray, slope_c_per_min: FloatArray) -> FloatArray:
        """Return the bias in deg/h at cavity temperatures (C) and their rates of change (C/min), broadcast."""
        shape = _shape(self.parameters, self._spline, cavity_c, slope_c_per_min)
        return np.asarray(self.offset_dph + self.scale_dph * shape)

    def described(self) -> dict[str, Any]:
        """Return everything that was drawn, for truth.json."""
        return {"offset_dph": self.offset_dph, "scale_dph": self.scale_dph, **self.parameters}


def draw_map(rng: np.random.Generator, range_dph: tuple[float, float]) -> BiasMap:
    """Draw a map whose values over the operating range reach from end to end of `range_dph`, deg/h."""
    knots_c = np.linspace(*T_RANGE_C, KNOTS)
    values = rng.normal(0.0, 0.3, len(knots_c))
    sign = rng.choice([-1.0, 1.0])
    parameters: dict[str, Any] = {
        "knots_c": knots_c.tolist(),
        "knots": values.tolist(),
        "well": -rng.uniform(0.8, 1.6),
        "well_c": rng.uniform(0.0, 35.0),
        "well_width_c": rng.uniform(25.0, 45.0),
        "turn": sign * rng.uniform(0.15, 0.4),
        "turn_c": rng.uniform(-20.0, 50.0),
        "turn_width_c": rng.uniform(10.0, 25.0),
        "flow": rng.choice([-1.0, 1.0]) * rng.uniform(0.15, 0.4),
        "flow_c_per_min": rng.uniform(2.0, 4.0),
        "flow_turn": rng.uniform(-0.2, 0.2),
        "flow_turn_c": rng.uniform(-10.0, 40.0),
        "flow_width_c": rng.uniform(15.0, 35.0),
        "even": rng.uniform(-0.3, 0.3),
        "even_c_per_min": rng.uniform(1.5, 3.0),
    }
    shape = shape_over_range(parameters)
    low, high = range_dph
    scale = (high - low) / float(np.ptp(shape))
    return map_of(parameters, scale, low - scale * float(shape.min()))


def map_of(parameters: dict[str, Any], scale_dph: float, offset_dph: float) -> BiasMap:
    """Return the map of given parameters of the shape."""
    return BiasMap(parameters, scale_dph, offset_dph, _spline(parameters))


def shape_over_range(parameters: dict[str, Any]) -> FloatArray:
    """Return the shape on a grid over the operating range, shape (118 temperatures, 25 rates)."""
    grid_c, grid_slope = np.meshgrid(
        np.linspace(*T_RANGE_C, 118), np.linspace(-R_LIMIT_C_PER_MIN, R_LIMIT_C_PER_MIN, 25), indexing="ij"
    )
    return _shape(parameters, _spline(parameters), grid_c, grid_slope)


def _shape(p: dict[str, Any], spline: CubicSpline, cavity_c: FloatArray, slope: FloatArray) -> FloatArray:
    """Return the shape at cavity temperatures (C) and their rates of change (C/min), broadcast."""
    level = spline(cavity_c)
    level = level + p["well"] / (1.0 + ((cavity_c - p["well_c"]) / p["well_width_c"]) ** 2)
    level = level + p["turn"] * np.arctan((cavity_c - p["turn_c"]) / p["turn_width_c"])
    flow = slope / np.sqrt(1.0 + (slope / p["flow_c_per_min"]) ** 2)
    gain = p["flow"] + p["flow_turn"] * np.arctan((cavity_c - p["flow_turn_c"]) / p["flow_width_c"])
    even = p["even"] * (np.sqrt(1.0 + (slope / p["even_c_per_min"]) ** 2) - 1.0)
    return np.asarray(level + flow * gain + even)


def _spline(parameters: dict[str, Any]) -> CubicSpline:
    """Return the spline through the knots."""
    return CubicSpline(parameters["knots_c"], parameters["knots"], bc_type="natural")
