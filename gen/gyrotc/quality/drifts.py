"""Drifts of a rate that begin at a time, while the temperature stands still.

What relaxes after a change of temperature or after power-on slows down; a drift that begins does the reverse: nothing
before, and then it goes on. So only kinks behind which the slope is several times the one before count, and only
where the temperature has not moved for as long as is looked at: a play that is pushed again, or a lag behind a corner
of the programme, make kinks too. Places, lengths and the level of the noise are as for steps (`steps`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import stdtrit

from ..common.arrays import FloatArray
from ..common.statistics import CHI2_95_ONE, NORMAL_95, cell_means, noise_of

__all__ = ["Drift", "drifts_of"]


FALSE_ALARMS = 0.005  # records of which one has a drift by chance: half of what steps are given
_HALVES_S = (1200.0, 3600.0)  # half windows: a drift is slow, and shorter than a hold
_CELLS = 36  # of a half window: as many as make the shortest of them 33 s
_STILL_C = 1.0  # the temperature moves less over a window; a chamber that holds keeps to some tenths
_BEFORE = 0.25  # of the slope behind, what may be there before: a relaxation has more before than behind
_PLACES = 15.0  # independent places in a window, as for steps
_KNOWN = 0.4  # degrees of freedom of a scale from a median, for each independent place, as for steps
_LEAST_WINDOWS = 2.0  # still ones that show what noise makes
_HOUR_S = 3600.0  # by definition


@dataclass(frozen=True, slots=True)
class Drift:
    """A drift that begins.

    Attributes:
        run: Number of its run.
        time_s: When, and the times between which that lies, s (95 %).
        slope_dph_per_h: Its slope and 95 % limits, deg/h each hour.
        sigmas: Kink over what the fit makes of noise.
    """

    run: int
    time_s: tuple[float, float, float]
    slope_dph_per_h: tuple[float, float, float]
    sigmas: float


def drifts_of(runs: Sequence[tuple[FloatArray, FloatArray, FloatArray]]) -> list[Drift]:
    """Drifts of all runs, by run in order of time.

    Args:
        runs: Time in s, temperature in C, rate in deg/h of the rows that count, finite, shape (n,) each.
    """
    tried = [_Kinks.of(k, *rows, half) for k, rows in enumerate(runs) for half in _HALVES_S]
    kinks = sorted((k for k in tried if k is not None), key=lambda k: (_HALVES_S.index(k.half_s), k.run))
    places = sum(k.places for k in kinks)
    found: list[Drift] = []
    for half in _HALVES_S:
        alike = [k for k in kinks if k.half_s == half]
        windows = sum(k.places for k in alike) / _PLACES
        if windows < _LEAST_WINDOWS:
            continue
        noise = noise_of(np.concatenate([k.z for k in alike]))
        limit = -float(stdtrit(_KNOWN * _PLACES * windows, FALSE_ALARMS / 2.0 / places))
        for k in alike:
            found += k.beyond(limit, noise)
    return _clearest(found)


def _clearest(found: Sequence[Drift]) -> list[Drift]:
    """One drift for each place of a run: it goes on, so a second one near it is the same."""
    kept: list[Drift] = []
    for one in sorted(found, key=lambda d: -d.sigmas):
        if all(one.run != k.run or abs(one.time_s[0] - k.time_s[0]) > _HALVES_S[-1] for k in kept):
            kept.append(one)
    return sorted(kept, key=lambda d: (d.run, d.time_s[0]))


@dataclass(frozen=True, slots=True)
class _Kinks:
    """Fits of a kink at every place of a run around which the temperature stands still.

    Attributes:
        run: Number of the run.
        half_s: Half of a window, s.
        t, y: Times (s) and rates (deg/h) of the windows' cells, shape (places, 2 width).
        before, after: Slopes on both sides, deg/h/s, shape (places,).
        z: Difference of the slopes over what white noise of size 1 makes of it.
        spread: That error.
        places: How many places are independent.
    """

    run: int
    half_s: float
    t: FloatArray
    y: FloatArray
    before: FloatArray
    after: FloatArray
    z: FloatArray
    spread: float
    places: float

    @staticmethod
    def of(
        run: int, time: FloatArray, temperature: FloatArray, rate: FloatArray, half_s: float
    ) -> _Kinks | None:
        """None where the run has no window in which the temperature stands still."""
        if len(time) < 4 or time[-1] - time[0] < 2.0 * half_s:
            return None
        cell = max(float(np.median(np.diff(time))), half_s / _CELLS)
        width = round(half_s / cell)
        t, x, y = cell_means(cell, time, temperature, rate)
        if len(t) < 2 * width or width < 4:
            return None
        t_, x_, y_ = (sliding_window_view(v, 2 * width) for v in (t, x, y))
        still = (np.ptp(x_, axis=1) < _STILL_C) & (np.ptp(t_, axis=1) < 2.0 * half_s + 3.0 * cell)
        if not still.any():
            return None
        fit = np.linalg.pinv(_sides(width))
        before, after = (y_[still] @ fit[1:].T / cell).T
        spread = float(np.linalg.norm(fit[2] - fit[1])) / cell
        z = (after - before) / spread
        windows = float(still.sum()) / (2.0 * width)
        return _Kinks(
            run, half_s, t_[still], y_[still], before, after, z, spread, _PLACES * max(windows, 1.0)
        )

    def beyond(self, limit: float, noise: float) -> Iterator[Drift]:
        """Drifts of more than `limit` times what noise makes, the clearest first."""
        far = np.abs(self.z) / noise if noise > 0.0 else np.zeros(len(self.z))
        far = np.where(np.abs(self.before) < _BEFORE * np.abs(self.after), far, 0.0)
        while far.max(initial=0.0) > limit:
            k = int(np.argmax(far))
            middle = self.t[:, self.t.shape[1] // 2]
            error = NORMAL_95 * noise * self.spread * _HOUR_S
            slope = float(self.after[k] - self.before[k]) * _HOUR_S
            time = _begins(self.t[k], self.y[k])
            yield Drift(self.run, time, (slope, slope - error, slope + error), float(far[k]))
            far[np.abs(middle - middle[k]) <= 2.0 * self.half_s] = 0.0


def _sides(width: int) -> FloatArray:
    """Columns level, slope before, slope behind the middle of a window, for each cell, shape (2 width, 3)."""
    u = np.arange(2 * width) - (width - 0.5)
    return np.column_stack([np.ones(2 * width), np.minimum(u, 0.0), np.maximum(u, 0.0)])


def _begins(t: FloatArray, y: FloatArray) -> tuple[float, float, float]:
    """Where two straight lines that meet leave least of a window, and the times between which that lies."""
    u = (t - t[0]) / (t[-1] - t[0])
    inside = np.arange(3, len(u) - 3)
    left = np.empty(len(inside))
    for k, at in enumerate(inside):
        columns = np.column_stack([np.ones(len(u)), np.minimum(u - u[at], 0.0), np.maximum(u - u[at], 0.0)])
        rest = y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]
        left[k] = rest @ rest
    best = int(np.argmin(left))
    likely = inside[left <= left[best] * (1.0 + CHI2_95_ONE / max(len(u) - 4, 1))]
    return float(t[inside[best]]), float(t[max(likely[0] - 1, 0)]), float(t[min(likely[-1] + 1, len(t) - 1)])
