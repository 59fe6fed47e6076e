"""States over gaps of a training run: what they are learned from, and how well they are known.

A target that loses its temperature for long begins again at rest behind the gap (docs/numerics.md, section 1). The gyro
in the chamber did not: its temperature went on. States are therefore learned as they would be had no row been missing,
with the temperature on a straight line over the gap, and they are known as far as they hang little on that line. The
bounds are those of any temperature that the run's fastest rate lets out and back in time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..mirror.front_end import FROM_MAP, Steps
from ..mirror.recursions import Course, Recursion, TermOutcome
from ..mirror.table import WARMING

_FASTEST = 0.99  # quantile of the changes from block to block that counts as the fastest rate: larger ones are noise


@dataclass(frozen=True)
class BridgedCourse:
    """The corrections of a run as terms would see them without gaps.

    Attributes:
        course: One correction for each block, the temperature of missing ones on a straight line.
        low, high: The same with the least and the greatest temperature that missing blocks may have had.
        at: For every correction of the recorded course that one of `course`.
        has_slope: Whether dT/dt is known at a recorded correction, as it is not just behind a gap.
    """

    course: Course
    low: Course
    high: Course
    at: NDArray[np.int64]
    has_slope: NDArray[np.bool_]

    @staticmethod
    def over(recorded: Course, steps: Steps) -> BridgedCourse | None:
        """Return the course without gaps; None where the target does not begin again behind one.

        Args:
            recorded: Corrections as terms of the target see them.
            steps: The same corrections of the front end.
        """
        first = int(np.argmax(~recorded.closes)) if (~recorded.closes).any() else recorded.closes.size
        block = recorded.elapsed - recorded.elapsed[first] if first < recorded.closes.size else np.zeros(0, np.int64)
        number = np.arange(block.size)
        made = (steps.kind == FROM_MAP) & (recorded.closes | (number == first)) & (number >= first)
        there = block[made]
        if there.size == 0 or there.size == int(there[-1]) + 1 or recorded.closes[first + 1 :].all():
            return None
        every = np.arange(int(there[-1]) + 1)
        temperature = np.interp(every, there, recorded.temperature[made])
        course = Course(temperature, every > 0, recorded.elapsed[first] + every)
        low, high = _bounds(there, recorded.temperature[made], temperature)
        warming = (steps.remarks & WARMING) != 0
        warming[: first + int(np.argmin(warming[first:]))] = False  # the first start is no gap
        at = np.clip(block, 0, every[-1])
        return BridgedCourse(course, replace(course, temperature=low), replace(course, temperature=high), at, ~warming)

    def apply(self, recursion: Recursion, outcome: TermOutcome) -> None:
        """Change the outcome at every recorded correction as a term without gaps would."""
        made = _outcome(recursion, self.course)
        outcome.added = outcome.added + made.added[self.at]
        if made.temperature is not self.course.temperature:
            outcome.temperature, outcome.slope = made.temperature[self.at], made.slope[self.at]

    def uncertainty(self, recursion: Recursion) -> tuple[FloatArray, FloatArray]:
        """Return how far the bounds are from the course, in what the map sees (C) and in what is added."""
        course, *bounds = (_outcome(recursion, one) for one in (self.course, self.low, self.high))
        of_map = np.maximum(*(np.abs(bound.temperature - course.temperature) for bound in bounds))
        added = np.maximum(*(np.abs(bound.added - course.added) for bound in bounds))
        return of_map[self.at], added[self.at]


def _outcome(recursion: Recursion, course: Course) -> TermOutcome:
    x = course.temperature
    made = TermOutcome(x, np.zeros_like(x), np.zeros_like(x), np.zeros(x.size, dtype=np.int32))
    recursion.apply(course, None, made)
    return made


def _bounds(there: NDArray[np.int64], recorded_c: FloatArray, bridged_c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least and greatest temperature of every block; of a recorded one its own."""
    beside = np.diff(there) == 1
    rate = float(np.quantile(np.abs(np.diff(recorded_c))[beside], _FASTEST)) if beside.any() else np.inf
    low, high = bridged_c.copy(), bridged_c.copy()
    for k in np.flatnonzero(~beside):
        gap = slice(int(there[k]) + 1, int(there[k + 1]))
        ends = recorded_c[k : k + 2]
        beyond = max(0.5 * (rate * float(there[k + 1] - there[k]) - float(np.ptp(ends))), 0.0)
        low[gap] = max(float(ends.min()) - beyond, float(recorded_c.min()))
        high[gap] = min(float(ends.max()) + beyond, float(recorded_c.max()))
    return low, high
