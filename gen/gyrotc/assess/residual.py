"""Whether what a correction leaves is noise: its autocorrelation, and its RMS over the noise floor, beside white noise.

Both are held against their distributions for white noise of the same runs, which are drawn: the noise floor comes from
successive differences, so that slow structure raises the RMS over it and the correlation of neighbours. Noise of a
gyro that is not white (bias instability, rate random walk) is more than noise here, too: `gyrotc diagnose` tells it
from a cause.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from ..common.arrays import FloatArray
from ..results.evaluation import ResidualTest
from ..train.noise import robust_sigma

__all__ = ["residual_test"]

_LAGS = 10  # means: of 100 s a third of the shortest ramp of a chamber's cycle
_SIGMAS = 3.0  # of each figure's distribution: one clean residual in 700
_DRAWS = 400  # which tell a standard deviation to 4 %
_MOST = 2**23  # numbers drawn in all: half a second
_LEAST = 20  # means: fewer have no autocorrelation to speak of
_SEED = 1  # any; the same recordings have the same limits


def residual_test(
    judged: Sequence[FloatArray],
    rms_dph: float | None,
    floor_dph: float | None,
    floor_lengths: Sequence[int] | None,
) -> ResidualTest | None:
    """Holds what remains of the judged runs against white noise; None where they are too short.

    Args:
        judged: Means of what remains of these runs, deg/h, each of shape (n,).
        rms_dph: The RMS that they are judged by, deg/h.
        floor_dph: The noise floor, deg/h.
        floor_lengths: Number of means of each run that the floor was estimated from; None: it is known.
    """
    series = [x for x in judged if x.size > _LAGS]
    lengths = tuple(x.size for x in series)
    if sum(lengths) < _LEAST or rms_dph is None or not floor_dph:
        return None
    of_floor = None if floor_lengths is None else tuple(n for n in floor_lengths if n > 1)
    limits = _limits(lengths, of_floor)
    return ResidualTest(
        autocorrelation=_correlation(series),
        autocorrelation_limit=limits[0],
        lags=_LAGS,
        rms_over_floor=rms_dph / floor_dph,
        rms_over_floor_limit=limits[1],
    )


@functools.lru_cache(maxsize=64)
def _limits(lengths: tuple[int, ...], of_floor: tuple[int, ...] | None) -> tuple[float, float]:
    """Most that white noise of runs of these lengths gives: autocorrelation, RMS over an estimated floor."""
    rng = np.random.default_rng(_SEED)
    draws = max(_DRAWS // 8, min(_DRAWS, _MOST // sum(lengths)))
    found = np.empty((draws, 2))
    for k in range(draws):
        series = [rng.normal(size=n) for n in lengths]
        floor = 1.0
        if of_floor is not None:
            others = series if of_floor == lengths else [rng.normal(size=n) for n in of_floor]
            floor = robust_sigma(np.concatenate([np.diff(x) for x in others])) / float(np.sqrt(2.0))
        rms = float(np.sqrt(np.mean(np.concatenate(series) ** 2)))
        found[k] = _correlation(series), rms / floor
    correlation, ratio = found.mean(axis=0) + _SIGMAS * found.std(axis=0)
    return float(correlation), float(ratio)


def _correlation(series: Sequence[FloatArray]) -> float:
    """Mean autocorrelation at the first lags, about the mean of all runs; runs do not touch."""
    mean = np.concatenate(series).mean()
    left = [x - mean for x in series]
    power = sum(float(x @ x) for x in left)
    total = sum(x.size for x in left)
    if power <= 0.0:
        return 0.0
    found = 0.0
    for lag in range(1, _LAGS + 1):
        products = sum(float(x[:-lag] @ x[lag:]) for x in left)
        found += products / sum(x.size - lag for x in left) / (power / total)
    return found / _LAGS
