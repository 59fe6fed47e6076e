"""How the uncertainty of a correction grows where it is not as it was trained: the numbers of `model.json`'s rules.

What a correction lacks (a slope, a new temperature) moves the bias by what the map says, and training has seen how far
that is. So each rule has one number, found from the training samples alone: the one with which squared normal
deviations would have been 1 on average,

    mean of (D² + σ²)/(σ² + c² x²) = 1

D: what the map's own answer lacks (the map a time later less the map now; with its slope less without), x: what is
known at that moment (the slope times the age; the slope), σ: the map's own uncertainty. docs/design.md, "How
uncertain a correction is".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from ..common.arrays import FloatArray
from ..target.operators import play
from .data import TrainingData
from .evidence import Process
from .result import Fit, predict

__all__ = ["Known", "rezero_dph", "rules_of", "start_sigma"]


_AGES = (1, 2, 3, 5, 8, 12, 17, 23, 30)  # blocks for which a correction is held
_AT_REST_C_PER_MIN = 0.01  # a temperature at rest may go on like this: a tenth of what chambers hold
_STEP = 0.05  # of a range, for gradients
_BISECTIONS = 60  # leave less than the last digit of a float64
_MOST = 20000  # samples that are looked at


@dataclass(frozen=True, slots=True)
class Known:
    """What the rules are made from; the samples are in order of run and time."""

    samples: TrainingData
    fit: Fit
    process: Process
    sigma: FloatArray  # of the map at each sample, deg/h
    between: float  # of the constant from power-on to power-on, deg/h
    covered: tuple[FloatArray, FloatArray]  # points where training was: C, C/min
    added: FloatArray | float = 0.0  # what terms add to the map at each sample, deg/h


def rules_of(known: Known, block_s: float) -> dict[str, Any]:
    """`rules` of `uncertainty_dph` of `model.json`, without terms."""
    s, fit = known.samples, known.fit
    of_map = predict(fit, s.temperature_c, s.slope_c_per_min)
    here = of_map + known.added
    lacking = of_map - predict(fit, s.temperature_c, np.zeros(len(s)))
    variance = known.sigma**2
    mean = float(np.average(variance, weights=s.weight))
    hold = _held(known, here, block_s)
    spread = float(np.average((here - fit.fallback_dph) ** 2, weights=s.weight))
    gradients = _gradients(known)
    return {
        "hold_dph_per_c": hold,
        "rest_dph_per_min": hold * _AT_REST_C_PER_MIN,
        "slope_dph_per_c_per_min": _balanced(lacking**2, s.slope_c_per_min**2, variance),
        "start_dph": float(np.sqrt(np.average(lacking**2, weights=s.weight))),
        "beyond_dph_per_c": gradients[0],
        "beyond_dph_per_c_per_min": gradients[1],
        "fallback_dph": float(np.sqrt(spread + mean)),
        "none_dph": float(np.sqrt(np.average(here**2, weights=s.weight) + mean)),
        "between_dph": known.between,
        "noise_deg_per_sqrt_h": fit.noise_floor_dph * float(np.sqrt(fit.average_s / 3600.0)),
        "correlation_s": _correlation_s(known, block_s),
        "terms": [],
    }


def rezero_dph(between: float, runs: int) -> float:
    """Largest shift of the constant in the field, deg/h: what one power-on in a thousand goes beyond.

    `between` of few runs already has the variance of Student's t; its quantile lies farther out than the normal one.
    """
    freedom = max(runs - 1, 3)
    return between * float(stdtrit(freedom, 0.9995)) * float(np.sqrt((freedom - 2.0) / freedom))


def start_sigma(
    id: str,
    parameters: dict[str, float],
    rules: dict[str, Any],
    samples: TrainingData,
    channel: FloatArray | None,
) -> float:
    """What a term does not know of the time before it began, 1 σ: deg/h, for a play deg/h/C.

    A memory or a play may have been as far from the temperature as it was on average in training; that of a play
    falls with every degree of its width through which the temperature has moved; a channel that is lost may differ
    from its reference as it did in training.
    """
    amplitude = abs(parameters.get("amplitude_dph_per_c", 0.0))
    if id == "hysteresis":
        width = parameters["width_c"]
        return amplitude * _played(samples, width) / (2.0 * width)
    if id in ("thermal_gradient", "cavity_lag"):
        apart = _apart(samples, parameters["tau_s"])
        if id == "cavity_lag":
            per_min = 60.0 / parameters["tau_s"]
            amplitude = float(
                np.hypot(rules["beyond_dph_per_c"], rules["beyond_dph_per_c_per_min"] * per_min)
            )
        return amplitude * apart
    if channel is not None and np.isfinite(channel).any():
        departure = channel[np.isfinite(channel)] - parameters["reference"]
        return abs(parameters["slope_dph_per_unit"]) * float(np.sqrt(np.mean(departure**2)))
    return 0.0


def _played(samples: TrainingData, width_c: float) -> float:
    """The same of a play; its width where training did not move it."""
    squares = [
        (play(width_c, samples.temperature_c[own]) - samples.temperature_c[own]) ** 2
        for own in _runs(samples)
    ]
    found = float(np.sqrt(np.mean(np.concatenate(squares))))
    return found if found > 0.0 else width_c


def _apart(samples: TrainingData, tau_s: float) -> float:
    """RMS of a first-order memory of the temperature less the temperature over the training runs, C."""
    squares, count = 0.0, 0
    for own in _runs(samples):
        x = samples.temperature_c[own]
        steps = np.diff(samples.time_s[own], prepend=samples.time_s[own][0])
        z = x[0]
        for value, gain in zip(x.tolist(), (-np.expm1(-steps / tau_s)).tolist(), strict=True):
            z += gain * (value - z)
            squares += (z - value) ** 2
        count += len(x)
    return float(np.sqrt(squares / max(count, 1)))


def _runs(samples: TrainingData) -> list[NDArray[np.int64]]:
    cuts = np.flatnonzero(np.diff(samples.run)) + 1
    return list(np.split(np.arange(len(samples)), cuts))


def _held(known: Known, here: FloatArray, block_s: float) -> float:
    """deg/h for each C by which the input may have gone on at its slope."""
    s = known.samples
    squares, moved, variance = [], [], []
    every = max(1, len(s) * len(_AGES) // _MOST)
    for age in _AGES:
        k = np.arange(0, len(s) - age, every)
        k = k[(s.run[k] == s.run[k + age]) & (s.time_s[k + age] - s.time_s[k] < 1.5 * age * block_s)]
        minutes = age * block_s / 60.0
        squares.append((here[k + age] - here[k]) ** 2)
        moved.append((s.slope_c_per_min[k] ** 2 + _AT_REST_C_PER_MIN**2) * minutes**2)
        variance.append(known.sigma[k] ** 2)
    return _balanced(*(np.concatenate(parts) for parts in (squares, moved, variance)))


def _balanced(squares: FloatArray, x: FloatArray, variance: FloatArray) -> float:
    """c with which (squares + variance)/(variance + c² x) is 1 on average; 0 where nothing moved."""
    if squares.size == 0 or not squares.any() or not x.any():
        return 0.0
    variance = np.maximum(variance, 1e-6 * float(np.mean(squares)))
    scale = float(np.mean(squares) / np.mean(x))
    both = squares + variance
    low, high = -30.0, 10.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        if np.mean(both / (variance + np.exp(middle) * scale * x)) > 1.0:
            low = middle
        else:
            high = middle
    return float(np.sqrt(np.exp(middle) * scale))


def _gradients(known: Known) -> tuple[float, float]:
    """RMS gradients of the map where training was, deg/h/C and deg/h/(C/min): beyond the edge they are drawn anew."""
    t, r = known.covered
    spans = known.fit.scaling.temperature_c, known.fit.scaling.slope_c_per_min
    found = []
    for axis, span in enumerate(spans):
        step = _STEP * (span[1] - span[0])
        low = [t, r]
        high = [t, r]
        low[axis] = np.maximum(low[axis] - step, span[0])
        high[axis] = np.minimum(high[axis] + step, span[1])
        wide = high[axis] - low[axis]
        if step <= 0.0 or not (wide > 0.0).all():
            found.append(0.0)
            continue
        slope = (predict(known.fit, *high) - predict(known.fit, *low)) / wide
        found.append(float(np.sqrt(np.mean(slope**2))))
    return found[0], found[1]


def _correlation_s(known: Known, block_s: float) -> float:
    """Time after which the map's error has lost all but 1/e of what it was, on the way that training took, s.

    The process forgets over its shortest scales; where inputs stay within them to the end of the runs, the time is
    that of the exponential through the end.
    """
    s, scaling = known.samples, known.fit.scaling
    scale_t, scale_r = known.process.scales
    z_t, z_r = scaling.normalise(s.temperature_c, s.slope_c_per_min)
    z_t, z_r = z_t / scale_t, z_r / scale_r
    lag, longest = 1, max(int(np.max(np.bincount(s.run))) // 2, 1)
    last, constant = 1.0, known.between**2
    every, variance = max(1, len(s) // _MOST), known.sigma**2
    while True:
        now, then = slice(0, max(len(s) - lag, 0), every), slice(lag, None, every)
        same = s.run[now] == s.run[then]
        if not same.any():
            break
        apart = ((z_t[then] - z_t[now]) ** 2 + (z_r[then] - z_r[now]) ** 2)[same]
        both = (known.sigma[now] * known.sigma[then])[same]
        size = np.sqrt(np.mean(variance[now][same]) * np.mean(variance[then][same]))
        last = float((np.mean(both * np.exp(-0.5 * apart)) + constant) / (size + constant))
        if last <= np.exp(-1.0) or lag >= longest:
            break
        lag = min(2 * lag if lag < 16 else lag + lag // 8, longest)
    if last >= 1.0 - 1e-9:
        return float(max(longest * block_s, 1.0))
    return float(np.clip(-lag * block_s / np.log(last), block_s, 7.5e6))
