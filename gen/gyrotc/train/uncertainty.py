"""1 σ of the compensated bias over the envelope, and where training data was.

What the map may be wrong by at (T, dT/dt), noise of the gyro not included:

    σ² = κ² variance of the evidence process + (map − mean of the process)² + τ²

κ and τ come from runs left out in turn: the squares of the mean residuals that the process has there are explained by
its own variance (factor κ²), by a variance between runs (τ²), and by noise. ln κ² is known beforehand to 0.3: over
many gyros the process is right about itself, and six runs say little of it. τ = 0 unless the runs left out speak
against it (likelihood ratio, 5 %); of few runs it is what the next one may differ by (Student's t).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ..common.arrays import FloatArray
from .data import TrainingData, cleaned
from .evidence import Process, fit_process
from .result import Fit, predict
from .rules import Known, rules_of

__all__ = ["coverage", "of_few", "uncertainty"]


_POINTS = (96, 36)  # of T and of dT/dt, three times the cells of the coverage
_SPANS = 5  # a single run is cut into so many
_PATCHES = (12, 8)  # over which residuals of a run left out are averaged
_SCALES = np.exp(np.linspace(np.log(0.5), np.log(8.0), 41))  # of κ², which its prior keeps within
_NOISES = np.exp(
    np.linspace(np.log(0.7), np.log(4.0), 12)
)  # of its variance over a patch, beside white noise
_SCALE_SD = 0.3  # of ln κ²: what the evidence says of its own scale is known to so much
_LEVELS = np.exp(np.linspace(np.log(1e-4), np.log(1e5), 61))  # of τ², over the mean variance of a patch
_SIGNIFICANT = float(chdtri(2, 0.05))  # a level and a run that differs most: two degrees of freedom


def coverage(data: TrainingData, fit: Fit, cells: tuple[int, int] = (32, 12)) -> dict[str, Any]:
    """`coverage` of `model.json`: cells of the envelope (T, dT/dt) that hold training samples, its own or a lot's."""
    t = _index(data.temperature_c, fit.scaling.temperature_c, cells[0])
    r = _index(data.slope_c_per_min, fit.scaling.slope_c_per_min, cells[1])
    seen = np.zeros(cells[::-1], dtype=bool)
    seen[r, t] = True
    if fit.outcome.process and (asked := fit.outcome.process.asked):
        r = _index(asked.slope_c_per_min, fit.scaling.slope_c_per_min, cells[1])
        seen[r, _index(asked.temperature_c, fit.scaling.temperature_c, cells[0])] = True
    return {"cells": list(cells), "rows": ["".join("1" if x else "0" for x in row) for row in seen]}


def uncertainty(
    data: TrainingData,
    fit: Fit,
    cells: tuple[int, int] = (8, 5),
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
        added: What terms add to the map at each sample, deg/h; the samples are in order then.
    """
    samples = cleaned(data)
    process = fit.outcome.process or fit_process(samples, fit.scaling)
    scale, between = _calibrated(samples, process, fit)
    at_samples = _variance(process, fit, samples.temperature_c, samples.slope_c_per_min, scale)
    t, r = _points(fit)
    at_points = _variance(process, fit, t, r, scale)
    covered = _covered(data, fit, t, r)
    place = _cell(fit, cells, t, r)
    everywhere = _means(place, at_points, np.ones(len(t)), cells, np.zeros(cells[::-1]))
    seen = _means(*_asked(samples, process, fit, cells, scale, at_samples), cells, everywhere)
    unseen = _means(place, at_points, (~covered).astype(np.float64), cells, everywhere)
    points = t[covered], r[covered]
    added = added if np.size(added) in (1, len(samples)) else 0.0  # duplicates were dropped
    known = Known(samples, fit, process, np.sqrt(at_samples), float(np.sqrt(between)), points, added)
    return {
        "cells": list(cells),
        "rows": np.sqrt(seen + between).tolist(),
        "uncovered": np.sqrt(unseen + between).tolist(),
        "rules": rules_of(known, block_s),
    }


def _asked(
    samples: TrainingData,
    process: Process,
    fit: Fit,
    cells: tuple[int, int],
    scale: float,
    at_samples: FloatArray,
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Where corrections are asked for, as the samples or a lot's units show: cells, variances, weights."""
    asked = process.asked
    if asked is None:
        return _cell(fit, cells, samples.temperature_c, samples.slope_c_per_min), at_samples, samples.weight
    t, r = asked.temperature_c, asked.slope_c_per_min
    return _cell(fit, cells, t, r), _variance(process, fit, t, r, scale), asked.share


def _variance(process: Process, fit: Fit, t: FloatArray, r: FloatArray, scale: float) -> FloatArray:
    """Variance of the map at points, (deg/h)², without that from power-on to power-on."""
    z = fit.scaling.normalise(t, r)
    return scale * process.variance_dph2(*z) + (predict(fit, t, r) - process.mean_dph(*z)) ** 2


def _points(fit: Fit) -> tuple[FloatArray, FloatArray]:
    """A fine grid of points over the envelope, C and C/min."""

    def inner(span: tuple[float, float], n: int) -> FloatArray:
        return np.asarray(span[0] + (np.arange(n) + 0.5) / n * (span[1] - span[0]))

    t, r = np.meshgrid(
        inner(fit.scaling.temperature_c, _POINTS[0]), inner(fit.scaling.slope_c_per_min, _POINTS[1])
    )
    return t.reshape(-1), r.reshape(-1)


def _covered(data: TrainingData, fit: Fit, t: FloatArray, r: FloatArray) -> NDArray[np.bool_]:
    """Whether points lie in cells of the coverage that hold training samples."""
    rows = coverage(data, fit)["rows"]
    seen = np.array([[c == "1" for c in row] for row in rows]).reshape(-1)
    return np.asarray(seen[_cell(fit, (len(rows[0]), len(rows)), t, r)])


def _cell(fit: Fit, cells: tuple[int, int], t: FloatArray, r: FloatArray) -> NDArray[np.int64]:
    """Number of the cell of each point, T fastest."""
    of_t = _index(t, fit.scaling.temperature_c, cells[0])
    return of_t + cells[0] * _index(r, fit.scaling.slope_c_per_min, cells[1])


def _means(
    cell: NDArray[np.int64],
    values: FloatArray,
    weight: FloatArray,
    cells: tuple[int, int],
    otherwise: FloatArray,
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


def _parts(samples: TrainingData) -> NDArray[np.int64]:
    """What is left out together: runs, or five spans of a single run."""
    runs, index = np.unique(samples.run, return_inverse=True)
    if len(runs) > 1:
        return np.asarray(index, dtype=np.int64)
    return np.arange(len(samples)) * _SPANS // len(samples)


def _calibrated(samples: TrainingData, whole: Process, fit: Fit) -> tuple[float, float]:
    """(κ², τ² in (deg/h)²) from parts left out in turn; (1, 0) where that cannot be done. A lot brings its own."""
    if whole.asked is not None:
        return 1.0, whole.asked.between_dph**2
    parts = _parts(samples)
    rows = []
    for k in range(int(parts.max()) + 1):
        rest = samples.select(parts != k)
        if len(rest) > len(samples) // 10:
            process = fit_process(rest, fit.scaling, like=whole)
            rows.append(_surprises(process, samples.select(parts == k), fit))
    if not rows:
        return 1.0, 0.0
    squares, variance, noise = np.concatenate(rows, axis=1)
    plain, scale = _likeliest(squares, variance, noise, 0.0)
    best, its_scale, between = np.inf, scale, 0.0
    for level in float(np.mean(variance + noise)) * _LEVELS:
        if _least_deviance(squares, level) <= best:
            found = (*_likeliest(squares, variance, noise, level), level)
            best, its_scale, between = min((best, its_scale, between), found)
    if plain - best <= _SIGNIFICANT:
        return scale, 0.0
    return its_scale, float(between) * of_few(len(rows))


def _least_deviance(squares: FloatArray, between: float) -> float:
    """What no deviance lies below for a variance between runs: a square is best explained by itself, or by that."""
    total = np.maximum(squares, between)
    return float(np.sum(squares / total + np.log(total)))


def _likeliest(
    squares: FloatArray, variance: FloatArray, noise: FloatArray, between: float
) -> tuple[float, float]:
    """Least deviance and its κ² for a variance between runs.

    Means over a patch keep more of the noise than white noise would leave: its level is free, else κ² takes the rest.
    """
    total = (_SCALES[:, None] * variance) + (between + _NOISES[:, None] * noise)[:, None]
    deviance = np.sum(squares / total + np.log(total), axis=2) + (np.log(_SCALES) / _SCALE_SD) ** 2
    level, k = np.unravel_index(np.argmin(deviance), deviance.shape)
    return float(deviance[level, k]), float(_SCALES[k])


def of_few(runs: int) -> float:
    """Variance of the next run over that of so many: of Student's t with a degree of freedom less than runs."""
    return (runs - 1.0) / max(runs - 3.0, 1.0)


def _surprises(process: Process, held: TrainingData, fit: Fit) -> FloatArray:
    """Of patches of the input plane: squared mean residual, variance of the process, variance by noise."""
    patch = _index(held.temperature_c, fit.scaling.temperature_c, _PATCHES[0])
    patch = patch + _PATCHES[0] * _index(held.slope_c_per_min, fit.scaling.slope_c_per_min, _PATCHES[1])
    _, index = np.unique(patch, return_inverse=True)
    weight = np.bincount(index, held.weight)
    t, r = fit.scaling.normalise(held.temperature_c, held.slope_c_per_min)
    residual = np.bincount(index, held.weight * (held.bias_dph - process.mean_dph(t, r))) / weight
    center_t = np.bincount(index, held.weight * t) / weight
    center_r = np.bincount(index, held.weight * r) / weight
    seconds = np.bincount(index, held.duration_s)
    noise = process.noise_dph**2 * process.seconds / seconds
    return np.stack([residual**2, process.variance_dph2(center_t, center_r), noise])
