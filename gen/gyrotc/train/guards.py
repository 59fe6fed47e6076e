"""Whether a trained map may be used over the envelope, and guards of sensors from the recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..quality.facts import longest_stretch
from ..recordings.records import Run
from .data import Scaling, TrainingData, average
from .result import Outcome, networks_dph

# Points of T and of dT/dt: what passes between them is narrower than a sixteenth of the range
_GRID = (33, 17)
_SIGMAS = 4.0  # of the process at a point and of a mean's noise: nothing that a compression loses comes near
_LARGEST_DPH = 7.5e6  # that a table holds


def objection(outcome: Outcome, samples: TrainingData, scaling: Scaling, average_s: float) -> str:
    """Why the networks must not be used, in words; empty if they may.

    They must not leave their process by 4 σ anywhere on the envelope, nor lie beyond the lowest or highest mean of
    the samples by more than these differ, nor hold numbers that no table holds.
    """
    t, r = (
        x.ravel()
        for x in np.meshgrid(
            np.linspace(*scaling.temperature_c, _GRID[0]), np.linspace(*scaling.slope_c_per_min, _GRID[1])
        )
    )
    values = networks_dph(outcome.networks, scaling, t, r)
    if not np.all(np.isfinite(values)):
        return "it is not finite everywhere"
    if _largest(outcome.networks) > _LARGEST_DPH:
        return f"its weights reach {_largest(outcome.networks):.3g} deg/h, more than a table holds"
    process = outcome.process
    if process is not None:
        z = scaling.normalise(t, r)
        noise = process.noise_dph**2 * min(process.seconds / average_s, 1.0)
        sigma = np.sqrt(process.variance_dph2(*z) + noise)
        distance = np.abs(values - process.mean_dph(*z)) / sigma
        if distance.max() > _SIGMAS:
            k = int(np.argmax(distance))
            return f"it leaves the process that it stands for by {distance[k]:.3g} sigma at {_place(t[k], r[k])}"
        if process.asked is not None:  # a lot knows what lies beyond the unit's own means
            return ""
    means = average(samples, average_s).bias_dph
    low, high = float(means.min()), float(means.max())
    beyond = np.maximum(low - values, values - high)
    k = int(np.argmax(beyond))
    rounding = 1e-9 * max(abs(low), abs(high))
    if beyond[k] > high - low + rounding:
        return f"at {_place(t[k], r[k])} it says {values[k]:.4g} deg/h, where the means span {low:.4g} ... {high:.4g}"
    return ""


def _place(t: float, r: float) -> str:
    return f"{t:.4g} C, {r:+.3g} C/min"


def _largest(networks: Sequence[Mapping[str, Any]]) -> float:
    """Largest magnitude of a number of deg/h in the networks."""
    return max(float(np.abs(np.concatenate([[n["w0"]], n["linear"], n["weights"]])).max()) for n in networks)


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
