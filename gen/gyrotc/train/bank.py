"""A database of models, chosen at run time by temperature and its rate (Ding et al. 2014, conclusions).

The paper has one model for each environment. At run time a gyro knows T and dT/dt only, so the envelope is
cut into cooling, holding and warming, which overlap; each gets a network of its own by the default method.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..common.metrics import LEAST_SPAN_C
from .data import Scaling, TrainingData
from .mrbf import fit_mrbf
from .result import Outcome

__all__ = ["fit_bank"]

_HOLD = 0.1  # |dT/dt| of a hold, share of the half range; the hold's region reaches to twice that
_MIN_SAMPLES = 100  # a quarter of an hour in blocks of 10 s: with fewer a region has no map of its own


def fit_bank(
    data: TrainingData, scaling: Scaling, *, seed: int, centers: int | None, average_s: float
) -> Outcome:
    """Trains up to three networks; one without a region where the samples do not allow three.

    `centers` counts for each network.
    """
    edge = _HOLD * scaling.half_range_c_per_min
    low, high = scaling.slope_c_per_min
    regions = [(low, -edge), (max(low, -2.0 * edge), min(high, 2.0 * edge)), (edge, high)]
    parts = [_part(data, region) for region in regions]
    if not all(_enough(part) for part in parts):
        return fit_mrbf(data, scaling, seed=seed, centers=centers, average_s=average_s)
    found = [fit_mrbf(part, scaling, seed=seed, centers=centers, average_s=average_s) for part in parts]
    networks: list[dict[str, Any]] = []
    for outcome, region in zip(found, regions, strict=True):
        bounds = {"temperature_c": list(scaling.temperature_c), "slope_c_per_min": list(region)}
        networks.append({**outcome.networks[0], "region": bounds})
    names = ("cooling", "holding", "warming")
    return Outcome(
        networks=networks,
        curves={name: outcome.curves for name, outcome in zip(names, found, strict=True)},
    )


def _part(data: TrainingData, region: tuple[float, float]) -> TrainingData:
    inside = (data.slope_c_per_min >= region[0]) & (data.slope_c_per_min <= region[1])
    return data.select(inside)


def _enough(part: TrainingData) -> bool:
    return len(part) >= _MIN_SAMPLES and float(np.ptp(part.temperature_c)) >= LEAST_SPAN_C
