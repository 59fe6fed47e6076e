"""Odds that something happened to a recording, and what such an event is.

Every search for events asks one question: how much likelier are these rows if something happened than if nothing did?
The answer is a log-odds, and an event is reported if it is positive. The prior odds are chosen such that each search
reports one false event in a hundred sound recordings, whatever their length.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from ..common.arrays import FloatArray

Column = Literal["time", "temperature", "rate"]
EventKind = Literal[
    "outlier", "end_stop", "stuck", "noise", "gap", "jump", "step", "transition", "drift", "gain", "restart",
    "displaced",
]  # fmt: skip

# False events of a sound recording for each search: a needless look costs an hour, which one in a hundred may.
FALSE_ALARMS = 0.01
# Spread of outliers over the noise. Values of 3 to 20 find nearly the same rows.
WIDTH = 5.0
# Ratio of two time scales. Eight outlying blocks are the minority of the 17 that a running median covers.
OCTAVE = 8
# Longest block of the search for outliers: the front end averages over no less.
CELL_S = 10.0
# Smaller jumps are within the tolerance of class B thermometers (IEC 60751).
MIN_JUMP_C = 0.3
# Rows that are noisier by less than this factor cost a fit less than a tenth of its precision.
NOISE_FACTOR = 1.5
# Rows that are noisier by more carry less than a twenty-fifth of the weight of the others and are left out.
USELESS_NOISE = 5.0
# Missing rows shorter than this do not matter to a correction that averages over 100 s.
GAP_S = 60.0

WINDOW = 2 * OCTAVE + 1
"""Blocks of a running median."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a run.

    Attributes:
        kind: What happened.
        column: Column that shows it.
        rows: First row of the file (0 is the first) and the row after the last one. Of a lasting change: the rows
            among which the first one behind it is.
        time_s: Time of the first row, and of the last one.
        size: In the unit of the column: deg/h or C; seconds of a gap and of a stuck value, a factor of noise and gain,
            deg/h per hour of a ramp.
        sigma: Standard uncertainty of the size.
        log_odds: Natural logarithm of the odds that it happened, prior odds included.
        reason: Why its rows are left out; empty if they are used.
    """

    kind: EventKind
    column: Column
    rows: tuple[int, int]
    time_s: tuple[float, float]
    size: float
    sigma: float
    log_odds: float
    reason: str = ""

    @property
    def left_out(self) -> bool:
        """True if its rows say nothing of the gyro and are left out."""
        return bool(self.reason)


def cost_of(places: float) -> float:
    """Return the prior log-odds, negated, of an event at one of so many places."""
    return float(np.log(places / FALSE_ALARMS))


def outlier_odds(z: FloatArray, freedom: float) -> FloatArray:
    """Return the log-odds of values for "outlier" (a Cauchy distribution of WIDTH) against noise (Student's t).

    Args:
        z: Deviations in standard deviations of the noise.
        freedom: Degrees of freedom of the noise; infinite for normal noise.
    """
    square = z * z
    outlier = -np.log1p(square / WIDTH**2) - np.log(np.pi * WIDTH)
    if np.isinf(freedom):
        return np.asarray(outlier + 0.5 * square + 0.5 * np.log(2.0 * np.pi))
    constant = gammaln((freedom + 1.0) / 2.0) - gammaln(freedom / 2.0) - 0.5 * np.log(np.pi * freedom)
    return np.asarray(outlier - constant + (freedom + 1.0) / 2.0 * np.log1p(square / freedom))


# Largest of 20 deviations, in the standard deviations that their median implies, by degrees of freedom of Student's t.
_FREEDOM_BY_LARGEST = ((2.22, np.inf), (2.41, 12.0), (2.69, 7.0), (3.08, 4.0), (3.46, 3.0), (np.inf, 2.5))
_GROUP = 20
# Standard error of the median of one such value for normal noise.
_SPREAD_OF_LARGEST = 0.55


def largest_of_groups(z: NDArray[np.floating]) -> FloatArray:
    """Return the largest magnitude of every 20 values."""
    whole = len(z) // _GROUP * _GROUP
    return np.asarray(np.abs(z[:whole]).reshape(-1, _GROUP).max(axis=1))


def freedom_of(largest: FloatArray) -> float:
    """Return the degrees of freedom of noise from its `largest_of_groups`."""
    if len(largest) < 5:
        return np.inf
    # Two standard errors below the median: few rows do not show that the noise has tails
    usual = float(np.median(largest)) - 2.0 * _SPREAD_OF_LARGEST / np.sqrt(len(largest))
    return next(freedom for limit, freedom in _FREEDOM_BY_LARGEST if usual <= limit)
