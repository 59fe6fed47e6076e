"""95 % intervals: of a profile likelihood, of the size of random draws; the top of a parabola through three points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from ..common.arrays import FloatArray
from ..common.quantiles import CHI2_95_ONE

__all__ = ["Interval", "parabola_top", "profile_interval", "random_size"]


@dataclass(frozen=True, slots=True)
class Interval:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


def parabola_top(
    energy: Callable[[float], float], here: float, width: float, low: float
) -> tuple[float, float]:
    """One step to the top of a parabola through three points, and its curvature."""
    left, right = max(here - width, 0.5 * (here + low) if np.isfinite(low) else here - width), here + width
    x = np.array([left, here, right]) - here
    c2, c1, _ = np.polyfit(x, [energy(left), energy(here), energy(right)], 2)
    if c2 >= 0.0:
        values = {v: energy(v) for v in (left, here, right)}
        return max(values, key=lambda v: values[v]), 0.0
    move = float(np.clip(-c1 / (2.0 * c2), x[0], x[2]))
    energy(here + move)
    return here + move, float(-c2)


def profile_interval(profile: FloatArray) -> tuple[float, float]:
    """The least interval with every value whose likelihood is not below the 95 % quantile of one parameter.

    A profile may have several tops, as that of a wave's period has; what lies between two of them belongs to it.

    Args:
        profile: Parameter values, ascending, and twice the log-likelihoods, shape (2, n); linear between. Its ends are
            those of the interval where it has not fallen.
    """
    x, e = profile
    drop = float(e.max()) - CHI2_95_ONE
    inside = np.flatnonzero(e >= drop)
    first, last = int(inside[0]), int(inside[-1])
    low, high = float(x[first]), float(x[last])
    if first > 0:
        low = float(np.interp(drop, e[first - 1 : first + 1], x[first - 1 : first + 1]))
    if last < x.size - 1:
        high = float(np.interp(drop, e[[last + 1, last]], x[[last + 1, last]]))
    return low, high


def random_size(weights: FloatArray, spread: FloatArray) -> Interval:
    """Standard deviation of normal offsets from their estimates: chi-square limits, noise taken off."""
    n = weights.size
    centred = weights - weights.mean()
    middle = np.eye(n) - 1.0 / n
    noise = float(np.trace(np.asarray(middle @ spread @ middle))) / max(n - 1, 1)
    raw = float(centred @ centred)
    value = float(np.sqrt(max(raw / max(n - 1, 1) - noise, 0.0)))
    low = float(np.sqrt(max(raw / chdtri(max(n - 1, 1), 0.025) - noise, 0.0)))
    high = float(np.sqrt(max(raw / chdtri(max(n - 1, 1), 0.975) - noise, 0.0)))
    return Interval(value, low, high)
