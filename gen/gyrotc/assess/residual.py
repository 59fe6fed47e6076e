"""Whether what a correction leaves is noise, and whether a temperature was recorded late.

The residual of a run is what compensation leaves of it, in means over `average_s`. Its autocorrelation, and its RMS
over the noise floor, are held against their distributions for white noise of the same runs, which are drawn: the
noise floor comes from successive differences, so that slow structure raises both. Noise of a gyro that is not white
(bias instability, rate random walk) is more than noise here, too: `gyrotc diagnose` tells it from a cause.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence

import numpy as np

from ..common.arrays import FloatArray
from ..common.metrics import Averages
from ..quality.findings import finding
from ..quality.thermometers import late_findings
from ..recordings.records import Run
from ..results.evaluation import PARTS, RMS_OVER_FLOOR, Evaluation, ResidualTest
from ..results.findings import Finding
from ..train.noise import robust_sigma

_LAGS = 10  # means: of 100 s a third of the shortest ramp of a chamber's cycle
_SIGMAS = 4.0  # of each figure's distribution: one clean residual in ten thousand
_DRAWS = 400  # which tell a standard deviation to 4 %
_MOST = 2**23  # numbers drawn in all: half a second
_LEAST = 20  # means: fewer have no autocorrelation to speak of
_SEED = 1  # any; the same recordings have the same limits


def residual_test(
    judged: Sequence[FloatArray],
    rms_dph: float | None,
    floor_dph: float | None,
    floor_lengths: Sequence[int] | None = None,
) -> ResidualTest | None:
    """Holds what remains of the judged runs against white noise; None without an RMS or a noise floor.

    Args:
        judged: Means of what remains of these runs, deg/h, each of shape (n,).
        rms_dph: The RMS that they are judged by, deg/h.
        floor_dph: The noise floor, deg/h.
        floor_lengths: Number of means of each run that the floor was estimated from; none: it is known; None: it was
            estimated from the judged runs themselves.
    """
    lengths = tuple(x.size for x in judged if x.size)
    if not lengths or rms_dph is None or not floor_dph:
        return None
    limit, low, high = _limits(lengths, None if floor_lengths is None else tuple(n for n in floor_lengths if n > 1))
    return ResidualTest(
        autocorrelation=_correlation(judged),
        autocorrelation_limit=limit,
        lags=_LAGS,
        rms_over_floor=rms_dph / floor_dph,
        rms_over_floor_band=(low, min(high, RMS_OVER_FLOOR)),
    )


@functools.lru_cache(maxsize=64)
def _limits(lengths: tuple[int, ...], of_floor: tuple[int, ...] | None) -> tuple[float | None, float, float]:
    """What white noise of runs of these lengths gives: most autocorrelation; least and most RMS over the floor."""
    rng = np.random.default_rng(_SEED)
    draws = max(_DRAWS // 8, min(_DRAWS, _MOST // sum(lengths)))
    correlations, ratios = [], np.empty(draws)
    for k in range(draws):
        series = [rng.normal(size=n) for n in lengths]
        others = series if of_floor is None else [rng.normal(size=n) for n in of_floor]
        differences = np.concatenate([np.zeros(0), *(np.diff(x) for x in others)])
        floor = robust_sigma(differences) / float(np.sqrt(2.0)) if differences.size else 1.0
        ratios[k] = np.sqrt(np.mean(np.concatenate(series) ** 2)) / floor
        correlations.append(_correlation(series))
    logs = np.log(ratios)  # nearer to normal than ratios of few means
    low, high = np.exp(logs.mean() + _SIGMAS * logs.std() * np.array([-1.0, 1.0]))
    known = np.array([c for c in correlations if c is not None])
    limit = float(known.mean() + _SIGMAS * known.std()) if known.size else None
    return limit, float(low), float(high)


def _correlation(judged: Sequence[FloatArray]) -> float | None:
    """Mean autocorrelation at the first lags, about the mean of all runs, which do not touch; None: too short."""
    series = [x for x in judged if x.size > _LAGS]
    total = sum(x.size for x in series)
    if total < _LEAST:
        return None
    mean = np.concatenate(series).mean()
    left = [x - mean for x in series]
    power = sum(float(x @ x) for x in left)
    if power <= 0.0:
        return 0.0
    found = 0.0
    for lag in range(1, _LAGS + 1):
        products = sum(float(x[:-lag] @ x[lag:]) for x in left)
        found += products / sum(x.size - lag for x in left) / (power / total)
    return found / _LAGS


def residual_findings(result: Evaluation, runs: Sequence[tuple[Run, Averages]]) -> Iterator[Finding]:
    """Findings about the residual of the runs that were evaluated."""
    yield from _beyond_noise(result)
    yield from late_findings(runs)


def _beyond_noise(result: Evaluation) -> Iterator[Finding]:
    """The RMS that the model is judged by, where noise alone would not give it."""
    judged, test = result.judged(), result.residual
    if judged is None or test is None or result.noise_floor_dph is None:
        return
    low, high = test.rms_over_floor_band
    if low <= test.rms_over_floor <= high:
        return
    more = test.rms_over_floor > high
    rms = test.rms_over_floor * result.noise_floor_dph
    yield finding(
        "residual_above_noise" if more else "residual_below_noise",
        f"RMS {rms:.4g} deg/h on {PARTS[judged[0]]} is {test.rms_over_floor:.3g} times the noise floor, where noise "
        f"alone gives {low:.3g} to {high:.3g}: "
        + (
            "structure is left, or rates, temperatures and times do not belong together. See gyrotc check and "
            "gyrotc diagnose."
            if more
            else "rows were smoothed, or are not independent of those that were trained on."
        ),
        part=judged[0],
        rms_dph=rms,
        noise_floor_dph=result.noise_floor_dph,
        ratio=test.rms_over_floor,
        limits=[low, high],
    )
