"""1 sigma of the corrected bias over the envelope, and the rules by which it grows elsewhere.

What a correction lacks (a slope, a new temperature) moves the bias by what the map says, and training has seen how far
that is. So each rule has one number, found from the training samples alone: the one with which squared normal
deviations would have been 1 on average,

    mean of (D² + σ²)/(σ² + c² x²) = 1

D: what the map's own answer lacks (the map a time later less the map now; with its slope less without), x: what is
known at that moment (the slope times the age; the slope), σ: the map's own uncertainty. docs/design.md, "How
uncertain a correction is".

What the map may be wrong by at (T, dT/dt), noise of the gyro not included, has two parts. That of the map is about the
mean of a run:

    sigma^2 = variance of the smooth map about its mean over the training history + (map - smooth map)^2

with what the shape of the map differs by from power-on to power-on. That of the turn-on is the constant of the next
power-on: its repeatability, as the intercepts of the training power-ons show it, and the uncertainty of the mean
constant. It has one degree of freedom less than there are power-ons; from a single power-on it is not known.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

from ..causes.hysteresis import strength
from ..common.arrays import FloatArray
from ..mirror.recursions import play
from .data import TrainingData, bin_of, cleaned_beside, cleaned_samples
from .gaussian import GaussianMap
from .process import Process, fit_process
from .result import Fit, predict

_AGES = (1, 2, 3, 5, 8, 12, 17, 23, 30)  # blocks for which a correction is held
_TURNS = 20000  # pairs of a place in training and a trained slope that are looked at
_STEP = 0.05  # of a range, for gradients
_LOG_SHARES = (-30.0, 10.0)  # logarithms of c² x over the squares, between which it is sought
_SHARE_ERROR = 1e-9  # of the logarithm: no table has so many digits
_MOST = 20000  # samples that are looked at


@dataclass(frozen=True, slots=True)
class UncertaintyInputs:
    """Input of the rules; the samples are in order of run and time."""

    samples: TrainingData
    fit: Fit
    process: Process
    sigma: FloatArray  # of the map at each sample, deg/h
    turn_on: TurnOn
    covered: tuple[FloatArray, FloatArray]  # points where training was: C, C/min
    added: FloatArray  # what terms add to the map at each sample, deg/h


def rules_of(known: UncertaintyInputs, block_s: float) -> dict[str, Any]:
    """`rules` of `uncertainty_dph` of `model.json`, without terms."""
    s, fit = known.samples, known.fit
    of_map = predict(fit, s.temperature_c, s.slope_c_per_min)
    here = of_map + known.added
    lacking = of_map - predict(fit, s.temperature_c, np.zeros(len(s)))
    variance = known.sigma**2
    mean = float(np.average(variance, weights=s.weight))
    hold = _held(known, here, block_s)
    turn, rest = _turned(known, hold, block_s)
    spread = float(np.average((here - fit.fallback_dph) ** 2, weights=s.weight))
    gradients = _gradients(known)
    return {
        "hold_dph_per_c": hold,
        "rest_dph_per_min": rest,
        "slope_dph_per_c_per_min": _balanced(lacking**2, s.slope_c_per_min**2, variance),
        "start_dph": float(np.sqrt(np.average(lacking**2, weights=s.weight))),
        "turn_dph": turn,
        "beyond_dph_per_c": gradients[0],
        "beyond_dph_per_c_per_min": gradients[1],
        "fallback_dph": float(np.sqrt(spread + mean)),
        "none_dph": float(np.sqrt(np.average(here**2, weights=s.weight) + mean)),
        "between_dph": known.turn_on.sigma_dph,
        "turn_on_dph": known.turn_on.repeatability_dph,
        "turn_on_freedom": known.turn_on.freedom,
        "noise_deg_per_sqrt_h": fit.noise_floor_dph * float(np.sqrt(fit.average_s / 3600.0)),
        "correlation_s": _correlation_s(known, block_s),
        "terms": [],
    }


def rezero_dph(rules: dict[str, Any]) -> float:
    """Return the largest shift of the constant in the field, deg/h: one power-on in a thousand goes beyond it.

    Args:
        rules: `rules` of `uncertainty_dph`; with unknown repeatability the shift is 0.
    """
    repeatability, freedom = rules.get("turn_on_dph"), rules.get("turn_on_freedom")
    if repeatability is None:
        return 0.0
    return float(repeatability * _quantile(freedom, 0.9995))


def _quantile(freedom: int | None, probability: float) -> float:
    """Return a quantile of Student's t, of the normal distribution without a number of degrees of freedom.

    Quantiles with fewer than three degrees of freedom are of no use in the field.
    """
    return float(ndtri(probability) if freedom is None else stdtrit(max(freedom, _MIN_FREEDOM), probability))


def start_sigma(
    id: str,
    parameters: dict[str, float],
    rules: dict[str, Any],
    samples: TrainingData,
    channel: Iterable[FloatArray] = (),
) -> float:
    """Return the sigma of a term from the unknown time before it began: deg/h, for a play deg/h/C.

    A memory or a play may have been as far from the temperature as it was on average in training; that of a play
    falls with every degree of its width through which the temperature has moved; a channel that is lost may differ
    from its reference as it did in training: `channel`, its readings part by part.
    """
    amplitude = abs(parameters.get("amplitude_dph_per_c", 0.0))
    if id == "hysteresis":
        width = parameters["width_c"]
        growth, seen = parameters.get("amplitude_dph_per_c_per_c", 0.0), samples.temperature_c
        typical = float(np.hypot(strength(parameters, seen.mean()), growth * seen.std()))  # RMS over T
        return typical * _played(samples, width) / (2.0 * width)
    if id in ("thermal_gradient", "cavity_lag"):
        left = _warm_up_left(samples, parameters["tau_s"])
        if id == "cavity_lag":
            per_min = 60.0 / parameters["tau_s"]
            amplitude = float(np.hypot(rules["beyond_dph_per_c"], rules["beyond_dph_per_c_per_min"] * per_min))
        return amplitude * left
    squares, count = 0.0, 0
    for part in channel:
        squares, count = squares + float(((part - parameters["reference"]) ** 2).sum()), count + part.size
    return abs(parameters["slope_dph_per_unit"]) * float(np.sqrt(squares / count)) if count else 0.0


def _played(samples: TrainingData, width_c: float) -> float:
    """Return that sigma for a play; its width if training did not move it."""
    squares = [(play(width_c, samples.temperature_c[own]) - samples.temperature_c[own]) ** 2 for own in _runs(samples)]
    found = float(np.sqrt(np.mean(np.concatenate(squares))))
    return found if found > 0.0 else width_c


def _warm_up_left(samples: TrainingData, tau_s: float) -> float:
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


def _held(known: UncertaintyInputs, here: FloatArray, block_s: float) -> float:
    """deg/h for each C by which the input may have gone on at its slope."""
    s = known.samples
    squares, moved, variance = [], [], []
    every = max(1, len(s) * len(_AGES) // _MOST)
    for age in _AGES:
        k = np.arange(0, len(s) - age, every)
        k = k[(s.run[k] == s.run[k + age]) & (s.time_s[k + age] - s.time_s[k] < 1.5 * age * block_s)]
        minutes = age * block_s / 60.0
        squares.append((here[k + age] - here[k]) ** 2)
        moved.append(s.slope_c_per_min[k] ** 2 * minutes**2)
        variance.append(known.sigma[k] ** 2)
    return _balanced(*(np.concatenate(parts) for parts in (squares, moved, variance)))


def _turned(known: UncertaintyInputs, hold: float, block_s: float) -> tuple[float, float]:
    """Return what a held correction is wrong by when the temperature turns to any trained slope: deg/h, deg/h/min.

    Slopes are drawn evenly from the covered cells, places from training. The first number is the RMS change of the map
    with the slope alone; with the second, which grows with the minutes, the squared change over 1 to 30 blocks is on
    average what sigma says together with its other parts.
    """
    s, rng = known.samples, np.random.default_rng(0)
    k, slope = rng.integers(0, len(s), _TURNS), rng.choice(known.covered[1], _TURNS)
    t, here = s.temperature_c[k], predict(known.fit, s.temperature_c[k], s.slope_c_per_min[k])
    low, high = known.fit.scaling.temperature_c
    turn = float(np.sqrt(np.mean((predict(known.fit, t, slope) - here) ** 2)))
    minutes = rng.choice(_AGES, _TURNS) * (block_s / 60.0)
    there = predict(known.fit, np.clip(t + slope * minutes, low, high), slope)
    variance = known.sigma[k] ** 2 + (hold * s.slope_c_per_min[k] * minutes) ** 2 + turn**2
    return turn, _excess((there - here) ** 2 + known.sigma[k] ** 2, minutes**2, variance)


def _excess(squares: FloatArray, x: FloatArray, variance: FloatArray) -> float:
    """Return the c with which squares / (variance + c² x) is 1 on average; 0 where the variance is enough."""
    if not squares.any() or not x.any():
        return 0.0
    variance = np.maximum(variance, 1e-12 * float(np.mean(squares)))
    if np.mean(squares / variance) <= 1.0:
        return 0.0
    from scipy.optimize import brentq  # 0.1 s to import

    scale = float(np.mean(squares) / np.mean(x))

    def beyond(log_share: float) -> float:
        return float(np.mean(squares / (variance + np.exp(log_share) * scale * x))) - 1.0

    low, high = _LOG_SHARES
    found = low if beyond(low) <= 0.0 else high if beyond(high) >= 0.0 else brentq(beyond, low, high, xtol=_SHARE_ERROR)
    return float(np.sqrt(np.exp(found) * scale))


def _balanced(squares: FloatArray, x: FloatArray, variance: FloatArray) -> float:
    """Return the c with which (squares + variance)/(variance + c² x) is 1 on average; 0 where nothing moved."""
    if not squares.any():
        return 0.0
    variance = np.maximum(variance, 1e-6 * float(np.mean(squares)))
    return _excess(squares + variance, x, variance)


def _gradients(known: UncertaintyInputs) -> tuple[float, float]:
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


def _correlation_s(known: UncertaintyInputs, block_s: float) -> float:
    """Time after which the map's error has lost all but 1/e of what it was, on the way that training took, s.

    The process forgets over its shortest scales; where inputs stay within them to the end of the runs, the time is
    that of the exponential through the end.
    """
    s, scaling = known.samples, known.fit.scaling
    scale_t, scale_r = known.process.model.scales
    z_t, z_r = scaling.normalise(s.temperature_c, s.slope_c_per_min)
    z_t, z_r = z_t / scale_t, z_r / scale_r
    lag, longest = 1, max(int(np.max(np.bincount(s.run))) // 2, 1)
    last, constant = 1.0, known.turn_on.sigma_dph**2
    every, variance = max(1, len(s) // _MOST), known.sigma**2
    while True:
        now, then = slice(0, max(len(s) - lag, 0), every), slice(lag, None, every)
        same = s.run[now] == s.run[then]
        if not same.any():
            break
        distance = ((z_t[then] - z_t[now]) ** 2 + (z_r[then] - z_r[now]) ** 2)[same]
        both = (known.sigma[now] * known.sigma[then])[same]
        size = np.sqrt(np.mean(variance[now][same]) * np.mean(variance[then][same]))
        last = float((np.mean(both * np.exp(-0.5 * distance)) + constant) / (size + constant))
        if last <= np.exp(-1.0) or lag >= longest:
            break
        lag = min(2 * lag if lag < 16 else lag + lag // 8, longest)
    if last >= 1.0 - 1e-9:
        return float(max(longest * block_s, 1.0))
    return float(np.clip(-lag * block_s / np.log(last), block_s, 7.5e6))


# Cells of T and of dT/dt: 384 bits in a table.
_COVERAGE_CELLS = (32, 12)
# Cells of T and of dT/dt: 80 words in a table; an odd number of slopes, so that rest has cells of its own.
_UNCERTAINTY_CELLS = (8, 5)
_POINTS = (64, 24)  # of T and of dT/dt, twice the cells of the coverage
_MIN_FREEDOM = 3  # of quantiles of Student's t
_ONE_SIGMA = 0.8413  # probability below one standard deviation of a normal distribution


@dataclass(frozen=True, slots=True)
class TurnOn:
    """The constant of the next power-on less that of the table.

    Attributes:
        repeatability_dph: Its standard deviation: from power-on to power-on, and of the mean of those in training; None
            if it is not known.
        freedom: Degrees of freedom of it; None: many.
        mean_dph: Standard uncertainty of the mean constant.
    """

    repeatability_dph: float | None
    freedom: int | None
    mean_dph: float

    @property
    def sigma_dph(self) -> float:
        """Half width that holds the constant of 68 % of all power-ons, with Student's t; without what is not known."""
        if self.repeatability_dph is None:
            return self.mean_dph
        return _quantile(self.freedom, _ONE_SIGMA) * self.repeatability_dph


def coverage(data: TrainingData, fit: Fit) -> dict[str, Any]:
    """`coverage` of `model.json`: cells of the envelope (T, dT/dt) that hold training samples, its own or a lot's."""
    cells = _COVERAGE_CELLS
    t = _index(data.temperature_c, fit.scaling.temperature_c, cells[0])
    r = _index(data.slope_c_per_min, fit.scaling.slope_c_per_min, cells[1])
    seen = np.zeros(cells[::-1], dtype=bool)
    seen[r, t] = True
    if fit.process and (asked := fit.process.asked):
        r = _index(asked.slope_c_per_min, fit.scaling.slope_c_per_min, cells[1])
        seen[r, _index(asked.temperature_c, fit.scaling.temperature_c, cells[0])] = True
    return {"cells": list(cells), "rows": ["".join("1" if x else "0" for x in row) for row in seen]}


def uncertainty_of(
    data: TrainingData,
    fit: Fit,
    cells: tuple[int, int] = _UNCERTAINTY_CELLS,
    block_s: float = 10.0,
    added: FloatArray | float = 0.0,
) -> dict[str, Any]:
    """`uncertainty_dph` of `model.json`: 1 σ over cells of the envelope, deg/h, and the rules of what comes on top.

    A cell with training samples has their mean variance: a correction is asked for where the gyro is, not evenly over
    the cell. `uncovered` is the mean over those points of the cell where training was not.

    Args:
        data: The samples that `fit` has seen.
        fit: The trained map.
        cells: Number of cells of T and of dT/dt.
        block_s: Length of a block, s.
        added: What terms add to the map at each sample of `data`, deg/h.
    """
    samples = cleaned_samples(data)
    process = fit.process or fit_process(samples, fit.scaling, fit.power_on)
    errors = _Errors.of(process, fit)
    at_samples = errors.at_samples(samples)
    t, r = _points(fit)
    at_points = errors.variance(t, r)
    covered = _covered(data, fit, t, r)
    place = _cell(fit, cells, t, r)
    everywhere = _means(place, at_points, np.ones(len(t)), cells, np.zeros(cells[::-1]))
    asked, weight = _asked(samples, process)
    of_asked = at_samples if process.asked is None else errors.variance(*asked)
    seen = _means(_cell(fit, cells, *asked), of_asked, weight, cells, everywhere)
    unseen = _means(place, at_points, (~covered).astype(np.float64), cells, everywhere)
    points = t[covered], r[covered]
    beside = cleaned_beside(data, np.broadcast_to(added, len(data)))
    turn_on = errors.turn_on
    known = UncertaintyInputs(samples, fit, process, np.sqrt(at_samples), turn_on, points, beside)
    constant = turn_on.sigma_dph**2
    return {
        "cells": list(cells),
        "rows": np.sqrt(seen + constant).tolist(),
        "uncovered": np.sqrt(unseen + constant).tolist(),
        "rules": rules_of(known, block_s),
    }


def _asked(samples: TrainingData, process: Process) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    """Return where corrections are asked for, C and C/min, and weights: as samples or prior show."""
    if process.asked is None:
        return (samples.temperature_c, samples.slope_c_per_min), samples.weight
    return (process.asked.temperature_c, process.asked.slope_c_per_min), process.asked.share


@dataclass(frozen=True, slots=True)
class _Errors:
    """Errors that a map may have.

    Attributes:
        process: The smooth map of the same samples.
        fit: The map.
        root: Mean over the history of the roots of the smooth map's covariance.
        departure_dph: Mean over the history of the map less the smooth map.
    """

    process: Process
    fit: Fit
    root: FloatArray
    departure_dph: float

    @staticmethod
    def of(process: Process, fit: Fit) -> _Errors:
        bins, scaling = process.bins, fit.scaling
        t = scaling.center_c + scaling.half_range_c * bins.t
        r = scaling.half_range_c_per_min * bins.r
        root = np.average(process.model.roots(bins.t, bins.r), axis=0, weights=bins.count)
        departure = np.average(predict(fit, t, r) - process.mean_dph(bins.t, bins.r), weights=bins.count)
        return _Errors(process, fit, root, float(departure))

    def variance(self, t: FloatArray, r: FloatArray) -> FloatArray:
        """Return the variance of the map about the mean of a run at inputs in C and C/min, (deg/h)^2."""
        z = self.fit.scaling.normalise(t, r)
        roots = self.process.model.roots(*z) - self.root
        departure = predict(self.fit, t, r) - self.process.mean_dph(*z) - self.departure_dph
        return np.asarray(self.process.spread**2 * np.sum(roots**2, axis=1) + departure**2)

    def at_samples(self, samples: TrainingData) -> FloatArray:
        """Return the same at samples, by small cells of the input plane, in which it hardly varies."""
        cell = bin_of(*self.fit.scaling.normalise(samples.temperature_c, samples.slope_c_per_min))
        count = np.bincount(cell)
        t, r = (np.bincount(cell, x) / count for x in (samples.temperature_c, samples.slope_c_per_min))
        return self.variance(t, r)[cell]

    @property
    def turn_on(self) -> TurnOn:
        process, model = self.process, self.process.model
        mean = float(np.hypot(process.spread * np.linalg.norm(self.root), self.departure_dph))
        if process.asked is not None:
            between = process.asked.between_dph
            known = None if between is None else float(np.hypot(between, mean))
            return TurnOn(known, process.asked.freedom, mean)
        if isinstance(model, GaussianMap) and model.structure.own:
            scatter = process.spread * float(np.sqrt(model.scatter[0]))
            return TurnOn(float(np.hypot(scatter, mean)), len(model.power_ons) - 1, mean)
        return TurnOn(None, 0, mean)


def _points(fit: Fit) -> tuple[FloatArray, FloatArray]:
    """A fine grid of points over the envelope, C and C/min."""

    def inner(span: tuple[float, float], n: int) -> FloatArray:
        return np.asarray(span[0] + (np.arange(n) + 0.5) / n * (span[1] - span[0]))

    t, r = np.meshgrid(inner(fit.scaling.temperature_c, _POINTS[0]), inner(fit.scaling.slope_c_per_min, _POINTS[1]))
    return t.reshape(-1), r.reshape(-1)


def _covered(data: TrainingData, fit: Fit, t: FloatArray, r: FloatArray) -> NDArray[np.bool_]:
    """Return a mask of the points in cells of the coverage that hold training samples."""
    rows = coverage(data, fit)["rows"]
    seen = np.array([[c == "1" for c in row] for row in rows]).reshape(-1)
    return np.asarray(seen[_cell(fit, (len(rows[0]), len(rows)), t, r)])


def _cell(fit: Fit, cells: tuple[int, int], t: FloatArray, r: FloatArray) -> NDArray[np.int64]:
    """Number of the cell of each point, T fastest."""
    of_t = _index(t, fit.scaling.temperature_c, cells[0])
    return of_t + cells[0] * _index(r, fit.scaling.slope_c_per_min, cells[1])


def _means(
    cell: NDArray[np.int64], values: FloatArray, weight: FloatArray, cells: tuple[int, int], otherwise: FloatArray
) -> FloatArray:
    """Weighted means by cell, a row for each cell of dT/dt; `otherwise` where a cell has none."""
    n = cells[0] * cells[1]
    total = np.bincount(cell, weight, n)
    mean = np.bincount(cell, weight * values, n) / np.where(total > 0.0, total, 1.0)
    return np.asarray(np.where(total > 0.0, mean, otherwise.reshape(-1)).reshape(cells[::-1]))


def _index(x: FloatArray, span: tuple[float, float], n: int) -> NDArray[np.int64]:
    width = span[1] - span[0]
    if width <= 0.0:
        return np.zeros(len(x), dtype=np.int64)
    return np.clip(np.floor((x - span[0]) * n / width), 0, n - 1).astype(np.int64)
