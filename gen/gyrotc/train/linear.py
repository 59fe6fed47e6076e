"""Methods for comparison: multiple linear regression and polynomials in T."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from .data import Scaling, TrainingData, average
from .result import Outcome, network

__all__ = ["fit_mlr", "fit_poly"]

Floats = NDArray[np.float64]
Powers = tuple[int, int]

_BASE: tuple[Powers, ...] = ((0, 0), (1, 0), (0, 1))  # powers of T and of dT/dt: a plane
# Powers up to the third order together
_FURTHER: tuple[Powers, ...] = ((2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
_HIGHEST_ORDER = 5  # polynomials of higher order swing between the data and beyond


def fit_mlr(data: TrainingData, scaling: Scaling, average_s: float) -> Outcome:
    """Constant, T and dT/dt, as in Ding et al. 2014, and further products of powers as long as BIC falls."""
    began = time.process_time()
    means = average(data, average_s)
    chosen = list(_BASE)
    best, weights = _bic(means, scaling, chosen)
    curve = [best]
    while True:
        trials = [(*_bic(means, scaling, [*chosen, p]), p) for p in _FURTHER if p not in chosen]
        if not trials:
            break
        bic, more, powers = min(trials, key=lambda trial: trial[0])
        if bic >= best:
            break
        best, weights = bic, more
        chosen.append(powers)
        curve.append(best)
    return _outcome(chosen, weights, curve, time.process_time() - began)


def fit_poly(data: TrainingData, scaling: Scaling, average_s: float) -> Outcome:
    """Polynomial in T of the order (1 ... 5) with the least BIC: what flight controllers do."""
    began = time.process_time()
    means = average(data, average_s)
    orders = [[(k, 0) for k in range(n + 1)] for n in range(1, _HIGHEST_ORDER + 1)]
    trials = [_bic(means, scaling, powers) for powers in orders]
    k = int(np.argmin([bic for bic, _ in trials]))
    return _outcome(orders[k], trials[k][1], [bic for bic, _ in trials], time.process_time() - began)


def _bic(means: TrainingData, scaling: Scaling, powers: list[Powers]) -> tuple[float, Floats]:
    """Bayesian information criterion of a weighted least-squares fit, and its weights."""
    t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
    columns = np.stack([t**a * r**b for a, b in powers], axis=1)
    root = np.sqrt(means.weight / means.weight.mean())
    weights = np.linalg.lstsq(root[:, None] * columns, root * means.bias_dph, rcond=None)[0]
    n = len(means)
    rest = float(np.sum((root * (means.bias_dph - columns @ weights)) ** 2))
    floor = np.finfo(np.float64).tiny
    return n * float(np.log(max(rest / n, floor))) + len(powers) * float(np.log(n)), weights


def _outcome(powers: list[Powers], weights: Floats, curve: list[float], seconds: float) -> Outcome:
    by_power = dict(zip(powers, (float(w) for w in weights), strict=True))
    linear = (by_power.pop((1, 0), 0.0), by_power.pop((0, 1), 0.0))
    w0 = by_power.pop((0, 0))
    return Outcome(
        networks=(network(w0, linear),),
        curves={"bic": curve, "powers": [list(p) for p in powers], "seconds": {"total": seconds}},
        polynomial=tuple((a, b, w) for (a, b), w in by_power.items()),
    )
