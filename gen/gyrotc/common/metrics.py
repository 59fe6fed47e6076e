"""Figures of merit of a gyro record before and after compensation (means over `average_s`).

Knows arrays only. All RMS figures are of averaged rates; standard deviations are about the mean
with ddof 0; pooled figures are over all averaged samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import FloatArray, parts_of
from .inputs import need_memory

__all__ = [
    "FIRST_S",
    "HALF_HOUR_S",
    "HOUR_S",
    "LEAST_SPAN_C",
    "MAD_TO_SIGMA",
    "Averager",
    "Averages",
    "ReadParts",
    "average_rows",
    "cell_length_s",
    "jackknife_blocks",
    "lagged_products",
    "median",
    "median_of_parts",
    "median_step",
    "middle_of_five",
    "quantile_of_parts",
    "statistics_of",
    "time_statistics",
    "window_means",
]


MAD_TO_SIGMA = 1.0 / NormalDist().inv_cdf(0.75)
"""σ of a normal distribution over its median absolute deviation: half of it lies within its quartiles."""

LEAST_SPAN_C = 2.0
"""A smaller span of temperature says nothing about temperature (finding `no_temperature_information`)."""

HALF_HOUR_S = 1800.0  # the name of the figure says it
HOUR_S = 3600.0  # the name of the figure says it
FIRST_S = 600.0  # ten minutes: the name of the figure says it
# Time stamps of two means may be farther apart by this, as their rows are not quite regular.
_TIME_ERROR_S = 1.0
# Six correlation times of 20 minutes: with blocks of an hour, U of a mean held in 86 to 90 % of cases in place of 95 %.
_BLOCK_S = 7200.0
# Blocks are shorter where two hours would give fewer than this: few squares hardly tell a variance.
_MIN_BLOCKS = 8
# Means in a block, at least.
_MIN_MEANS = 4
_BIN_BYTES = 40  # of a mean while it is made: its count and four sums


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


ReadParts = Callable[[], Iterable[FloatArray]]
"""Numbers part by part, each time they are asked for: arrays of float64, none of them NaN."""

_TOGETHER = 2**18  # numbers that are put in order at once: 2 MiB
_NOT_SIGN = 2**63 - 1  # every bit of a float64 but its sign
_DIGIT_BITS = 16  # of a float64: its numbers are in the order of their keys (`_keys`), so four digits find one


def median_of_parts(parts: ReadParts) -> float:
    """`median` of numbers that do not fit in memory together, to the bit."""
    return sum(_middle(parts, lambda count: ((count - 1) // 2, count // 2))) / 2


def median_step(time_s: FloatArray) -> float:
    """`median` of the differences of neighbours of increasing numbers, two at least, to the bit."""
    return median_of_parts(lambda: (np.diff(time_s[p.start : p.stop + 1]) for p in parts_of(len(time_s) - 1)))


def quantile_of_parts(parts: ReadParts, share: float) -> float:
    """`np.quantile` of numbers that do not fit in memory together, to the bit."""
    fraction = 0.0

    def ranks(count: int) -> tuple[int, int]:
        nonlocal fraction
        fraction, at = math.modf((count - 1) * share)
        return int(at), min(int(at) + 1, count - 1)

    return float(np.quantile(_middle(parts, ranks), fraction))


def _middle(parts: ReadParts, ranks_of: Callable[[int], tuple[int, int]]) -> tuple[float, float]:
    """The numbers of two ranks that follow each other (or are one), counted from 0, by digits of their bits."""
    together: list[FloatArray] = []
    for part in parts():
        together.append(part)
        if sum(map(len, together)) > _TOGETHER:
            break
    else:
        few = np.concatenate(together)
        few.partition(ranks := ranks_of(few.size))
        return float(few[ranks[0]]), float(few[ranks[1]])
    del together, part  # behind the loop, which holds what the parts come from
    return _farthest(parts, ranks_of)


def _farthest(parts: ReadParts, ranks_of: Callable[[int], tuple[int, int]]) -> tuple[float, float]:
    """Find both middle values of many numbers: count leading digits, and go on with those at the ranks."""
    lowest, below, ranks = -(2 ** (_DIGIT_BITS - 1)), 0, None
    for shift in range(64 - _DIGIT_BITS, -1, -_DIGIT_BITS):

        def digits(shift: int = shift, lowest: int = lowest) -> Iterable[tuple[FloatArray, NDArray[np.int64]]]:
            for part in parts():
                digit = _keys(part) >> shift
                digit -= lowest
                mine = (digit >= 0) & (digit < 2**_DIGIT_BITS)
                yield part[mine], digit[mine]

        count = np.zeros(2**_DIGIT_BITS, dtype=np.int64)
        for _, digit in digits():
            count += np.bincount(digit, minlength=count.size)
        ends = below + np.cumsum(count)
        ranks = ranks or ranks_of(int(ends[-1]))
        first, last = np.searchsorted(ends, ranks, side="right").tolist()
        below = int(ends[first] - count[first])
        if first != last:  # so the one is the largest with its digit, the other the smallest
            return (
                max(float(part[digit == first].max(initial=-np.inf)) for part, digit in digits()),
                min(float(part[digit == last].min(initial=np.inf)) for part, digit in digits()),
            )
        if count[first] <= _TOGETHER:
            few = np.sort(np.concatenate([part[digit == first] for part, digit in digits()]))
            return float(few[ranks[0] - below]), float(few[ranks[1] - below])
        lowest = (lowest + first) << _DIGIT_BITS
    return (float(_keys(np.array([lowest >> _DIGIT_BITS]).view(np.float64)).view(np.float64)[0]),) * 2


def _keys(numbers: FloatArray) -> NDArray[np.int64]:
    """Whole numbers in the order of the numbers: their bits, all but the sign turned over where they are negative.

    The same turns the bits of a key into those of its number.
    """
    bits = np.ascontiguousarray(numbers).view(np.int64)
    return np.asarray(bits ^ ((bits >> 63) & _NOT_SIGN))


def middle_of_five(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, e: FloatArray) -> FloatArray:
    """Median of each five numbers, none of them NaN; arrays of one shape."""
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return np.asarray(np.maximum(np.minimum(low, high), np.minimum(np.maximum(low, high), e)))


def cell_length_s(length_s: float, period_s: float) -> float:
    """Return the length of the cells of means over `length_s`, of rows or samples that last `period_s`.

    If rows are longer than 2/3 of `length_s`, each is a mean: one row is then nearer to that length than two.
    """
    return period_s if period_s > length_s / 1.5 else length_s


class Averager:
    """Means of the scored rows of one run over `average_s`, of rows that come part by part.

    Bins begin at `from_s`, at or before the first row; None: at the first row. A row belongs to the bin that holds its
    middle, so time stamps may be off by half a row period. Bins less than half full are left out.

    Args:
        time_s: Times of all rows, shape (n,), increasing.
        average_s: Length of a bin, s.
        from_s: Where the first begins.
    """

    def __init__(self, time_s: FloatArray, average_s: float, from_s: float | None = None) -> None:
        self._period = median_step(time_s) if time_s.size > 1 else average_s
        self._average_s = cell_length_s(average_s, self._period)
        self._from_s = (float(time_s[0]) if time_s.size else 0.0) if from_s is None else from_s
        bins = int(self._bins(time_s[-1:])[0]) + 1 if time_s.size else 0
        need_memory(_BIN_BYTES * float(bins), "the recording", f"its means over {average_s:g} s")
        self._count, self._sums = np.zeros(bins, dtype=np.int64), np.zeros((4, bins))

    def _bins(self, time_s: FloatArray) -> NDArray[np.int64]:
        passed = time_s - self._from_s
        passed += 0.5 * self._period
        passed /= self._average_s
        return np.floor(passed, out=passed).astype(np.int64)

    def add(
        self,
        time_s: FloatArray,
        temperature_c: FloatArray,
        before_dph: FloatArray,
        after_dph: FloatArray,
        scored: NDArray[np.bool_],
    ) -> None:
        """Add the next rows, in order of time."""
        used = scored & np.isfinite(before_dph) & np.isfinite(after_dph)
        bins = self._bins(time_s)
        if not used.all():
            bins = bins[used]
        if bins.size == 0:
            return
        first, after = int(bins[0]), int(bins[-1]) + 1
        self._count[first:after] += np.bincount(bins - first)
        index = np.concatenate([[0], bins - first])
        known_c = np.where(np.isfinite(temperature_c), temperature_c, 0.0)
        for sums, column in zip(self._sums, (time_s, before_dph, after_dph, known_c), strict=True):
            # The sum of a bin that goes on comes first, so that it is added up in the order of its rows.
            values = np.concatenate([sums[first : first + 1], column[used]])
            sums[first:after] = np.bincount(index, values)

    def averages(self) -> Averages:
        """The means of what was added."""
        kept = self._count >= max(0.5 * self._average_s / self._period, 1.0)
        time_s, before, after, temperature = self._sums[:, kept] / self._count[kept]
        return Averages(time_s, before, after, temperature)


def average_rows(
    time_s: FloatArray,
    temperature_c: FloatArray,
    before_dph: FloatArray,
    after_dph: FloatArray,
    *,
    scored: NDArray[np.bool_],
    average_s: float,
    from_s: float | None = None,
) -> Averages:
    """Average rows that are in memory together; see `Averager`."""
    made = Averager(time_s, average_s, from_s)
    made.add(time_s, temperature_c, before_dph, after_dph, scored)
    return made.averages()


def statistics_of(values: FloatArray) -> dict[str, float | None]:
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
    """Compute statistics of the residual over longer times.

    RMS of 30-minute means; RMS of the angle that one hour adds up to (1 deg/h is 1 arcsec/s);
    RMS of the first 10 minutes. None where the run is too short.
    """
    first = a.after_dph[a.time_s < a.time_s[0] - average_s / 2 + FIRST_S] if a.time_s.size else a.after_dph
    return {
        "rms_30min_dph": _rms_of_windows(a, HALF_HOUR_S, average_s),
        "angle_1h_arcsec": _scaled(_rms_of_windows(a, HOUR_S, average_s), HOUR_S),
        "first_10min_rms_dph": float(np.sqrt(np.mean(first**2))) if first.size else None,
    }


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def _rms_of_windows(a: Averages, window_s: float, average_s: float) -> float | None:
    means = window_means(a, window_s, average_s)
    return float(np.sqrt(np.mean(means**2))) if means.size else None


def window_means(a: Averages, window_s: float, average_s: float) -> FloatArray:
    """Means after compensation over windows that are at least 90 % full, deg/h, shape (windows,)."""
    if a.time_s.size == 0:
        return np.zeros(0)
    number = np.floor((a.time_s - a.time_s[0]) / window_s + 1e-9).astype(np.int64)
    count = np.bincount(number)
    means = np.bincount(number, weights=a.after_dph) / np.maximum(count, 1)
    return np.asarray(means[count >= 0.9 * window_s / _distance_s(a, average_s) - 1e-6])


def jackknife_blocks(runs: Sequence[Averages], average_s: float) -> list[Averages]:
    """Cut runs into blocks of about two hours, shorter ones if they would be few, which a jackknife leaves out."""
    length = max(min(_BLOCK_S / average_s, sum(len(a.time_s) for a in runs) / _MIN_BLOCKS), float(_MIN_MEANS))
    blocks = []
    for a in runs:
        columns = (a.time_s, a.before_dph, a.after_dph, a.temperature_c)
        cut = [np.array_split(column, max(1, round(len(column) / length))) for column in columns]
        blocks += [Averages(*block) for block in zip(*cut, strict=True) if len(block[0])]
    return blocks


def lagged_products(a: Averages) -> tuple[float, int]:
    """Return sum and number of the products of two means after compensation that are up to half an hour apart.

    Neighbouring means count although they may be of more than half an hour.
    """
    n = len(a.time_s)
    first = np.arange(1, n + 1)  # index of the next mean
    end = np.searchsorted(a.time_s, a.time_s + HALF_HOUR_S + _TIME_ERROR_S)
    end = np.maximum(end, np.minimum(first + 1, n))
    sums = np.concatenate([[0.0], np.cumsum(a.after_dph)])
    return float(a.after_dph @ (sums[end] - sums[first])), int(np.sum(end - first))


def _distance_s(a: Averages, average_s: float) -> float:
    """Return the distance of consecutive means, which are rows if these are long (`cell_length_s`)."""
    steps = np.diff(a.time_s)
    return float(steps[steps <= 1.5 * median(steps)].mean()) if steps.size else average_s
