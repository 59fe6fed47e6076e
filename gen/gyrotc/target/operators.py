"""Operators with memory that the terms share: first-order lag, play, delay. Vectorised over a record."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray

__all__ = ["delayed", "first_order", "play"]

Number = TypeVar("Number", bound=np.generic)

_UNIFORM = 1e-6  # largest departure of a row period from their mean that still counts as even, relative


def first_order(tau_s: float, time_s: FloatArray, driven: FloatArray) -> FloatArray:
    """tau dz/dt = driven − z, exact for an input linear between the samples; starts at rest on the first one.

    Args:
        tau_s: Time constant, s; 0 gives the input itself.
        time_s: Ascending times, s, shape (n,).
        driven: Input, shape (n,).

    Returns:
        z, shape (n,).
    """
    if tau_s == 0.0 or len(driven) < 2:
        return np.array(driven)
    x = np.diff(time_s) / tau_s
    lost = -np.expm1(-x)
    late = 1.0 - lost / x  # weight of an interval's end point
    forced = late * driven[1:] + (lost - late) * driven[:-1]
    if np.ptp(x) <= _UNIFORM * float(x.mean()):
        return _even_lag(1.0 - float(lost.mean()), np.concatenate((driven[:1], forced)))
    return _affine_scan(np.concatenate(([0.0], 1.0 - lost)), np.concatenate((driven[:1], forced)))


def _even_lag(decay: float, offset: FloatArray) -> FloatArray:
    """z_k = decay z_(k−1) + offset_k, as a triangular band of equations: `scipy.signal` takes 0.7 s to import."""
    from scipy.linalg.lapack import dtbtrs  # which commands that filter nothing need not spend time on

    band = np.empty((2, len(offset)))
    band[0], band[1] = 1.0, -decay
    return np.asarray(dtbtrs(band, offset[:, None], uplo="L", diag="U")[0][:, 0])


def _affine_scan(factor: FloatArray, offset: FloatArray) -> FloatArray:
    """z_k = factor_k z_(k−1) + offset_k for all k: affine maps composed over distances 1, 2, 4, ..."""
    step = 1
    while step < len(factor):
        offset = np.concatenate((offset[:step], offset[step:] + factor[step:] * offset[:-step]))
        factor = np.concatenate((factor[:step], factor[step:] * factor[:-step]))
        step *= 2
    return offset


def play(width: Any, temperature: NDArray[Number]) -> NDArray[Number]:
    """Play (backlash) operator z ← max(T − w, min(T + w, z)), from z = T on, shape (n,), in the type of T.

    A step clamps z to T ± w. Clamps composed are a clamp again, so they are composed over 1, 2, 4, ... steps:
    nothing is rounded but T ± w.
    """
    low, high = temperature - width, temperature + width
    step = 1
    while step < len(low):
        after_low, after_high = low[step:], high[step:]
        low = np.concatenate((low[:step], np.clip(low[:-step], after_low, after_high)))
        high = np.concatenate((high[:step], np.clip(high[:-step], after_low, after_high)))
        step *= 2
    return np.asarray(np.clip(temperature[0], low, high))


def delayed(shift_s: float, time_s: FloatArray, values: FloatArray) -> FloatArray:
    """values(t − shift), linear between samples; beyond the record its first and last value."""
    return np.interp(time_s - shift_s, time_s, values)
