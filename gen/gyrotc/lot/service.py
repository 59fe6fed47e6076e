"""How the biases of a type differ, by maximum likelihood from the power-ons of a unit: docs/numerics.md, section 9."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from ..common.arrays import FloatArray
from ..model import BiasSpread, Learning
from ..tables.learning import service_prior
from ..target.learning import Learner, Stop

_LOG_SPREAD = 0.5  # standard deviation of a logarithm about its start: an order of magnitude is 4.6 of them
_STEPS = 40  # of the search: it ends before


@dataclass(frozen=True)
class PowerOn:
    """Stops after one switching on: time since then in s, shape (n,), temperature in C, mean rates (n, axes) in deg/h,
    the table's bias taken off."""

    time_s: FloatArray
    temp_c: FloatArray
    rate_dph: FloatArray


def _innovations(
    spread: BiasSpread, past: Sequence[PowerOn], envelope_c: tuple[float, float], center_c: float, var: float
) -> tuple[FloatArray, FloatArray]:
    """Innovations of all stops, (n, axes), and their variances for a scale of 1, by the filter in float64."""
    known = Learning(spread=spread, reference_c=center_c, authority_dph=1.0, noise_deg_per_sqrt_h=1.0)
    prior = replace(
        service_prior(known, envelope_c),
        noise_var=var,
        authority_dph=np.inf,
        span_c=np.inf,
        gate_square=np.inf,
    )
    learner = Learner(prior, past[0].rate_dph.shape[1], np.float64)
    found, variances = [], []
    for run in past:
        learner.power_on(np.nan, run.temp_c[0])
        for time_s, temp_c, rate in zip(run.time_s, run.temp_c, run.rate_dph, strict=True):
            learner.rest(Stop(time_s, temp_c, rate, 1.0))
            found.append(learner.innovation)
            variances.append(learner.innovation_var[0])
    return np.array(found), np.array(variances)


def fitted_spread(
    start: BiasSpread,
    past: Sequence[PowerOn],
    envelope_c: tuple[float, float],
    center_c: float,
    noise_dph: float,
) -> tuple[BiasSpread, FloatArray]:
    """Maximum likelihood of the innovations of past power-ons, all axes together, about `start`.

    Ageing stays as it was: power-ons of one day do not show it.

    Args:
        start: A guess within an order of magnitude.
        past: Power-ons, two at least.
        envelope_c: Where the knots lie, C.
        center_c: Where the table was made level, C.
        noise_dph: Of the mean of a stop, deg/h.

    Returns:
        The spread for a scale of 1, and each axis' scale, shape (axes,).
    """
    names = [n for n, f in BiasSpread.model_fields.items() if f.is_required() and getattr(start, n) > 0.0]
    begin = np.log([getattr(start, name) for name in names])

    def spread_at(x: FloatArray) -> BiasSpread:
        return start.model_copy(update={name: float(np.exp(v)) for name, v in zip(names, x, strict=True)})

    def scales(spread: BiasSpread) -> tuple[FloatArray, FloatArray]:
        nu, s = _innovations(spread, past, envelope_c, center_c, noise_dph**2)
        return np.mean(nu**2 / s[:, None], axis=0), s

    def cost(x: FloatArray) -> float:
        square, s = scales(spread_at(x))
        data = 0.5 * len(square) * np.log(s).sum() + 0.5 * len(s) * np.log(square).sum()
        return float(data + 0.5 * np.sum(((x - begin) / _LOG_SPREAD) ** 2))

    best = minimize(cost, begin, method="L-BFGS-B", options={"maxiter": _STEPS})
    spread = spread_at(best.x)
    return spread, np.sqrt(scales(spread)[0])
