"""Train the bank of models of Ding et al. 2014: one network each for cooling, holding and warming.

The paper has one model for each environment. At run time a gyro knows T and dT/dt only, so the envelope is cut into
three regions of dT/dt, which overlap. Each region gets a network of the default method.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.metrics import LEAST_SPAN_C
from .data import Scaling, TrainingData
from .mrbf import fit_mrbf
from .result import Outcome

# |dT/dt| of a hold, as a share of the half range. The region of holds reaches to twice that.
_HOLD_SHARE = 0.1
# A region with fewer samples has no map of its own; 100 blocks of 10 s are a quarter of an hour.
_MIN_SAMPLES = 100


def fit_bank(
    data: TrainingData,
    scaling: Scaling,
    *,
    seed: int,
    centers: int | None,
    average_s: float,
    power_on: NDArray[np.int64] | None = None,
) -> Outcome:
    """Train up to three networks; one without a region if the samples do not allow three.

    `centers` counts for each network. Arguments and errors are those of `fit_mrbf`.
    """
    arguments: dict[str, Any] = {"seed": seed, "centers": centers, "average_s": average_s, "power_on": power_on}
    edge = _HOLD_SHARE * scaling.half_range_c_per_min
    low, high = scaling.slope_c_per_min
    regions = {
        "cooling": (low, -edge),
        "holding": (max(low, -2.0 * edge), min(high, 2.0 * edge)),
        "warming": (edge, high),
    }
    parts = {name: _part(data, region) for name, region in regions.items()}
    if not all(map(_suffices, parts.values())):
        return fit_mrbf(data, scaling, **arguments)
    networks: list[dict[str, Any]] = []
    curves: dict[str, Any] = {}
    for name, region in regions.items():
        outcome = fit_mrbf(parts[name], scaling, **arguments)
        bounds = {"temperature_c": list(scaling.temperature_c), "slope_c_per_min": list(region)}
        networks.append({**outcome.networks[0], "region": bounds})
        curves[name] = outcome.curves
    return Outcome(networks=networks, curves=curves)


def _part(data: TrainingData, region: tuple[float, float]) -> TrainingData:
    low, high = region
    return data.select((data.slope_c_per_min >= low) & (data.slope_c_per_min <= high))


def _suffices(part: TrainingData) -> bool:
    return len(part) >= _MIN_SAMPLES and float(np.ptp(part.temperature_c)) >= LEAST_SPAN_C
