"""Noise of a residual: robust floor from first differences, and whether it is white."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ..common.arrays import FloatArray
from ..common.metrics import MAD_TO_SIGMA, median
from .data import TrainingData, average

__all__ = ["difference_sigma", "floor_dph", "not_white"]

_CLIP = 4.5  # robust σ, as outliers are dropped in training (process.py)
_SIGNIFICANCE = 1e-3  # of each test: docs/training.md, section 1, step 5
_LAGS = 10  # of the autocorrelation, Ljung and Box 1978
_LEAST_DIFFERENCES = 6  # with fewer a median says nothing


def robust_sigma(x: FloatArray) -> float:
    """RMS of the bulk of x: what lies within 4.5 σ of 0, σ from the median."""
    if len(x) == 0:
        return 0.0
    limit = _CLIP * MAD_TO_SIGMA * median(np.abs(x))
    inside = x[np.abs(x) <= limit]
    return float(np.sqrt(np.mean(inside**2))) if limit > 0.0 else float(np.sqrt(np.mean(x**2)))


def floor_dph(data: TrainingData, residual: FloatArray, average_s: float) -> float:
    """Noise of means over `average_s`, deg/h, from first differences of the residual within runs.

    Slow structure that the map leaves does not count; samples longer than `average_s` are taken as they are.
    """
    means = average(replace(data, bias_dph=residual), average_s)
    differences = np.diff(means.bias_dph)[np.diff(means.run) == 0]
    if len(differences) == 0:
        return robust_sigma(means.bias_dph)
    return robust_sigma(differences) / float(np.sqrt(2.0))


def difference_sigma(means: TrainingData, y: FloatArray, weight: FloatArray) -> float:
    """σ of y at weight 1 from differences of neighbouring means; 0 where too few of them, or none differ.

    First differences count a steady slope as noise, second differences count it as nothing: the smaller of the two.

    Args:
        means: Means in order of run and time, as `average` returns them.
        y: Their bias in any unit.
        weight: The noise variance of a mean is σ²/weight.
    """
    next_to = (np.diff(means.run) == 0) & (np.diff(means.time_s) < 1.5 * median(means.duration_s))
    first = np.diff(y) / np.sqrt(1.0 / weight[1:] + 1.0 / weight[:-1])
    both = next_to[1:] & next_to[:-1]
    second = np.diff(y, 2) / np.sqrt(1.0 / weight[2:] + 4.0 / weight[1:-1] + 1.0 / weight[:-2])
    found = [robust_sigma(x) for x in (first[next_to], second[both]) if len(x) >= _LEAST_DIFFERENCES]
    return min(found, default=0.0)


def not_white(residual: FloatArray, run: NDArray[np.int64], weight: FloatArray) -> str:
    """Why a residual in order of time is not white noise with zero mean in every run; empty if it may be.

    Two tests at 0.1 %: run means against the scatter (chi-square), autocorrelation over 10 lags (Ljung-Box). A
    single run passes neither: what another run would bring was never seen.
    """
    n = len(residual)
    scaled = residual * np.sqrt(weight)
    sigma = robust_sigma(scaled)
    if sigma == 0.0 or n < 4 * _LAGS:
        return "too few samples to test the residual"
    runs, index = np.unique(run, return_inverse=True)
    if len(runs) < 2:
        return "a single run does not show how runs differ"
    total = np.bincount(index, weight * residual) / np.sqrt(np.bincount(index, weight))
    if chdtrc(len(runs), float(np.sum((total / sigma) ** 2))) < _SIGNIFICANCE:
        return "run means of the residual scatter more than its noise allows"
    clipped = np.clip(scaled / sigma, -_CLIP, _CLIP)
    power = float(np.sum(clipped**2))
    statistic = 0.0
    for lag in range(1, _LAGS + 1):
        pairs = run[lag:] == run[:-lag]
        rho = float(np.sum(clipped[lag:][pairs] * clipped[:-lag][pairs])) / power
        statistic += n * (n + 2) * rho**2 / (n - lag)
    if chdtrc(_LAGS, statistic) < _SIGNIFICANCE:
        return "the residual is correlated in time"
    return ""
