"""1 σ of the compensated bias over the envelope, and where training data was.

What the map may be wrong by at (T, dT/dt), noise of the gyro not included:

    σ² = κ² variance of the evidence process + (map − mean of the process)² + τ²

κ and τ come from runs left out in turn: the squares of the mean residuals that the process has there are
explained by its own variance (factor κ² ≥ 1: it may be too sure), by a variance between runs (τ²), and by
noise. κ = 1 and τ = 0 unless the runs left out speak against it (likelihood ratio, 5 %).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.special import chdtri

from .data import TrainingData, cleaned
from .process import Process, fit_process
from .result import Fit, predict

__all__ = ["coverage", "uncertainty"]

Floats = NDArray[np.float64]

_POINTS = 3  # in each direction of a cell
_SPANS = 5  # a single run is cut into so many
_PATCHES = (12, 8)  # over which residuals of a run left out are averaged
_ROUNDS = 5  # of weighting anew by what was found; chosen, not derived
_SIGNIFICANT = float(chdtri(2, 0.05))  # κ² and τ² are two parameters: chi-square with two degrees of freedom


def coverage(data: TrainingData, fit: Fit, cells: tuple[int, int] = (32, 12)) -> dict[str, Any]:
    """`coverage` of `model.json`: cells of the envelope (T, dT/dt) that hold training samples."""
    t = _index(data.temperature_c, fit.scaling.temperature_c, cells[0])
    r = _index(data.slope_c_per_min, fit.scaling.slope_c_per_min, cells[1])
    seen = np.zeros(cells[::-1], dtype=bool)
    seen[r, t] = True
    return {"cells": list(cells), "rows": ["".join("1" if x else "0" for x in row) for row in seen]}


def uncertainty(data: TrainingData, fit: Fit, cells: tuple[int, int] = (12, 8)) -> dict[str, Any]:
    """`uncertainty_dph` of `model.json`: 1 σ over cells of the envelope, deg/h.

    Args:
        data: The samples that `fit` has seen.
        fit: The trained map.
        cells: Number of cells of T and of dT/dt.
    """
    samples = cleaned(data)
    process = fit.outcome.process or fit_process(samples, fit.scaling)
    t, r = _points(fit, cells)
    scale, between = _calibrated(samples, process, fit)
    departure = predict(fit, t, r) - process.mean_dph(*fit.scaling.normalise(t, r))
    variance = scale * process.variance_dph2(*fit.scaling.normalise(t, r)) + departure**2 + between
    mean = variance.reshape(cells[1], cells[0], -1).mean(axis=2)
    return {"cells": list(cells), "rows": np.sqrt(mean).tolist()}


def _index(x: Floats, span: tuple[float, float], n: int) -> NDArray[np.int64]:
    width = span[1] - span[0]
    if width <= 0.0:
        return np.zeros(len(x), dtype=np.int64)
    return np.clip(np.floor((x - span[0]) * n / width), 0, n - 1).astype(np.int64)


def _points(fit: Fit, cells: tuple[int, int]) -> tuple[Floats, Floats]:
    """Points of the cells, cell by cell, T running fastest over the cells."""

    def inner(span: tuple[float, float], n: int) -> Floats:
        edges = np.linspace(*span, n + 1)
        share = (np.arange(_POINTS) + 0.5) / _POINTS
        return np.asarray(edges[:-1, None] + share * np.diff(edges)[:, None])

    t = inner(fit.scaling.temperature_c, cells[0])
    r = inner(fit.scaling.slope_c_per_min, cells[1])
    shape = (cells[1], cells[0], _POINTS, _POINTS)
    return (
        np.broadcast_to(t[None, :, None, :], shape).reshape(-1),
        np.broadcast_to(r[:, None, :, None], shape).reshape(-1),
    )


def _parts(samples: TrainingData) -> NDArray[np.int64]:
    """What is left out together: runs, or five spans of a single run."""
    runs, index = np.unique(samples.run, return_inverse=True)
    if len(runs) > 1:
        return np.asarray(index, dtype=np.int64)
    return np.arange(len(samples)) * _SPANS // len(samples)


def _calibrated(samples: TrainingData, whole: Process, fit: Fit) -> tuple[float, float]:
    """(κ², τ² in (deg/h)²) from parts left out in turn; (1, 0) where that cannot be done."""
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
    scale, between = 1.0, 0.0
    for _ in range(_ROUNDS):
        root = 1.0 / (scale * variance + between + noise)
        columns = np.stack([variance, np.ones_like(variance)], axis=1) * root[:, None]
        (scale, between), _ = nnls(columns, (squares - noise) * root)
        scale = max(float(scale), 1.0)
    plain = _deviance(squares, variance + noise)
    better = _deviance(squares, scale * variance + between + noise)
    return (scale, float(between)) if plain - better > _SIGNIFICANT else (1.0, 0.0)


def _deviance(squares: Floats, variance: Floats) -> float:
    """−2 log likelihood of squared normal deviations, up to a constant."""
    return float(np.sum(squares / variance + np.log(variance)))


def _surprises(process: Process, held: TrainingData, fit: Fit) -> Floats:
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
