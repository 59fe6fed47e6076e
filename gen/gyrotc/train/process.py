"""The evidence model on training samples: means over 50 s, standardised, outliers dropped.

Its mean is the target that `mrbf` compresses; its variance is the shape of the uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..metrics import MAD_TO_SIGMA
from .data import Bins, Scaling, TrainingData, average, gather

__all__ = ["Process", "fit_process"]

Floats = NDArray[np.float64]

MEAN_S = 50.0
_TRIM_SIGMA = 4.5  # a normal deviation lies beyond it once in 150,000
_TRIMS = 3  # rounds of dropping and fitting again
_GRID = 2.0**24  # of the standardised bias, so that the last digit of its unit (deg/h, rad/s) steers nothing


@dataclass(frozen=True, slots=True)
class Process:
    """A conditioned process and the samples that it has seen.

    Attributes:
        model: The process in standardised units.
        bins: What it was conditioned on.
        t, r: Normalised inputs of the means.
        y: Standardised bias of the means: (bias − center)/spread.
        weight: Their weights, median 1.
        run: Their runs.
        kept: False for outliers.
        center, spread: deg/h.
        seconds: Length of a mean, s.
    """

    model: _core.EvidenceModel
    bins: Bins
    t: Floats
    r: Floats
    y: Floats
    weight: Floats
    run: NDArray[np.int64]
    kept: NDArray[np.bool_]
    center: float
    spread: float
    seconds: float

    def mean_dph(self, t: Floats, r: Floats) -> Floats:
        """Mean at normalised inputs, deg/h."""
        return self.center + self.spread * self.model.mean(t, r)

    def variance_dph2(self, t: Floats, r: Floats) -> Floats:
        """Variance of the mean at normalised inputs, (deg/h)²."""
        return self.spread**2 * self.model.variance(t, r)

    @property
    def noise_dph(self) -> float:
        """σ of a mean of weight 1, deg/h."""
        return self.spread * self.model.sigma


def fit_process(data: TrainingData, scaling: Scaling, like: Process | None = None) -> Process:
    """Maximum evidence on samples; |residual| beyond 4.5 robust σ is dropped; at most three rounds.

    Args:
        like: A process on nearly the same samples, from whose parameters the search starts.
    """
    means = average(data, MEAN_S)
    t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
    weight = means.weight / np.median(means.weight)
    center = float(np.average(means.bias_dph, weights=weight))
    spread = float(np.sqrt(np.average((means.bias_dph - center) ** 2, weights=weight)))
    spread = spread if spread > 0.0 else 1.0
    y = np.round((means.bias_dph - center) / spread * _GRID) / _GRID
    kept = np.ones(len(y), dtype=bool)
    start = like.model.log_parameters if like else None
    for round_ in range(_TRIMS + 1):
        bins = gather(t[kept], r[kept], y[kept], weight[kept])
        model = _core.EvidenceModel(bins.t, bins.r, bins.count, bins.mean, bins.within, bins.samples)
        if start is None:
            model.optimise()
        else:
            model.optimise_from(start)
        residual = np.abs(y - model.mean(t, r)) * np.sqrt(weight)
        inside = residual <= _TRIM_SIGMA * MAD_TO_SIGMA * np.median(residual[kept])
        if round_ == _TRIMS or np.array_equal(inside, kept) or inside.sum() < 0.5 * len(kept):
            break
        kept, start = inside, model.log_parameters
    seconds = float(np.median(means.duration_s))
    return Process(model, bins, t, r, y, weight, means.run, kept, center, spread, seconds)
