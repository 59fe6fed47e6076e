"""Refuse networks that leave their process or the range of the samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .data import Scaling, TrainingData, average_samples
from .networks import networks_dph
from .result import Outcome

# Points of T and of dT/dt: what passes between them is narrower than a sixteenth of the range
_GRID = (33, 17)
_SIGMAS = 4.0  # of the process at a point and of a mean's noise: nothing that a compression loses comes near
_LARGEST_DPH = 7.5e6  # that a table holds


def objection_to(outcome: Outcome, samples: TrainingData, scaling: Scaling, average_s: float) -> str:
    """Return the reason why networks must not be used, in words; empty if they may.

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
    means = average_samples(samples, average_s).bias_dph
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
