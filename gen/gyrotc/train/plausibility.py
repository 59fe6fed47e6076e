"""Derive from training runs the thresholds at which a target rejects readings of a channel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray, parts_of
from ..common.metrics import median_of_parts
from ..quality.findings import longest_stretch
from ..recordings.records import Run

AGREE_S = 1.0  # longer than any burst of wrong conversions; an alignment does not feel it
_MARGIN = 0.5  # of the range, at either end ...
_LEAST_MARGIN = 0.01  # ... and at least this share of the largest magnitude
_STEPS = 2.0  # times the largest change between two rows
_STUCK = 20.0  # times the longest that a reading stayed the same
# Below two minutes a chamber at rest would count as stuck; above 2000 s a flight would be over before it is reported.
_SHORTEST_STUCK_S, _LONGEST_STUCK_S = 120.0, 2000.0
# A target reads a thermometer once a second or more often; a longer row is a mean or one of many readings, which repeat
# less than those that the target sees: a coarse sensor at rest would count as stuck.
_LONGEST_READING_S = 1.5


def longest_same_s(readings: NDArray[Any], period_s: float) -> float:
    """The longest time for which readings in a row were the same, s; missing ones count as others.

    Infinite where rows are too long to be single readings: they do not show it.
    """
    if period_s > _LONGEST_READING_S:
        return float("inf")
    return longest_stretch(readings)[1] * period_s


def stuck_after_s(longest_s: float) -> float:
    """Time after which a reading that stays the same is stuck, s; 0 where sensor or rows are too coarse to tell."""
    after = max(_STUCK * longest_s, _SHORTEST_STUCK_S)
    return after if after <= _LONGEST_STUCK_S else 0.0


def channel_guard(runs: Sequence[Run], channel: str, missing_s: float) -> dict[str, float]:
    """The guard of an auxiliary channel as training runs showed it, in the fields of `model.json`."""
    low, high, step, longest = np.inf, -np.inf, 0.0, 0.0
    for run in runs:
        column, last = run.rows().channel(channel), np.zeros(0)
        longest = max(longest, longest_same_s(column, run.row_period_s))
        for part in _readings(column):
            low, high = min(low, float(part.min())), max(high, float(part.max()))
            step = max(step, float(np.max(np.abs(np.diff(np.append(last, part))), initial=0.0)))
            last = part[-1:]
        del column  # before the rows of the next run are read
    margin = max(_MARGIN * (high - low), _LEAST_MARGIN * max(abs(low), abs(high)), 1e-6)
    width = high - low + 2.0 * margin
    return {
        "low": low - margin,
        "high": high + margin,
        "max_step": max(_STEPS * step, 0.1 * width),
        "max_rate_per_min": 60.0 * width / missing_s,
        "agree_s": AGREE_S,
        "stuck_s": stuck_after_s(longest),
        "missing_s": missing_s,
        "fallback": median_of_parts(lambda: readings_of(runs, channel)),
    }


def readings_of(runs: Sequence[Run], channel: str) -> Iterator[FloatArray]:
    """Yield the readings of a channel in runs, part by part."""
    for run in runs:
        yield from _readings(run.rows().channel(channel))


def _readings(column: FloatArray) -> Iterator[FloatArray]:
    """Yield readings that are not missing, as copies, so that no rows are held when the next run is read."""
    for part in parts_of(len(column)):
        found = column[part][np.isfinite(column[part])]
        if found.size:
            yield found
