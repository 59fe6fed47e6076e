"""Multiple linear regression of the paper, and polynomials for comparison."""

from __future__ import annotations

import time

import numpy as np

from ..common.arrays import FloatArray
from .data import Scaling, TrainingData, average
from .result import Outcome, network

__all__ = ["fit_mlr", "fit_poly", "fit_poly_slope"]

Powers = tuple[int, int]

_PLANE: tuple[Powers, ...] = ((0, 0), (1, 0), (0, 1))  # powers of T and of dT/dt
# Powers up to the third order together
_FURTHER: tuple[Powers, ...] = ((2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
_HIGHEST_ORDER = 5  # polynomials of higher order swing between the data and beyond


def fit_mlr(data: TrainingData, scaling: Scaling, average_s: float) -> Outcome:
    """Stepwise regression of Ding et al. 2014, section 4.2: constant, T and dT/dt, less what BIC eliminates.

    The variable without which the criterion is least is dropped as long as the criterion falls. The paper names no
    further candidates; the constant stays, because dropping it would depend on where the scale of T begins.
    """
    began = time.process_time()
    means = average(data, average_s)
    chosen = list(_PLANE)
    best, weights = _bic(means, scaling, chosen)
    curve = [best]
    while len(chosen) > 1:
        trials = [(*_bic(means, scaling, [q for q in chosen if q != p]), p) for p in chosen[1:]]
        bic, fewer, dropped = min(trials, key=lambda trial: trial[0])
        if bic >= best:
            break
        best, weights = bic, fewer
        chosen.remove(dropped)
        curve.append(best)
    return _outcome(chosen, weights, curve, time.process_time() - began)


def fit_poly_slope(data: TrainingData, scaling: Scaling, average_s: float) -> Outcome:
    """Polynomial in T and dT/dt: a plane, and further products of powers up to the third order while BIC falls."""
    began = time.process_time()
    means = average(data, average_s)
    chosen = list(_PLANE)
    best, weights = _bic(means, scaling, chosen)
    curve = [best]
    while len(chosen) < len(_PLANE) + len(_FURTHER):
        trials = [(*_bic(means, scaling, [*chosen, p]), p) for p in _FURTHER if p not in chosen]
        bic, more, added = min(trials, key=lambda trial: trial[0])
        if bic >= best:
            break
        best, weights = bic, more
        chosen.append(added)
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


def _bic(means: TrainingData, scaling: Scaling, powers: list[Powers]) -> tuple[float, FloatArray]:
    """Bayesian information criterion of a weighted least-squares fit, and its weights."""
    t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
    columns = np.stack([t**a * r**b for a, b in powers], axis=1)
    root = np.sqrt(means.weight / means.weight.mean())
    weights = np.linalg.lstsq(root[:, None] * columns, root * means.bias_dph, rcond=None)[0]
    n = len(means)
    rest = float(np.sum((root * (means.bias_dph - columns @ weights)) ** 2))
    floor = np.finfo(np.float64).tiny
    return n * float(np.log(max(rest / n, floor))) + len(powers) * float(np.log(n)), weights


def _outcome(powers: list[Powers], weights: FloatArray, curve: list[float], seconds: float) -> Outcome:
    by_power = dict(zip(powers, (float(w) for w in weights), strict=True))
    linear = (by_power.pop((1, 0), 0.0), by_power.pop((0, 1), 0.0))
    w0 = by_power.pop((0, 0))
    return Outcome(
        networks=(network(w0, linear),),
        curves={"bic": curve, "powers": [list(p) for p in powers], "seconds": {"total": seconds}},
        polynomial=tuple((a, b, w) for (a, b), w in by_power.items()),
    )
