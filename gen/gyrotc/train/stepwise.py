"""Train the stepwise linear regression of Ding et al. 2014, section 4.2."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from ..common.arrays import FloatArray
from .data import Scaling, TrainingData, average_samples
from .networks import network
from .result import Outcome

_Powers = tuple[int, int]

_CONSTANT: _Powers = (0, 0)
# Powers of the normalised T and dT/dt: the variables that the paper names, after the constant.
_CANDIDATES: tuple[_Powers, ...] = (_CONSTANT, (1, 0), (0, 1))


def fit_mlr(data: TrainingData, scaling: Scaling, average_s: float) -> Outcome:
    """Regress the bias on T and dT/dt, and drop variables while BIC falls.

    The variable without which BIC is least is dropped first. The constant stays: to drop it would depend on where the
    scale of T begins.
    """
    started = time.process_time()
    means = average_samples(data, average_s)
    powers = list(_CANDIDATES)
    bic, weights = _regression(means, scaling, powers)
    path = [bic]
    while len(powers) > 1:
        trials = [(*_regression(means, scaling, [q for q in powers if q != p]), p) for p in powers[1:]]
        smallest, remaining, dropped = min(trials, key=lambda trial: trial[0])
        if smallest >= bic:
            break
        bic, weights = smallest, remaining
        powers.remove(dropped)
        path.append(bic)
    by_power = dict(zip(powers, weights.tolist(), strict=True))
    linear = (by_power.get((1, 0), 0.0), by_power.get((0, 1), 0.0))
    seconds = time.process_time() - started
    return Outcome(
        networks=(network(by_power[_CONSTANT], linear),),
        curves={"bic": path, "powers": [list(p) for p in powers], "seconds": {"total": seconds}},
    )


def _regression(means: TrainingData, scaling: Scaling, powers: Sequence[_Powers]) -> tuple[float, FloatArray]:
    """Return BIC and weights of a weighted least-squares fit."""
    t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
    columns = np.stack([t**a * r**b for a, b in powers], axis=1)
    sqrt_weight = np.sqrt(means.weight / means.weight.mean())
    weights = np.linalg.lstsq(sqrt_weight[:, None] * columns, sqrt_weight * means.bias_dph, rcond=None)[0]
    n = len(means)
    sum_of_squares = float(np.sum((sqrt_weight * (means.bias_dph - columns @ weights)) ** 2))
    smallest = np.finfo(np.float64).tiny
    return n * float(np.log(max(sum_of_squares / n, smallest))) + len(powers) * float(np.log(n)), weights
