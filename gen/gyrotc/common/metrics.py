"""Figures of merit of a gyro record before and after compensation (means over `average_s`).

Knows arrays only. All RMS figures are of averaged rates; standard deviations are about the mean
with ddof 0; pooled figures are over all averaged samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import FloatArray
from .inputs import need_memory

__all__ = [
    "LEAST_SPAN_C",
    "MAD_TO_SIGMA",
    "Averages",
    "average",
    "median",
    "middle_of_five",
    "statistics",
    "time_statistics",
]


MAD_TO_SIGMA = 1.0 / NormalDist().inv_cdf(0.75)
"""σ of a normal distribution over its median absolute deviation: half of it lies within its quartiles."""

LEAST_SPAN_C = 2.0
"""A smaller span of temperature says nothing about temperature (finding `no_temperature_information`)."""

_HALF_HOUR_S = 1800.0  # the name of the figure says it
_HOUR_S = 3600.0  # the name of the figure says it
_FIRST_S = 600.0  # ten minutes: the name of the figure says it
_BIN_BYTES = 24  # of a mean while it is made: its count, its number and a sum


@dataclass(frozen=True, slots=True)
class Averages:
    """Means over `average_s` of one run: their times (s), and rates before and after (deg/h)."""

    time_s: FloatArray
    before_dph: FloatArray
    after_dph: FloatArray
    temperature_c: FloatArray


def median(values: NDArray[Any], overwrite_input: bool = False) -> float:
    """Median of numbers, shape (n,), n > 0, none of them NaN: that of `np.median`, whose checks cost more than it."""
    middle = values.size // 2
    ordered = values if overwrite_input else values.copy()
    if values.size % 2:
        ordered.partition(middle)
        return float(ordered[middle])
    ordered.partition((middle - 1, middle))
    return float((ordered[middle - 1] + ordered[middle]) / 2)


def middle_of_five(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, e: FloatArray) -> FloatArray:
    """Median of each five numbers, none of them NaN; arrays of one shape."""
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return np.asarray(np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), e)))


def _bins(
    time_s: FloatArray, scored: NDArray[np.bool_], average_s: float, from_s: float | None
) -> tuple[NDArray[np.int64], int]:
    """Bin of every row (from `from_s` on; None: the first row) and their number; a bin less than half full gets -1."""
    if time_s.size == 0:
        return np.zeros(0, dtype=np.int64), 0
    period = median(np.diff(time_s), overwrite_input=True) if time_s.size > 1 else average_s
    # Rows of a uniform recording fall into bins of equal size in spite of rounded time stamps.
    passed = time_s - (time_s[0] if from_s is None else from_s)
    passed += 1e-3 * period
    passed /= max(average_s, period)
    raw = np.floor(passed, out=passed).astype(np.int64)
    full = max(average_s, period) / period
    need_memory(_BIN_BYTES * float(raw[-1]), "the recording", f"its means over {average_s:g} s")
    count = np.bincount(raw if scored.all() else raw[scored], minlength=int(raw[-1]) + 1)
    keep = count >= max(0.5 * full, 1.0)
    number = np.where(keep, np.cumsum(keep) - 1, -1)
    return np.where(scored, number[raw], -1), int(keep.sum())


def average(
    time_s: FloatArray,
    temperature_c: FloatArray,
    before_dph: FloatArray,
    after_dph: FloatArray,
    *,
    scored: NDArray[np.bool_],
    average_s: float,
    from_s: float | None = None,
) -> Averages:
    """Averages the scored rows of one run over `average_s`; bins less than half full are left out.

    Bins begin at `from_s`, at or before the first row; None: at the first row.
    """
    scored = scored & np.isfinite(before_dph) & np.isfinite(after_dph)
    bins, n = _bins(time_s, scored, average_s, from_s)
    # Without copies where every row counts: a file of 100 Hz fills memory.
    used = slice(None) if np.all(bins >= 0) else bins >= 0
    bins = bins[used]
    count = np.bincount(bins, minlength=n)

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(bins, weights=values[used], minlength=n) / count)

    return Averages(
        time_s=mean(time_s),
        before_dph=mean(before_dph),
        after_dph=mean(after_dph),
        temperature_c=mean(np.where(np.isfinite(temperature_c), temperature_c, 0.0)),
    )


def statistics(values: FloatArray) -> dict[str, float | None]:
    """Mean, standard deviation, RMS and largest magnitude, deg/h; None where there is no sample."""
    if values.size == 0:
        return dict.fromkeys(("mean_dph", "std_dph", "rms_dph", "max_abs_dph"))
    return {
        "mean_dph": float(values.mean()),
        "std_dph": float(values.std()),
        "rms_dph": float(np.sqrt(np.mean(values**2))),
        "max_abs_dph": float(np.abs(values).max()),
    }


def time_statistics(a: Averages, average_s: float) -> dict[str, float | None]:
    """What the residual does over longer times.

    RMS of 30-minute means; RMS of the angle that one hour adds up to (1 deg/h is 1 arcsec/s);
    RMS of the first 10 minutes. None where the run is too short.
    """
    first = a.after_dph[a.time_s < a.time_s[0] - average_s / 2 + _FIRST_S] if a.time_s.size else a.after_dph
    return {
        "rms_30min_dph": _rms_of_windows(a, _HALF_HOUR_S, average_s),
        "angle_1h_arcsec": _scaled(_rms_of_windows(a, _HOUR_S, average_s), _HOUR_S),
        "first_10min_rms_dph": float(np.sqrt(np.mean(first**2))) if first.size else None,
    }


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def _rms_of_windows(a: Averages, window_s: float, average_s: float) -> float | None:
    """RMS of the means over windows that are at least 90 % full."""
    if a.time_s.size == 0:
        return None
    number = np.floor((a.time_s - a.time_s[0]) / window_s + 1e-9).astype(np.int64)
    count = np.bincount(number)
    means = np.bincount(number, weights=a.after_dph) / np.maximum(count, 1)
    full = means[count >= 0.9 * window_s / average_s]
    return float(np.sqrt(np.mean(full**2))) if full.size else None
