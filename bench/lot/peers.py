"""Beside a lot: simple ways to use one, the most that a test could see."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .new_units import Exam
from gyrotc.train import TrainingData, cleaned_samples, fit_process, scaling_of
from gyrotc.train.prior import FALSE_ALARM, LotPrior, UnitMeans, means_of_unit, sums_of
from scipy.stats import norm

Floats = NDArray[np.float64]
_CELL_C, _CELL_C_PER_MIN = 2.0, 0.2
_EXPLAINED = 0.99  # of the variance between units: the usual choice of components
_MOST = 400  # cells that a process of scikit-learn is fitted to
_KNOWN: dict[int, Any] = {}


def peers(taught: Sequence[UnitMeans], unit: UnitMeans, exam: Exam) -> dict[str, Callable[[], Floats]]:
    """Predictions at the exam's inputs, deg/h, by the name of the way."""
    if id(taught) not in _KNOWN:
        _KNOWN.clear()
        _KNOWN[id(taught)] = _Pooled(taught)
    pooled = _KNOWN[id(taught)]
    there = np.stack([exam.temperature_c, exam.slope_c_per_min], axis=1)
    return {
        "mean curve + offset": lambda: pooled.offset(unit, there),
        "PCA regression": lambda: pooled.components(unit, there),
        "pooled GPR": lambda: pooled.process(unit, there),
    }


class _Pooled:
    """Maps of all units on cells that nearly all of them have visited."""

    def __init__(self, units: Sequence[UnitMeans]) -> None:
        from scipy.interpolate import NearestNDInterpolator

        cells = [_cells(u) for u in units]
        seen, times = np.unique(np.concatenate([c for c, _ in cells]), axis=0, return_counts=True)
        self.places = seen[times >= 0.9 * len(units)]
        maps = np.full((len(units), len(self.places)), np.nan)
        for k, (cell, value) in enumerate(cells):
            index = {tuple(c): v for c, v in zip(cell, value, strict=True)}
            maps[k] = [index.get(tuple(p), np.nan) for p in self.places]
        self.mean = np.nanmean(maps, axis=0)
        filled = np.where(np.isnan(maps), self.mean, maps) - self.mean
        _, size, self.axes = np.linalg.svd(filled, full_matrices=False)
        share = np.cumsum(size**2) / np.sum(size**2)
        self.rank = int(np.argmax(share >= _EXPLAINED)) + 1
        self.variance = size**2 / len(units)
        self.at = self.places * (_CELL_C, _CELL_C_PER_MIN)
        scaled = self.at / (_CELL_C, _CELL_C_PER_MIN)
        self._nearest = NearestNDInterpolator(scaled, np.arange(len(scaled)))

    def nearest(self, there: Floats) -> NDArray[np.int64]:
        return np.asarray(self._nearest(there / (_CELL_C, _CELL_C_PER_MIN)), dtype=np.int64)

    def offset(self, unit: UnitMeans, there: Floats) -> Floats:
        left = unit.bias_dph - self.mean[self.nearest(_inputs(unit))]
        return np.asarray(self.mean[self.nearest(there)] + np.average(left, weights=unit.count))

    def components(self, unit: UnitMeans, there: Floats) -> Floats:
        """Scores by ridge: what a component varies by against the noise."""
        axes = self.axes[: self.rank].T
        index = self.nearest(_inputs(unit))
        weight = unit.count / unit.sigma_dph**2
        a = axes[index]
        gram = (a * weight[:, None]).T @ a + np.diag(1.0 / self.variance[: self.rank])
        score = np.linalg.solve(gram, a.T @ (weight * (unit.bias_dph - self.mean[index])))
        k = self.nearest(there)
        return np.asarray(self.mean[k] + axes[k] @ score)

    def process(self, unit: UnitMeans, there: Floats) -> Floats:
        """The mean map by a process of all units, and what the unit leaves of it by one of its own."""
        low = _gpr(self.at, self.mean, None)
        known = _inputs(unit)
        left = unit.bias_dph - low(known)
        own = _gpr(known, left, unit.sigma_dph**2 / unit.count)
        return np.asarray(low(there) + own(there))


def _gpr(x: Floats, y: Floats, noise: Floats | None) -> Callable[[Floats], Floats]:
    """scikit-learn's process, anisotropic, its parameters by its own search."""
    return _fitted(x.tobytes(), y.tobytes(), None if noise is None else noise.tobytes())


@lru_cache(maxsize=4)
def _fitted(x: bytes, y: bytes, noise: bytes | None) -> Callable[[Floats], Floats]:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    inputs = np.frombuffer(x).reshape(-1, 2) / (50.0, 2.5)
    values = np.frombuffer(y)
    step = max(1, len(values) // _MOST)
    center, unit = float(values.mean()), float(values.std()) or 1.0
    kernel = ConstantKernel(1.0) * RBF([0.5, 0.5], (0.05, 10.0))
    alpha: Any = 1e-8
    if noise is None:
        kernel = kernel + WhiteKernel(1e-2, (1e-6, 1.0))
    else:
        alpha = np.frombuffer(noise)[::step] / unit**2
    found = GaussianProcessRegressor(kernel, alpha=alpha).fit(inputs[::step], (values[::step] - center) / unit)

    def predicted(there: Floats) -> Floats:
        cell, index = np.unique(np.round(there / (0.5, 0.05)), axis=0, return_inverse=True)
        return np.asarray(center + unit * found.predict(cell * (0.5, 0.05) / (50.0, 2.5)))[index.ravel()]

    return predicted


def _inputs(unit: UnitMeans) -> Floats:
    return np.stack([unit.temperature_c, unit.slope_c_per_min], axis=1)


def _cells(unit: UnitMeans) -> tuple[Floats, Floats]:
    """Cells that a unit visited and its mean bias there."""
    cell = np.round(_inputs(unit) / (_CELL_C, _CELL_C_PER_MIN))
    found, index = np.unique(cell, axis=0, return_inverse=True)
    weight = np.bincount(index.ravel(), unit.count)
    return found, np.asarray(np.bincount(index.ravel(), unit.count * unit.bias_dph) / weight)


def seen(data: TrainingData) -> UnitMeans:
    """Means of samples, as a fit has them."""
    samples = cleaned_samples(data)
    scaling = scaling_of(samples)
    power_on = np.arange(int(samples.run.max()) + 1)
    return means_of_unit(samples, scaling, fit_process(samples, scaling, power_on), power_on)[0]


def best_power(prior: LotPrior, short: UnitMeans, whole: UnitMeans) -> float:
    """Probability that a test which knows a foreign unit's map refuses it from its short run (Neyman and Pearson).

    Args:
        prior: The lot.
        short: Means of the short run.
        whole: Means of all runs, which tell the map.
    """
    known = prior.with_runs(whole)
    precision = sums_of([short], prior.basis, prior.center_dph, prior.unit_dph, prior.own).precision[0]
    powers = []
    for mean, covariance in zip(prior.means, prior.covariances, strict=True):
        away = known.mean - mean
        reported = precision - precision @ np.linalg.inv(np.linalg.inv(covariance) + precision) @ precision
        distance = float(np.sqrt(max(away @ reported @ away, 0.0)))
        powers.append(float(norm.sf(norm.isf(FALSE_ALARM) - distance)))
    return min(powers)
