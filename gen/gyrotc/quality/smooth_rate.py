"""Fit the rate of one run that a gyro at rest has by itself: a smooth function of temperature, its slope, and time.

Events are looked for in what is left. Without this, the bias at a corner of the programme looks like a disturbance
where rows are slow. The fit is robust: a minority of disturbed rows does not move it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..common.arrays import FloatArray
from ..common.metrics import MAD_TO_SIGMA
from ..common.splines import cubic_splines
from ..common.statistics import running_mean
from .odds import CELL_S, OCTAVE, WINDOW

# Distance of the knots over temperature: the bias of a gyro hardly bends within it.
_KNOTS_C = 5.0
# Cells between two knots, at least: twice the window of the outliers' search.
_CELLS_BETWEEN = 2 * WINDOW
# A smaller span of temperature shows nothing of it.
_MIN_SPAN_C = 1.0
# Windows of the temperature's slope: a fine sensor shows the corners of a programme, a coarse one the ramps only.
_SLOPES_S = (60.0, 300.0)
# Time constants of a warm-up.
_WARM_UP_S = (300.0, 1000.0, 3000.0)
# Cells to a column, at least: with fewer the fit would follow the noise.
_MIN_CELLS = 8
# Cells at most: bounds the time of the fit.
_MAX_CELLS = 10_000
_ROUNDS = 6
# The fit has settled when it moves by less than this share of the noise of a cell.
_SETTLED = 0.05
# Tukey's bisquare in standard deviations: 95 % efficient for normal noise.
_BISQUARE = 4.685


def cell_length_of(time_s: FloatArray) -> float:
    """Return the length of the cells over which a run with rows at these times is averaged for `smooth_rate`, s."""
    return max(CELL_S, float(time_s[-1] - time_s[0]) / _MAX_CELLS)


def smooth_rate(t: FloatArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return times (s) and the smooth rate at them (deg/h); both empty if the run is too short to show one.

    Args:
        t, x, y: Means of time (s), temperature (C) and rate (deg/h) over cells (`cell_length_of`).
    """
    columns = _columns(t, x) if len(t) > 1 else None
    if columns is None:
        return np.zeros(0), np.zeros(0)
    level = float(np.median(y))
    return t, np.asarray(level + columns @ _robust_fit(columns, y - level))


def _columns(t: FloatArray, x: FloatArray) -> FloatArray | None:
    """Return the columns of the fit, shape (n, k)."""
    since = t - t[0]
    rows_per_s = (len(t) - 1) / max(float(since[-1]), 1.0)
    taus = [tau for tau in _WARM_UP_S if tau * rows_per_s >= OCTAVE]  # one of few rows would follow a bad first row
    columns = [np.ones_like(t), since / max(float(since[-1]), 1.0), *(np.exp(-since / tau) for tau in taus)]
    low, high = float(x.min()), float(x.max())
    if high - low >= _MIN_SPAN_C:
        columns += list(cubic_splines(x, _knots(np.sort(x)))[:, 1:].T)
        quick, slope = (
            60.0 * running_mean(np.gradient(x, t), max(round(window * rows_per_s), 1)) for window in _SLOPES_S
        )
        place = (x - low) / (high - low) - 0.5
        columns += [quick, quick * place, slope, slope * place, slope * place**2, slope * np.abs(slope), slope**2]
    return np.column_stack(columns) if len(t) >= _MIN_CELLS * len(columns) else None


def _knots(ordered: FloatArray) -> FloatArray:
    """Return knots over temperatures in ascending order; between two are enough cells to outvote disturbed ones."""
    knots = [float(ordered[0])]
    for k in range(_CELLS_BETWEEN, len(ordered) - _CELLS_BETWEEN, _CELLS_BETWEEN):
        if ordered[k] - knots[-1] >= _KNOTS_C and ordered[-1] - ordered[k] >= _KNOTS_C:
            knots.append(float(ordered[k]))
    return np.asarray([*knots, float(ordered[-1])])


def _robust_fit(columns: FloatArray, y: FloatArray) -> FloatArray:
    """Return the coefficients of a fit by least magnitudes, then by Tukey's bisquare with the scale that these left.

    A scale that followed the bisquare would shrink to a part of the rows and drop the others (Yohai, 1987).
    """
    norm = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    unit = columns / norm

    def settled(rest: FloatArray, weight_of: Callable[[FloatArray], FloatArray], known: float | None) -> FloatArray:
        """Return the coefficients after rounds with weights of what the last one left, in its own scale or a known one.

        Args:
            rest: What the first round takes its weights from.
        """
        coefficients = np.zeros(columns.shape[1])
        for _ in range(_ROUNDS):
            sigma = _scale_of(rest) if known is None else known
            if sigma == 0.0:
                break
            weighted = unit * weight_of(np.abs(rest) / sigma)[:, None]
            coefficients = np.linalg.lstsq(weighted.T @ unit, weighted.T @ y, rcond=1e-12)[0]
            before, rest = rest, y - unit @ coefficients
            if np.abs(rest - before).max() < _SETTLED * sigma:
                break
        return coefficients

    least = settled(y, lambda size: 1.0 / np.maximum(size, 0.1), None)
    rest = y - unit @ least
    sigma = _scale_of(rest)
    if sigma == 0.0:
        return np.asarray(least / norm)
    bisquare = settled(rest, lambda size: np.maximum(1.0 - (size / _BISQUARE) ** 2, 0.0) ** 2, sigma)
    return np.asarray(bisquare / norm)


def _scale_of(rest: FloatArray) -> float:
    return MAD_TO_SIGMA * float(np.median(np.abs(rest)))
