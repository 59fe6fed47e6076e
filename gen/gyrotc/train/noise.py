"""The noise of a gyro: Allan variance and its terms, the noise floor, and tests of what a map leaves.

The Allan variance of a rate averaged over tau is, as a sum of independent noises (IEEE Std 952-2020, annex C):

    sigma^2(tau) = 3 Q^2/tau^2 + N^2/tau + (2 ln 2/pi) B^2 + K^2 tau/3

with quantisation Q, angle random walk N, bias instability B and rate random walk K.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ..common.arrays import FloatArray
from ..common.metrics import LEAST_SPAN_C, MAD_TO_SIGMA, median
from ..results.training import AllanPoint, BiasPlane, NoiseLimits, NoiseTerms
from .data import TrainingData, average_samples

_ROUNDS = 50  # at most; a few are usual
_LEAST_SHARE, _LEAST_GAIN = 1e-2, 1e-2  # of a step; of -2 log likelihood, of which 4 decides
_LEAST_EXPECTED = 1e-3  # of the least mean square: bounds weights
_BANDS = 4.0  # to an octave
_FALL = 5.0  # of -2 log likelihood: below it lie 4 % of a chi-square of one degree of freedom, less of more
_LIMIT_DIGITS = 0.05  # of the logarithm of a limit's square
_LEAST_PAIRS = 8  # independent differences behind a point, which then scatters by a quarter: 1/√(2·8)
_LEAST_SPAN_C_PER_MIN = 0.1  # a chamber at rest wanders by this
_S_PER_H = 3600.0  # s in an hour


def stretches(values: FloatArray, time_s: FloatArray, run: NDArray[np.int64], step_s: float) -> list[FloatArray]:
    """Values of gap-free stretches: cut where the run changes or a step of time is longer than 1.5 `step_s`."""
    cuts = np.flatnonzero((np.diff(run) != 0) | (np.diff(time_s) > 1.5 * step_s)) + 1
    return list(np.split(values, cuts))


def allan_variance(residuals: Sequence[FloatArray], step_s: float) -> list[AllanPoint]:
    """Overlapping Allan deviation at octaves of the step, pooled over gap-free stretches (NIST SP 1065, eq. 11).

    Args:
        residuals: Mean rates over `step_s`, one array for each stretch, deg/h.
        step_s: Length of a mean, s.
    """
    total: dict[int, tuple[float, int]] = {}
    for stretch in residuals:
        factors = [2**k for k in range(32) if 2 ** (k + 1) <= len(stretch) // 2]
        for factor in factors:
            differences = steps_of(stretch, factor)
            square, count = total.get(factor, (0.0, 0))
            total[factor] = (square + 0.5 * float(differences @ differences), count + len(differences))
    return [
        AllanPoint(tau_s=factor * step_s, deviation_dph=float(np.sqrt(square / count)), freedom=count / factor)
        for factor, (square, count) in sorted(total.items())
        if count / factor >= _LEAST_PAIRS
    ]


def steps_of(rates: FloatArray, factor: int) -> FloatArray:
    """Every difference of two means over `factor` rates that follow one another: two of sums of sums."""
    angle = np.concatenate([[0.0], np.cumsum(rates - rates.mean())])
    return np.asarray(angle[2 * factor :] - 2.0 * angle[factor:-factor] + angle[: -2 * factor]) / factor


def noise_terms(residuals: Sequence[FloatArray], step_s: float) -> NoiseTerms:
    """Q, N, B and K of residuals with non-negative squares, and the Allan deviation itself.

    They are the likeliest by the coefficients of a cosine transform, which are independent. A term is resolved where
    the likelihood of zero lies far below the top; else it is 0, and `below` is where the likelihood has fallen as far
    above the top (95 %). All are None where the record is too short.

    Args:
        residuals: Mean rates over `step_s`, one array for each gap-free stretch, deg/h.
        step_s: Length of a mean, s.
    """
    points = allan_variance(residuals, step_s)
    names = ("quantisation_arcsec", "arw_deg_per_sqrt_h", "bias_instability_dph", "rate_random_walk_dph_per_sqrt_h")
    terms: dict[str, float | None] = dict.fromkeys(names)
    below: dict[str, float] = {}
    if len(points) >= len(names) and all(p.deviation_dph > 0.0 for p in points):
        shapes, square, freedom = _bands(residuals, step_s)
        squares, top = _likeliest(shapes, square, freedom)
        for k, name in enumerate(names):
            terms[name] = float(np.sqrt(squares[k]))
            if squares[k] == 0.0 or _profile(shapes, square, freedom, k, 0.0) - top < _FALL:
                terms[name] = 0.0
                below[name] = _limit(shapes, square, freedom, k, float(squares[k]), top)
    return NoiseTerms(**terms, allan=tuple(points), below=NoiseLimits(**below))


def _bands(residuals: Sequence[FloatArray], step_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return for narrow bands of frequency the share of each term, the mean square and the number of coefficients.

    Coefficients are those of the cosine transform of a stretch, the constant left out. With ω = 2 sin(π f step) their
    variance is, of Q, N, B, K: (Q ω/step)², N²/step, B²/ω, K² step/ω²; of N and K exactly so, and independent.
    """
    found = []
    for stretch in (s for s in residuals if s.size > 1):
        n = stretch.size
        k = np.arange(1, n)
        turned = np.fft.rfft(np.concatenate([stretch, stretch[::-1]]))[1:n] * np.exp(-0.5j * np.pi * k / n)
        found.append(np.stack([2.0 * np.sin(0.5 * np.pi * k / n), turned.real**2 / (2.0 * n)]))
    omega, square = np.concatenate(found, axis=1)
    _, band = np.unique(np.floor(_BANDS * np.log2(omega)), return_inverse=True)
    step_h = step_s / _S_PER_H  # N and K go with h; 1 arcsec/s is 1 deg/h, so that Q in arcsec goes with s
    terms = ((omega / step_s) ** 2, np.full(omega.size, 1.0 / step_h), 1.0 / omega, step_h / omega**2)
    count = np.bincount(band).astype(np.float64)
    *shapes, square = (np.bincount(band, weights=v) / count for v in (*terms, square))
    return np.stack(shapes, axis=1), square, count


def _likeliest(
    shapes: FloatArray, square: FloatArray, freedom: FloatArray, known: FloatArray | float = 0.0
) -> tuple[FloatArray, float]:
    """Squares of the terms beside a part that is known, and -2 log likelihood of mean squares.

    Fisher's scoring: non-negative least squares with weights of the sum found before, its steps halved while they do
    not gain.
    """
    from scipy.optimize import nnls  # 0.2 s to import, which who fits nothing need not wait for

    least = _LEAST_EXPECTED * float(square[square > 0.0].min())

    def unlikelihood(squares: FloatArray) -> float:
        expected = np.maximum(shapes @ squares + known, least)
        return float(np.sum(freedom * (np.log(expected) + square / expected)))

    squares = np.zeros(shapes.shape[1])
    expected = np.maximum(square, median(square))
    best = np.inf
    for _ in range(_ROUNDS):
        weighted = shapes * (np.sqrt(freedom) / expected)[:, None]
        scale = weighted.max(axis=0)
        found, _ = nnls(weighted / scale, np.sqrt(freedom) / expected * (square - known))
        step, share = found / scale - squares, 1.0
        while (reached := unlikelihood(squares + share * step)) > best and share > _LEAST_SHARE:
            share *= 0.5
        if not reached < best - _LEAST_GAIN:
            break
        squares, best = squares + share * step, reached
        expected = np.maximum(shapes @ squares + known, least)
    return squares, best


def _profile(shapes: FloatArray, square: FloatArray, freedom: FloatArray, k: int, value: float) -> float:
    """-2 log likelihood with the square of a term given and the others the likeliest."""
    others = np.delete(shapes, k, axis=1)
    return _likeliest(others, square, freedom, value * shapes[:, k])[1]


def _limit(shapes: FloatArray, square: FloatArray, freedom: FloatArray, k: int, value: float, top: float) -> float:
    """The term, not its square, above the likeliest at which the likelihood has fallen far."""
    from scipy.optimize import brentq

    def fallen(log: float) -> float:
        return _profile(shapes, square, freedom, k, float(np.exp(log))) - top - _FALL

    low = high = float(np.log(max(value, 0.1 * np.min(square[square > 0.0] / shapes[square > 0.0, k]))))
    while fallen(low) >= 0.0:
        low -= 2.0
    while fallen(high) < 0.0:
        low, high = high, high + 1.5
    return float(np.exp(0.5 * brentq(fallen, low, high, xtol=_LIMIT_DIGITS)))


def sensitivities(
    temperature_c: FloatArray, slope_c_per_min: FloatArray, bias_dph: FloatArray, weight: FloatArray
) -> BiasPlane:
    """Slopes of the uncompensated bias per C and per C/min, by least squares of a plane."""
    root = np.sqrt(weight)
    inputs = {"bias_dph_per_c": temperature_c, "bias_dph_per_c_per_min": slope_c_per_min}
    least = {"bias_dph_per_c": LEAST_SPAN_C, "bias_dph_per_c_per_min": _LEAST_SPAN_C_PER_MIN}
    used = [name for name, values in inputs.items() if len(values) and np.ptp(values) >= least[name]]
    columns = [np.ones(len(bias_dph)), *(inputs[name] - inputs[name].mean() for name in used)]
    design = np.stack(columns, axis=1)
    solution, *_ = np.linalg.lstsq(design * root[:, None], bias_dph * root, rcond=None)
    residual = bias_dph - design @ solution
    slopes = dict(zip(used, (float(value) for value in solution[1:]), strict=True))
    return BiasPlane(
        bias_dph_per_c=slopes.get("bias_dph_per_c"),
        bias_dph_per_c_per_min=slopes.get("bias_dph_per_c_per_min"),
        residual_rms_dph=float(np.sqrt(np.average(residual**2, weights=weight))),
    )


_CLIP = 4.5  # robust σ, as outliers are dropped in training (process.py)
_SIGNIFICANCE = 1e-3  # of each test: docs/training.md, section 1, step 5
_LAGS = 10  # of the autocorrelation, Ljung and Box 1978
_LEAST_DIFFERENCES = 6  # with fewer a median says nothing


def robust_sigma(x: FloatArray) -> float:
    """RMS of the bulk of x: what lies within 4.5 σ of 0, σ from the median."""
    if len(x) == 0:
        return 0.0
    limit = _CLIP * MAD_TO_SIGMA * median(np.abs(x))
    inside = x[np.abs(x) <= limit]
    return float(np.sqrt(np.mean(inside**2))) if limit > 0.0 else float(np.sqrt(np.mean(x**2)))


def floor_dph(data: TrainingData, residual: FloatArray, average_s: float) -> float:
    """Noise of means over `average_s`, deg/h, from first differences of the residual within runs.

    Slow structure that the map leaves does not count; samples longer than `average_s` are taken as they are.
    """
    means = average_samples(replace(data, bias_dph=residual), average_s)
    differences = np.diff(means.bias_dph)[np.diff(means.run) == 0]
    if len(differences) == 0:
        return robust_sigma(means.bias_dph)
    return robust_sigma(differences) / float(np.sqrt(2.0))


def difference_sigma(means: TrainingData, y: FloatArray, weight: FloatArray) -> float:
    """σ of y at weight 1 from differences of neighbouring means; 0 where too few of them, or none differ.

    First differences count a steady slope as noise, second differences count it as nothing: the smaller of the two.

    Args:
        means: Means in order of run and time, as `average_samples` returns them.
        y: Their bias in any unit.
        weight: The noise variance of a mean is σ²/weight.
    """
    next_to = (np.diff(means.run) == 0) & (np.diff(means.time_s) < 1.5 * median(means.duration_s))
    first = np.diff(y) / np.sqrt(1.0 / weight[1:] + 1.0 / weight[:-1])
    both = next_to[1:] & next_to[:-1]
    second = np.diff(y, 2) / np.sqrt(1.0 / weight[2:] + 4.0 / weight[1:-1] + 1.0 / weight[:-2])
    found = [robust_sigma(x) for x in (first[next_to], second[both]) if len(x) >= _LEAST_DIFFERENCES]
    return min(found, default=0.0)


def not_white(residual: FloatArray, run: NDArray[np.int64], weight: FloatArray) -> str:
    """Return the reason why a residual is not white noise with zero mean in every run; empty if it may be.

    Two tests at 0.1 %: run means against the scatter (chi-square), autocorrelation over 10 lags (Ljung-Box). A
    single run passes neither: what another run would bring was never seen.
    """
    n = len(residual)
    scaled = residual * np.sqrt(weight)
    sigma = robust_sigma(scaled)
    if sigma == 0.0 or n < 4 * _LAGS:
        return "too few samples to test the residual"
    runs, index = np.unique(run, return_inverse=True)
    if len(runs) < 2:
        return "a single run does not show how runs differ"
    total = np.bincount(index, weight * residual) / np.sqrt(np.bincount(index, weight))
    if chdtrc(len(runs), float(np.sum((total / sigma) ** 2))) < _SIGNIFICANCE:
        return "run means of the residual scatter more than its noise allows"
    clipped = np.clip(scaled / sigma, -_CLIP, _CLIP)
    power = float(np.sum(clipped**2))
    statistic = 0.0
    for lag in range(1, _LAGS + 1):
        pairs = run[lag:] == run[:-lag]
        rho = float(np.sum(clipped[lag:][pairs] * clipped[:-lag][pairs])) / power
        statistic += n * (n + 2) * rho**2 / (n - lag)
    if chdtrc(_LAGS, statistic) < _SIGNIFICANCE:
        return "the residual is correlated in time"
    return ""
