"""What a gyro may learn in service: the prior of `gtc_learn_prior_t` (docs/numerics.md, section 9).

From a data sheet, or by maximum likelihood from the power-ons of a unit of the type.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING, dataclass, fields, replace

import numpy as np
from scipy.optimize import minimize

from ..common.arrays import FloatArray
from ..target.learning import KNOTS, ServicePrior, packed

__all__ = ["BiasSpread", "PowerOn", "fitted_spread", "prior_of"]

_LOG_SPREAD = 0.5  # standard deviation of a logarithm about its start: an order of magnitude is 4.6 of them
_STEPS = 40  # of the search: it ends before


@dataclass(frozen=True)
class BiasSpread:
    """How the biases of a type differ: standard deviations in deg/h unless stated, lengths in C, times in s.

    Attributes:
        level: Of the map as a whole, from unit to unit.
        slope: Of its slope, deg/h/C.
        shape: Of the map's random walk along T, deg/h/√C.
        turn_on: Of the constant drawn at each power-on.
        turn_on_slope: Of the slope drawn then, deg/h/C.
        warm_up: Of what decays after power-on with `warm_up_s`.
        memory: Of the process along T with length `memory_c`, forgotten in `memory_s`.
        ageing: Of the level in an hour, deg/h/√h.
        ageing_shape: Of the map's random walk along T in an hour, deg/h/√(h C).
    """

    level: float
    slope: float
    shape: float
    turn_on: float
    turn_on_slope: float
    warm_up: float
    warm_up_s: float
    memory: float
    memory_s: float
    memory_c: float
    ageing: float = 0.0
    ageing_shape: float = 0.0

    def scaled(self, factor: float) -> BiasSpread:
        """The same type with all deviations this many times as large."""
        same = {"warm_up_s", "memory_s", "memory_c"}
        return replace(
            self, **{f.name: getattr(self, f.name) * factor for f in fields(self) if f.name not in same}
        )


@dataclass(frozen=True)
class PowerOn:
    """Stops after one switching on: time since then in s, shape (n,), temperature in C, mean rates (n, axes) in deg/h,
    the table's bias taken off."""

    time_s: FloatArray
    temp_c: FloatArray
    rate_dph: FloatArray


def _walk(knots: FloatArray) -> FloatArray:
    """Covariance of a random walk from 0 to either side."""
    same_side = np.outer(knots, knots) > 0
    return np.where(same_side, np.minimum.outer(np.abs(knots), np.abs(knots)), 0.0)


def prior_of(
    spread: BiasSpread,
    envelope_c: tuple[float, float],
    center_c: float,
    noise_dph: float,
    authority_dph: float,
    *,
    id: int = 0,
    settle_s: float = 0.0,
    span_c: float = 1.5,
    gate: float = 4.0,
    open_gate: float | None = None,
    agreeing: int = 3,
    power_ons: int = 3,
) -> ServicePrior:
    """The prior of a table.

    Args:
        spread: How units of the type differ.
        envelope_c: Where the knots lie, C.
        center_c: Where the table was made level, C.
        noise_dph: Of a mean over one second, deg/h: 60 times the angle random walk in deg/√h.
        authority_dph: Largest |shift|, deg/h.
        id: Of the table.
        settle_s: Rests before this time since power-on are refused.
        span_c: Temperature may change by this in a rest.
        gate: Standard deviations up to which an innovation is accepted.
        open_gate: Up to which one opens the short memory instead; None: none does.
        agreeing: Refused rests that agree and are accepted.
        power_ons: From so many power-ons.
    """
    low, high = envelope_c
    knots = np.linspace(low, high, KNOTS) - center_c
    level = spread.level**2 + spread.slope**2 * np.outer(knots, knots) + spread.shape**2 * _walk(knots)
    return ServicePrior(
        id=id, low_c=low, per_knot=(KNOTS - 1) / (high - low), center_c=center_c, authority_dph=authority_dph,
        offset_var=spread.turn_on**2, slope_var=spread.turn_on_slope**2, warm_var=spread.warm_up**2,
        memory_var=spread.memory**2, memory_per_c=float(np.sqrt(3.0)) / spread.memory_c,
        forget_per_s=1.0 / spread.memory_s, warm_per_s=1.0 / spread.warm_up_s, off_h=24.0, noise_var=noise_dph**2,
        noisy=9.0, span_c=span_c, settle_s=settle_s, gate=gate, open_gate=gate if open_gate is None else open_gate,
        agreeing=agreeing, power_ons=power_ons, map_var=packed(level),
        ageing_var=packed(spread.ageing**2 + spread.ageing_shape**2 * _walk(knots)),
    )  # fmt: skip


def _innovations(
    spread: BiasSpread, past: Sequence[PowerOn], envelope_c: tuple[float, float], center_c: float, var: float
) -> tuple[FloatArray, FloatArray]:
    """Innovations of all stops, (n, axes), and their variances for a scale of 1, by the filter in float64."""
    low, high = envelope_c
    knots = np.linspace(low, high, KNOTS) - center_c
    n, axes = KNOTS + 5, past[0].rate_dph.shape[1]
    p, x = np.zeros((n, n)), np.zeros((n, axes))
    p[:KNOTS, :KNOTS] = (
        spread.level**2 + spread.slope**2 * np.outer(knots, knots) + spread.shape**2 * _walk(knots)
    )
    per_c = np.sqrt(3.0) / spread.memory_c
    drawn = np.array(
        [spread.turn_on, spread.turn_on_slope, spread.warm_up, spread.memory, per_c * spread.memory]
    )
    steady = np.diag(drawn[3:] ** 2)
    found, variances = [], []
    for run in past:
        x[KNOTS:], p[KNOTS:], p[:, KNOTS:] = 0.0, 0.0, 0.0
        p[range(KNOTS, n), range(KNOTS, n)] = drawn**2
        before_s, before_c = 0.0, run.temp_c[0]
        for time_s, temp_c, rate in zip(run.time_s, run.temp_c, run.rate_dph, strict=True):
            dt, d_temp = time_s - before_s, temp_c - before_c
            before_s, before_c = time_s, temp_c
            way = per_c * abs(d_temp)
            block = np.exp(-dt / spread.memory_s - way) * np.array(
                [[1 + way, d_temp], [-(per_c**2) * d_temp, 1 - way]]
            )
            f = np.eye(3)
            f[0, 0], f[1:, 1:] = np.exp(-dt / spread.warm_up_s), block
            x[-3:], p[-3:] = f @ x[-3:], f @ p[-3:]
            p[:, -3:] = p[:, -3:] @ f.T
            p[-2:, -2:] += steady - block @ steady @ block.T
            u = np.clip((temp_c - low) / (high - low) * (KNOTS - 1), 0.0, KNOTS - 1)
            k = min(int(u), KNOTS - 2)
            h = np.zeros(n)
            h[k], h[k + 1], h[KNOTS:-1] = 1 - (u - k), u - k, (1.0, temp_c - center_c, 1.0, 1.0)
            ph = p @ h
            s = float(h @ ph) + var
            nu = rate - h @ x
            x += np.outer(ph / s, nu)
            p -= np.outer(ph, ph) / s
            found.append(nu)
            variances.append(s)
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
    names = [f.name for f in fields(BiasSpread) if getattr(start, f.name) > 0.0 and f.default is MISSING]
    begin = np.log([getattr(start, name) for name in names])

    def spread_at(x: FloatArray) -> BiasSpread:
        return replace(start, **{name: float(np.exp(v)) for name, v in zip(names, x, strict=True)})

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
