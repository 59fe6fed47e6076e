"""Find rows that hold a value which the sensor did not measure: stuck, at an end stop, or written for no reading.

A value that repeats oftener than chance repeats it is stuck. A rate that piles up at its largest value, its smallest,
or at zero is at an end stop or was not there.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..common.arrays import FloatArray, IntArray, parts_of, steps_where
from ..common.metrics import quantile_of_parts
from ..common.statistics import noise_of
from .odds import OCTAVE, WINDOW, cost_of

# Rows to one share of repetitions: a coarse value repeats more at some levels than at others.
_GROUP = 100
# Quantile of these shares, and the factor of its odds, that are taken as what chance does at most.
_OFTEN, _MORE_OFTEN = 0.9, 2.0
# Steps of a column from row to row at their 95 % quantile, times this: no ramp of the programme goes on by more.
_RELEASE = 3.0
_ON_RAMPS = 0.95
# Distinct values among the first rows: with fewer, what looks like a pile is a step of the converter.
_MIN_LEVELS = 4 * OCTAVE
_SAMPLE = 2**14
# No smooth distribution over so many levels has one with this many times the rows of the levels beside it.
_PILE = 2.0
# Noise reaches a stop that is no farther than so many of its standard deviations.
_REACH = 4.0
# Correlation of neighbouring second differences: it is -2/3 for noise, and positive for what is smooth.
_ALTERNATES = -1.0 / 3.0
# Rows at a stop that cuts off the noise, of 64 rows, from which on they are left out.
_CUT_ROWS = 4


class Repeats(NamedTuple):
    """A stretch of one value: first row, row after the last, the value, log-odds."""

    first: int
    end: int
    value: float
    log_odds: float


def stuck(values: FloatArray, *, needs_release: bool) -> list[Repeats]:
    """Find stretches in which a value repeats oftener than chance repeats it.

    Args:
        values: A column of finite values in order of time.
        needs_release: A stretch counts only if the next value shows that the quantity went on, since a temperature may
            hold; at the end of the column, if its noise showed until then.
    """
    n = len(values)
    if n < 2:
        return []
    again = steps_where(values, lambda step: step == 0.0)
    if again.all():
        return []  # a column of one value is no event of the run: the finding `constant_channel` names it
    starts = np.flatnonzero(again & ~np.r_[False, again[:-1]])
    lengths = np.flatnonzero(again & ~np.r_[again[1:], False]) - starts + 2
    count = max(len(again) // _GROUP, 1)
    shares = again[: len(again) // count * count].reshape(count, -1).mean(axis=1)
    chance = max(float(np.quantile(shares, _OFTEN)), 1.0 / n)
    if chance == 1.0:
        chance = float(again.mean())
    chance = _MORE_OFTEN * chance / (1.0 + (_MORE_OFTEN - 1.0) * chance)
    odds = -(lengths - 1) * np.log(chance) - cost_of(2.0 * n)
    likely = np.flatnonzero(odds > 0.0)
    if needs_release and len(likely):

        def moves() -> Iterator[FloatArray]:
            for part in parts_of(n - 1):
                size = np.abs(np.diff(values[part.start : part.stop + 1]))
                yield size[size > 0.0]

        release = _RELEASE * quantile_of_parts(moves, _ON_RAMPS)
        ends = (starts + lengths)[likely]
        goes_on = np.abs(values[np.minimum(ends, n - 1)] - values[ends - 1]) > release
        goes_on[-1] |= ends[-1] == n and _shows_noise(values, int(starts[likely[-1]]))
        likely = likely[goes_on]
    return [
        Repeats(int(starts[k]), int(starts[k] + lengths[k]), float(values[starts[k]]), float(odds[k])) for k in likely
    ]


def _shows_noise(values: FloatArray, first: int) -> bool:
    """Test whether the noise of a column showed in the rows before one: no hold of a programme ends it.

    Second differences of noise alternate and are those of several steps. What is smooth bends to one side for several
    rows, and the resolution of a ramp without noise makes one step at most.
    """
    bends = np.diff(values[max(first - WINDOW, 0) : first], 2)
    alternate = len(bends) == WINDOW - 2 and bends[1:] @ bends[:-1] < _ALTERNATES * (bends @ bends)
    return bool(alternate and noise_of(bends) / np.sqrt(6.0) > resolution(values))


def resolution(values: FloatArray) -> float:
    """Return the smallest difference of two of the first values; infinite if they are all the same."""
    levels = np.unique(values[:_SAMPLE])
    return float(np.diff(levels).min()) if len(levels) > 1 else np.inf


def piles(rate: FloatArray) -> Iterator[tuple[Repeats, IntArray]]:
    """Yield the values at which a rate piles up, and the stretches of rows that hold them, shape (k, 2).

    Rows within an octave of one another are one stretch: what lies between two rows at an end stop is the part of the
    noise that the stop did not cut off. Where a stop is within the noise of the rows beside it, stretches need one row
    in 16 there: fewer shift the mean by less than a thirtieth of the noise, and leaving them out would shift it by more
    than four times as much.
    """
    n = len(rate)
    if n == 0 or len(np.unique(rate[:_SAMPLE])) < _MIN_LEVELS:
        return
    largest, smallest = float(rate.max()), float(rate.min())
    for value in dict.fromkeys((largest, smallest, 0.0)):
        at = np.flatnonzero(rate == value)
        if len(at) <= OCTAVE:
            continue
        beside = max(_beside(rate - value), _beside(value - rate))
        share, most = len(at) / (len(at) + beside), _PILE / (1.0 + _PILE)
        if share <= most:
            continue
        odds = len(at) * np.log(share / most) - cost_of(3.0)
        odds += beside * np.log((1.0 - share) / (1.0 - most)) if beside else 0.0
        if odds > 0.0:
            more = _CUT_ROWS - 1 if value in (largest, smallest) and _cuts_noise(rate, at) else 0
            dense = np.flatnonzero(at[more:] - at[: len(at) - more] < OCTAVE**2)
            first, last = at[dense], at[dense + more]
            begins = np.r_[True, first[1:] - last[:-1] > OCTAVE][: len(first)]
            stretches = np.stack([first[begins], last[np.r_[begins[1:], True][: len(first)]] + 1], axis=1)
            yield Repeats(int(at[0]), int(at[-1]) + 1, value, float(odds)), stretches


def _cuts_noise(rate: FloatArray, at: IntArray) -> bool:
    """Test whether rows at an end stop are noise that it cuts off: rows beside them lie within the noise of it."""
    beside = np.setdiff1d(np.r_[at - 1, at + 1], at)
    beside = beside[(beside >= 0) & (beside < len(rate))]
    if not len(beside):
        return False
    noise = noise_of(np.diff(rate[beside[0] : beside[0] + _SAMPLE])) / np.sqrt(2.0)
    return bool(np.median(np.abs(rate[beside] - rate[at[0]])) < _REACH * noise)


def _beside(distance: FloatArray) -> int:
    """Return how many rows are at the next level above 0."""
    above = distance[distance > 0.0]
    return int(np.count_nonzero(above < 1.5 * above.min())) if len(above) else 0
