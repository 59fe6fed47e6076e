"""What a test could see at most, and what a check run sees of an earlier model: parts of `bench.lot_prior`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gyrotc.lot.earlier import held, posterior_of_means, stated_sigma_dph, widened
from gyrotc.lot.learn import FALSE_ALARM, sums_of
from gyrotc.lot.use import LotPrior
from gyrotc.train.data import TrainingData, cleaned, scaling_of
from gyrotc.train.evidence import fit_process
from gyrotc.train.means import UnitMeans, unit_means
from gyrotc.train.methods import fit
from gyrotc.train.uncertainty import uncertainty
from numpy.typing import NDArray
from scipy.stats import norm

__all__ = ["best_power", "recalibrated", "seen"]

Floats = NDArray[np.float64]

_EARLIER = 5  # runs of the earlier calibration; the check run is of the last
_SIZE = 1.0  # of planted changes, over the noise of a mean of 50 s: the least that one run should see


def seen(data: TrainingData) -> UnitMeans:
    """Means of samples, as a fit has them."""
    samples = cleaned(data)
    scaling = scaling_of(samples)
    return unit_means(samples, scaling, fit_process(samples, scaling))[0]


def best_power(prior: LotPrior, short: UnitMeans, whole: UnitMeans) -> float:
    """Probability that a test which knows a stranger's map refuses it from its short run (Neyman and Pearson).

    Args:
        prior: The lot.
        short: Means of the short run.
        whole: Means of all runs, which tell the map.
    """
    known = prior.with_runs(whole)
    precision = sums_of([short], prior.basis, prior.center_dph, prior.unit_dph).precision[0]
    powers = []
    for mean, covariance in zip(prior.means, prior.covariances, strict=True):
        away = known.mean - mean
        told = precision - precision @ np.linalg.inv(np.linalg.inv(covariance) + precision) @ precision
        distance = float(np.sqrt(max(away @ told @ away, 0.0)))
        powers.append(float(norm.sf(norm.isf(FALSE_ALARM) - distance)))
    return min(powers)


def recalibrated(units: Sequence[tuple[TrainingData, TrainingData]]) -> dict[str, Any]:
    """p-values of check runs of units that have not changed, and which planted changes were named.

    Args:
        units: All runs of each, and a short run that is part of the last.
    """
    found: dict[str, Any] = {"unchanged": [], "named": {}}
    for whole, short in units:
        early = cleaned(whole.select(whole.run < _EARLIER))
        scaling = scaling_of(early)
        means = unit_means(early, scaling, fit_process(early, scaling))[0]
        fitted = fit(early, method="auto")
        table = uncertainty(early, fitted)
        envelope, between = (scaling.temperature_c, scaling.slope_c_per_min), table["rules"]["between_dph"]
        stated = stated_sigma_dph(np.array(table["rows"]), envelope, between, means)
        known = posterior_of_means(means, envelope, between, stated)
        prior = widened(known, 0.0, "none", "", None).alone()
        run = seen(short)
        found["unchanged"].append(held(prior, run).p_value)
        for kind, change in _changes(run).items():
            moved = UnitMeans(
                run.temperature_c, run.slope_c_per_min, run.bias_dph + change, run.count, run.sigma_dph
            )
            told = held(prior, moved).change
            right = told is not None and told.kind == kind
            if right and kind == "local":
                right = told.temperature_c[0] - 10.0 <= 20.0 <= told.temperature_c[1] + 10.0
            row = found["named"].setdefault(kind, {"seen": [], "right": []})
            row["seen"].append(told is not None)
            row["right"].append(right)
    return found


def _changes(run: UnitMeans) -> dict[str, Floats]:
    t, size = run.temperature_c, _SIZE * run.sigma_dph
    return {
        "offset": np.full(len(t), size),
        "slope": 2.0 * size * (t - 20.0) / 100.0,
        "local": 3.0 * size * np.exp(-0.5 * ((t - 20.0) / 6.0) ** 2),
    }
