"""Which samples are believed: docs/numerics.md, section 1, steps 1 to 3, mirrored exactly.

Long stretches without events are done at once; one sample at a time is looked at only from an event
(a jump, a missing or stuck sample) until a sample is believed again.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .numbers import Arithmetic, Numbers

__all__ = ["BELIEVED", "HELD", "RESTART", "believe"]

HELD, BELIEVED, RESTART = 0, 1, 2  # any three numbers
_MAX_GAP = 65535  # samples, where the target stops counting: docs/numerics.md, step 2
_NEW_TRUTH = 3  # suspects that agree: docs/numerics.md, step 2


def believe(
    arithmetic: Arithmetic, x: Numbers, *, max_step: Any, step: Any, stuck_samples: int
) -> NDArray[np.int8]:
    """Verdict on every sample: HELD, BELIEVED, or RESTART (the first one, or the third agreeing suspect).

    Args:
        arithmetic: The numbers that the target computes with.
        x: Samples, shape (n,); missing ones as `arithmetic.missing`.
        max_step: Believable change between two samples, besides ...
        step: ... this much for each sample since the last believed one.
        stuck_samples: Identical samples that are believed; 0: any number.
    """
    sound = _sound(arithmetic, x, stuck_samples)
    verdict = np.zeros(x.size, dtype=np.int8)
    regular = np.zeros(x.size, dtype=np.bool_)  # believed if its predecessor is
    if x.size > 1:
        pair = sound[1:] & sound[:-1]
        with np.errstate(invalid="ignore", over="ignore"):
            regular[1:] = pair & arithmetic.is_near(x[1:], x[:-1], max_step, step, 1)
    events = np.flatnonzero(~regular)
    judge = _Judge(arithmetic, max_step, step)
    i = 0
    while i < x.size:
        if not sound[i]:
            rest = sound[i:]
            gap = int(np.argmax(rest)) if rest.any() else rest.size
            judge.hold(gap)
            i += gap
            continue
        verdict[i] = judge.take(x[i])
        i += 1
        if verdict[i - 1] != HELD:
            k = np.searchsorted(events, i)
            event = int(events[k]) if k < events.size else x.size
            verdict[i:event] = BELIEVED
            judge.last = x[event - 1]
            i = event
    return verdict


def _sound(arithmetic: Arithmetic, x: Numbers, stuck_samples: int) -> NDArray[np.bool_]:
    """Samples that are there, plausible and not stuck."""
    there = ~arithmetic.is_missing(x)
    low, high = arithmetic.plausible
    with np.errstate(invalid="ignore"):
        sound = there & (x >= low) & (x <= high)
    if stuck_samples:
        received = np.flatnonzero(there)
        bits = x[received].view(f"u{x.itemsize}")
        index = np.arange(received.size)
        fresh = np.ones(received.size, dtype=np.bool_)
        fresh[1:] = bits[1:] != bits[:-1]
        repeats = index - np.maximum.accumulate(np.where(fresh, index, 0))
        sound[received[repeats >= stuck_samples]] = False
    return np.asarray(sound)


class _Judge:
    """The state of the target between events: last believed sample, gap, suspects."""

    def __init__(self, arithmetic: Arithmetic, max_step: Any, step: Any) -> None:
        self._arithmetic = arithmetic
        self._limits = max_step, step
        self.last: Any = None
        self._gap = 1
        self._candidate: Any = None
        self._suspects = 0

    def hold(self, count: int) -> None:
        """`count` samples that are missing, implausible or stuck."""
        self._suspects = 0
        self._gap = min(_MAX_GAP, self._gap + count)

    def take(self, x: Any) -> int:
        if self.last is None:
            return self._believed(x, RESTART)
        if self._arithmetic.is_near(x, self.last, *self._limits, self._gap):
            return self._believed(x, BELIEVED)
        agrees = self._suspects and self._arithmetic.is_near(x, self._candidate, *self._limits, 1)
        self._suspects = self._suspects + 1 if agrees else 1
        self._candidate = x
        if self._suspects >= _NEW_TRUTH:
            return self._believed(x, RESTART)
        self._gap = min(_MAX_GAP, self._gap + 1)
        return HELD

    def _believed(self, x: Any, verdict: int) -> int:
        self.last, self._gap, self._suspects = x, 1, 0
        return verdict
