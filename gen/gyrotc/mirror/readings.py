"""Decide which readings of a channel are accepted: range, plausibility, stuck readings, new starts.

Long stretches without events are done at once; one sample at a time is looked at only from an event
(a jump, a missing or stuck sample) until a sample is accepted again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .recursions import Arithmetic, NumberArray

READING_HELD, READING_ACCEPTED, READING_RESTART = 0, 1, 2  # any three numbers
_PART = 2**18  # readings that are looked at together: bounds memory
_LONGEST_US = 2**32 - 1  # that the target counts


@dataclass(frozen=True, slots=True)
class Guarded:
    """A guard of one channel as the target has it, its numbers in the numbers of the arithmetic.

    Attributes:
        low, high: Range of the readings.
        max_step: Largest accepted change between two of them, besides ...
        max_rate: ... this much for each microsecond since the last accepted one (fixed point: 2^-40).
        agree_us: Least time from the first to the last of the readings that agree and do not follow the last accepted
            one; 0: one of them is enough.
        stuck_us: How long a reading may stay the same; 0: for ever.
        missing_blocks: Blocks in a row with too few readings that are bridged. In so many blocks and one more, a
            candidate is forgotten.
        takes_edge: A reading outside the range is taken as its edge; False: it is none.
    """

    low: Any
    high: Any
    max_step: Any
    max_rate: Any
    agree_us: int
    stuck_us: int
    missing_blocks: int
    takes_edge: bool = False

    def limited(self, x: NumberArray) -> NumberArray:
        """Readings as they are judged; missing ones may be anything."""
        return np.clip(x, self.low, self.high) if self.takes_edge else x


def judge_readings(
    arithmetic: Arithmetic, x: NumberArray, guard: Guarded, *, period_us: int, block_us: int, lost: Sequence[int] = ()
) -> NDArray[np.int8]:
    """Return the verdict on every reading: READING_HELD, READING_ACCEPTED or READING_RESTART.

    A reading restarts when it and those before it agree with one another for long enough.

    Args:
        arithmetic: The numbers that the target computes with.
        x: Readings, shape (n,); missing ones as `arithmetic.missing`.
        guard: What is accepted.
        period_us: Time from reading to reading, microseconds.
        block_us: Length of a block, microseconds.
        lost: Readings before which the channel was lost, ascending: what was accepted is forgotten.
    """
    there = ~arithmetic.is_missing(x)
    judged, sound = guard.limited(x), _sound(x, there, guard, period_us)
    judge = _Judge(arithmetic, guard, period_us, block_us)
    events = _events(arithmetic, judged, sound, judge.near, lost)
    verdict = np.zeros(x.size, dtype=np.int8)
    waiting = list(lost)
    i = 0
    while i < x.size:
        while waiting and waiting[0] <= i:
            judge.last = None
            del waiting[0]
        if not sound[i]:
            rest = sound[i:]
            gap = int(np.argmax(rest)) if rest.any() else rest.size
            if there[i : i + gap].any():
                judge.forget_candidate()
            judge.hold(gap)
            i += gap
            continue
        verdict[i] = judge.take(judged[i])
        i += 1
        if verdict[i - 1] != READING_HELD:
            k = np.searchsorted(events, i)
            event = int(events[k]) if k < events.size else x.size
            verdict[i:event] = READING_ACCEPTED
            judge.last = judged[event - 1]
            i = event
    return verdict


def _events(
    arithmetic: Arithmetic, x: NumberArray, sound: NDArray[np.bool_], near: Any, lost: Sequence[int]
) -> NDArray[np.intp]:
    """Readings that are not accepted just because their predecessor is."""
    regular = np.zeros(x.size, dtype=np.bool_)
    for a in range(1, x.size, _PART):
        now, before = slice(a, a + _PART), slice(a - 1, min(a + _PART, x.size) - 1)
        with np.errstate(invalid="ignore", over="ignore"):
            regular[now] = sound[now] & sound[before] & arithmetic.is_near(x[now], x[before], near)
    regular[list(lost)] = False
    return np.flatnonzero(~regular)


def _sound(x: NumberArray, there: NDArray[np.bool_], guard: Guarded, period_us: int) -> NDArray[np.bool_]:
    """Readings that are there, in their range or taken as its edge, and not stuck."""
    with np.errstate(invalid="ignore"):
        sound = there.copy()
        if not guard.takes_edge:
            sound &= x >= guard.low
            sound &= x <= guard.high
    if guard.stuck_us:
        bits = (x if there.all() else x[there]).view(f"u{x.itemsize}")
        repeats = np.zeros(bits.size + 1, dtype=np.bool_)
        np.equal(bits[1:], bits[:-1], out=repeats[1:-1])
        first, end = (np.flatnonzero(repeats[1:] != repeats[:-1]) + 1).reshape(-1, 2).T
        most = -(-guard.stuck_us // period_us)  # readings that repeat one until it counts as stuck
        stuck = np.flatnonzero(end - first >= most)
        received = np.flatnonzero(there) if len(stuck) else first
        for k in stuck.tolist():
            sound[received[first[k] + most - 1 : end[k]]] = False
    return np.asarray(sound)


class _Judge:
    """The state of the target between events.

    Times are counted in samples, up to the sample that comes next: `gap` since the last accepted reading,
    `candidate_gap` since the candidate (None: there is none), `series` since the first reading that agrees with it.
    """

    def __init__(self, arithmetic: Arithmetic, guard: Guarded, period_us: int, block_us: int) -> None:
        self._arithmetic = arithmetic
        self._guard = guard
        self._period_us = period_us
        self._forgotten_us = min((guard.missing_blocks + 1) * block_us, _LONGEST_US)
        self.near = self._limit(1)
        self.last: Any = None
        self._gap = 1
        self._candidate: Any = None
        self._candidate_gap: int | None = None
        self._series = 0

    def _time_us(self, samples: int) -> int:
        return min(samples * self._period_us, _LONGEST_US)

    def _limit(self, gap: int) -> Any:
        """Largest accepted change after so many samples."""
        return self._arithmetic.limit(self._guard.max_step, self._guard.max_rate, self._time_us(gap))

    def forget_candidate(self) -> None:
        """Make the next reading that does not follow the first of a series."""
        self._candidate_gap = None

    def hold(self, count: int) -> None:
        """Let `count` samples pass, none of which is accepted."""
        self._gap += count
        self._series += count
        if self._candidate_gap is not None:
            self._candidate_gap += count

    def take(self, x: Any) -> int:
        """Decide on a reading that is present and sound."""
        if self._follows(x):
            return self._accepted(x, READING_ACCEPTED)
        if self._confirms(x):
            return self._accepted(x, READING_RESTART)
        self._candidate, self._candidate_gap = x, 0
        self.hold(1)
        return READING_HELD

    def _follows(self, x: Any) -> bool:
        if self.last is None:
            return False
        return bool(self._arithmetic.is_near(x, self.last, self._limit(self._gap)))

    def _confirms(self, x: Any) -> bool:
        """Test whether x is at least the third reading of its series, and late enough.

        Begins a new series if it does not agree.
        """
        if not self._guard.agree_us:
            return True
        gap = self._candidate_gap
        if gap is None or not self._agrees(x, gap):
            self._series = 0
            return False
        series_us = self._time_us(self._series)
        return series_us > self._time_us(gap) and series_us >= self._guard.agree_us

    def _agrees(self, x: Any, gap: int) -> bool:
        if self._time_us(gap) >= self._forgotten_us:
            return False
        return bool(self._arithmetic.is_near(x, self._candidate, self._limit(gap)))

    def _accepted(self, x: Any, verdict: int) -> int:
        self.last, self._gap = x, 1
        self.forget_candidate()
        return verdict
