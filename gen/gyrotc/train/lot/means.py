"""What runs say of a map, gathered into a few hundred means: what a lot is learnt from, and what it is held against."""

from __future__ import annotations

import numpy as np

from ..data import Scaling, TrainingData, average, gather
from ..process import MEAN_S, Process
from ..residual_noise import difference_sigma
from .learn import UnitMeans

__all__ = ["unit_means"]

_GRID = 2.0**30  # of a spread: as many digits as a file holds


def unit_means(samples: TrainingData, scaling: Scaling, process: Process | None) -> tuple[UnitMeans, float]:
    """Means over 50 s of cleaned samples, gathered into cells of 1/50 of each half range; and their length, s.

    Args:
        scaling: Normalisation of the cells.
        process: What the outliers were found by and the noise is known from; None: nothing is left out, and the noise
            is that of differences. Noise that differences do not show (a drift) shows in what a process leaves.
    """
    means = average(samples, MEAN_S)
    weight = means.weight / np.median(means.weight)
    sigma = difference_sigma(means, means.bias_dph, weight)
    kept = np.ones(len(means), dtype=bool)
    if process is not None and len(process.kept) == len(means):
        kept, sigma = process.kept, max(sigma, process.noise_dph)
    t, r = scaling.normalise(means.temperature_c[kept], means.slope_c_per_min[kept])
    bias = means.bias_dph[kept]
    bins = gather(t, r, bias, weight[kept])
    sigma = sigma or max(float(np.std(bias)), abs(float(bias[0])) / _GRID, 1e-12)  # a record without noise
    found = UnitMeans(
        temperature_c=bins.t * scaling.half_range_c + scaling.center_c,
        slope_c_per_min=bins.r * scaling.half_range_c_per_min,
        bias_dph=bins.mean,
        count=bins.count,
        sigma_dph=sigma,
    )
    return found, float(np.median(means.duration_s))
