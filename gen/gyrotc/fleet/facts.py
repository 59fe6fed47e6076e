"""What a gyro of a lot is compared by: its bias over temperature, and plain facts about each of its runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..common.arrays import FloatArray
from ..common.metrics import MAD_TO_SIGMA, Averages, median
from ..results.fleet import ComparedRun, Facts, LikelyStep, ResidualSeries

__all__ = ["BINS", "BIN_C", "FIRST_C", "NOISY_RUN", "facts_of", "step_in"]


FIRST_C, BIN_C, BINS = -90.0, 5.0, 58  # as wide as temperatures are plausible, up to 200 C
NOISY_RUN = 3.0  # times the noise of the other runs of the gyro: that run is what is to be looked at
_LEAST_IN_BIN = 3  # means, for a mean of them
_LEAST_MEANS = 16  # a shorter run does not show a step
_EDGE = 0.1  # of a run, on either side of which a step is not sought
_POINTS = 160  # of the residual that a picture shows


def facts_of(runs: Sequence[tuple[str, Averages]]) -> Facts:
    """Facts of a gyro from the means of its runs, each with its file."""
    told = [(file, a) for file, a in runs if a.time_s.size]
    steps = [step_in(a.after_dph) for _, a in told]
    compared = [_compared(file, a, step) for (file, a), step in zip(told, steps, strict=True)]
    return Facts(
        curve=_curve([a for _, a in told]),
        runs=tuple(compared),
        series=_series(*told[_shown(compared)]) if told else None,
    )


def _shown(runs: Sequence[ComparedRun]) -> int:
    """The run that is drawn if the gyro stands apart: one much noisier than its others, else the likeliest step."""
    noise = np.array([run.noise_dph for run in runs])
    if noise.max() > NOISY_RUN * median(noise):
        return int(np.argmax(noise))
    return int(np.argmax([run.step.score for run in runs]))


def _compared(file: str, a: Averages, step: tuple[int, float, float]) -> ComparedRun:
    index, size, score = step
    return ComparedRun(
        file=file,
        mean_c=float(a.temperature_c.mean()),
        noise_dph=_noise(a.after_dph),
        step=LikelyStep(time_s=_edge_s(a, index), size_dph=size, score=score),
    )


def _series(file: str, a: Averages) -> ResidualSeries:
    every = max(1, a.after_dph.size // _POINTS)
    return ResidualSeries(
        file=file,
        time_s=tuple(float(t) for t in a.time_s[::every]),
        rate_dph=tuple(float(r) for r in a.after_dph[::every]),
    )


def _edge_s(a: Averages, index: int) -> float:
    """Time between the means before and after a step, from the start of the run, s."""
    start = a.time_s[0]
    return float(0.5 * (a.time_s[index - 1] + a.time_s[index]) - start) if index else 0.0


def _curve(runs: Sequence[Averages]) -> tuple[float | None, ...]:
    """Mean bias (deg/h) over cells of `BIN_C` from `FIRST_C` on."""
    t = np.concatenate([a.temperature_c for a in runs]) if runs else np.zeros(0)
    rate = np.concatenate([a.before_dph for a in runs]) if runs else np.zeros(0)
    number = np.clip(((t - FIRST_C) / BIN_C).astype(np.int64), 0, BINS - 1)
    count = np.bincount(number, minlength=BINS)
    total = np.bincount(number, weights=rate, minlength=BINS)
    return tuple(float(s / n) if n >= _LEAST_IN_BIN else None for s, n in zip(total, count, strict=True))


def _noise(residual: FloatArray) -> float:
    """Noise of a mean from successive differences, of their bulk: steps and spikes do not count."""
    if residual.size < 3:
        return 0.0
    return float(MAD_TO_SIGMA * median(np.abs(np.diff(residual))) / np.sqrt(2.0))


def step_in(residual: FloatArray) -> tuple[int, float, float]:
    """The likeliest step of a residual: index of the first mean after it, size (deg/h), and its score.

    The score is the largest difference between the means of what lies before and after, in standard deviations of that
    difference for white noise (Sen and Srivastava 1975). Slow noise has large scores too: they are compared with
    those of the lot.
    """
    n = residual.size
    sigma = _noise(residual)
    if n < _LEAST_MEANS or sigma == 0.0:
        return 0, 0.0, 0.0
    calm = np.clip(residual, *(median(residual) + np.array([-6.0, 6.0]) * max(sigma, float(residual.std()))))
    k = np.arange(1, n)
    before = np.cumsum(calm)[:-1] / k
    after = (calm.sum() - np.cumsum(calm)[:-1]) / (n - k)
    score = np.abs(after - before) * np.sqrt(k * (n - k) / n) / sigma
    edge = max(2, int(_EDGE * n))
    inside = slice(edge - 1, n - edge)
    best = int(np.argmax(score[inside])) + edge - 1
    return best + 1, float(after[best] - before[best]), float(score[best])
