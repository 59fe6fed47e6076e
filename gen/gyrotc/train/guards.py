"""Guards from the recordings: what a sensor showed in training, with margins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..recordings.records import Run

__all__ = ["AGREE_S", "channel_guard", "longest_same_s", "stuck_after_s"]

AGREE_S = 1.0  # longer than any burst of wrong conversions; an alignment does not feel it
_MARGIN = 0.5  # of the range, at either end ...
_LEAST_MARGIN = 0.01  # ... and at least this share of the largest magnitude
_STEPS = 2.0  # times the largest change between two rows
_STUCK = 20.0  # times the longest that a reading stayed the same
# Below two minutes a chamber at rest would count as stuck; above 2000 s a flight would be over before it is told.
_SHORTEST_STUCK_S, _LONGEST_STUCK_S = 120.0, 2000.0


def longest_same_s(readings: NDArray[Any], period_s: float) -> float:
    """The longest time for which readings in a row were the same, s; missing ones count as others."""
    if readings.size == 0:
        return 0.0
    starts = np.flatnonzero(np.concatenate([[True], readings[1:] != readings[:-1]]))
    return float(np.diff(np.append(starts, readings.size)).max()) * period_s


def stuck_after_s(longest_s: float) -> float:
    """Time after which a reading that stays the same is stuck, s; 0 where the sensor is too coarse to tell."""
    after = max(_STUCK * longest_s, _SHORTEST_STUCK_S)
    return after if after <= _LONGEST_STUCK_S else 0.0


def channel_guard(runs: Sequence[Run], channel: str, missing_s: float) -> dict[str, float]:
    """The guard of an auxiliary channel as training runs showed it, in the fields of `model.json`."""
    columns = [np.asarray(run.rows().channel(channel)) for run in runs]
    longest = max(longest_same_s(c, run.row_period_s) for c, run in zip(columns, runs, strict=True))
    readings = [column[np.isfinite(column)] for column in columns]
    every = np.concatenate(readings)
    low, high = float(every.min()), float(every.max())
    margin = max(_MARGIN * (high - low), _LEAST_MARGIN * max(abs(low), abs(high)), 1e-6)
    step = max(float(np.max(np.abs(np.diff(r)), initial=0.0)) for r in readings)
    width = high - low + 2.0 * margin
    return {
        "low": low - margin,
        "high": high + margin,
        "max_step": max(_STEPS * step, 0.1 * width),
        "max_rate_per_min": 60.0 * width / missing_s,
        "agree_s": AGREE_S,
        "stuck_s": stuck_after_s(longest),
        "missing_s": missing_s,
        "fallback": float(np.median(every)),
    }
