"""`RBFNetworkRegressor`: a small Gaussian network as a scikit-learn estimator.

Two inputs (temperature and its rate, in any units) are trained by the default method of `gyrotc.train.methods`, any
other number of inputs by orthogonal least squares: samples as centers, one width, size by BIC. Needs
scikit-learn 1.6 or later (`pip install "gyrotc[sklearn]"`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data

from .. import _core
from ..common.arrays import FloatArray
from .data import Scaling, TrainingData
from .mrbf import fit_mrbf
from .process import MEAN_S

_WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0)  # times the square root of the number of inputs
_CANDIDATES = 300  # samples as centers, drawn at random: bounds time and memory of the normal equations
_MOST_CENTERS = 60  # bounds the time of a fit
_SAMPLES_PER_COLUMN = 5  # at least: with fewer the size is chosen by noise
# Times the number of samples: slight, for candidates that nearly coincide (docs/training.md, section 5)
_RIDGE = 1e-8


@dataclass(frozen=True, slots=True)
class _Network:
    """w0 + linear · z + Σ w exp(−Σ ((z − c)/δ)²) at normalised inputs z."""

    w0: float
    linear: FloatArray
    centers: FloatArray
    widths: FloatArray
    weights: FloatArray

    def __call__(self, z: FloatArray) -> FloatArray:
        value = self.w0 + z @ self.linear
        for center, width, weight in zip(self.centers, self.widths, self.weights, strict=True):
            value = value + weight * np.exp(-np.sum(((z - center) / width) ** 2, axis=1))
        return np.asarray(value)


class RBFNetworkRegressor(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """Regression by few Gaussians with a linear part.

    Args:
        n_centers: Largest number of Gaussians; None: chosen from the data.
        random_state: Draws the candidate centers: an integer, a RandomState or None.

    Attributes (after `fit`):
        centers_: Centers, shape (M, n_features), in the units of X.
        widths_: Widths δ, shape (M, n_features), in units of X.
        weights_: Weights of the Gaussians, shape (M,).
        intercept_: w0 + the linear part at the middle of the inputs.
        coef_: Linear part for each input, shape (n_features,).
        n_features_in_: Number of inputs.
    """

    def __init__(self, n_centers: int | None = None, random_state: Any = 0) -> None:
        self.n_centers = n_centers
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: ArrayLike) -> RBFNetworkRegressor:
        """Train on X of shape (n, n_features) and y of shape (n,); raises ValueError for bad input."""
        checked = validate_data(self, X, y, dtype=np.float64, y_numeric=True, ensure_min_samples=2)
        inputs: FloatArray = checked[0]
        target: FloatArray = checked[1].astype(np.float64)
        if self.n_centers is not None and self.n_centers < 0:
            raise ValueError(f"n_centers is {self.n_centers}; expected 0 or more, or None")
        random = check_random_state(self.random_state)
        low, high = inputs.min(axis=0), inputs.max(axis=0)
        self._middle = 0.5 * (high + low)
        self._half = np.where(high > low, 0.5 * (high - low), 1.0)
        z = (inputs - self._middle) / self._half
        seed = int(random.randint(2**31 - 1))
        train = _two_inputs if z.shape[1] == 2 else _any_inputs
        self._network = train(z, target, seed, self.n_centers)
        self.centers_ = self._network.centers * self._half + self._middle
        self.widths_ = self._network.widths * self._half
        self.weights_ = self._network.weights
        self.coef_ = self._network.linear / self._half
        self.intercept_ = self._network.w0
        return self

    def predict(self, X: ArrayLike) -> FloatArray:
        """Values at X of shape (n, n_features); inputs are clamped to their range in training."""
        check_is_fitted(self)
        inputs: FloatArray = validate_data(self, X, dtype=np.float64, reset=False)
        return self._network(np.clip((inputs - self._middle) / self._half, -1.0, 1.0))


def _two_inputs(z: FloatArray, y: FloatArray, seed: int, n_centers: int | None) -> _Network:
    """The default method; samples count as means that are long enough."""
    order = np.lexsort((y, z[:, 1], z[:, 0]))
    t, r, n = z[order, 0], z[order, 1], len(y)
    data = TrainingData(
        temperature_c=t,
        slope_c_per_min=r,
        bias_dph=y[order],
        weight=np.ones(n),
        run=np.zeros(n, dtype=np.int64),
        time_s=np.arange(n, dtype=np.float64) * MEAN_S,
        duration_s=np.full(n, MEAN_S),
    )
    scaling = Scaling(0.0, 1.0, 1.0, (-1.0, 1.0), (-1.0, 1.0))
    found = fit_mrbf(data, scaling, seed=seed, centers=n_centers, average_s=MEAN_S).networks[0]
    return _Network(
        w0=found["w0"],
        linear=np.array(found["linear"]),
        centers=np.reshape(found["centers"], (-1, 2)),
        widths=np.reshape(found["widths"], (-1, 2)),
        weights=np.array(found["weights"]),
    )


def _any_inputs(z: FloatArray, y: FloatArray, seed: int, n_centers: int | None) -> _Network:
    """Orthogonal least squares: constant, linear part, then Gaussians at samples; width and size by BIC."""
    n, d = z.shape
    places = np.unique(z, axis=0)
    places = places[np.random.default_rng(seed).permutation(len(places))[:_CANDIDATES]]
    limit = min(_MOST_CENTERS, max(0, n // _SAMPLES_PER_COLUMN - d - 1)) if n_centers is None else n_centers
    base = np.concatenate([np.ones((n, 1)), z], axis=1)
    distance = np.sum((z[:, None, :] - places[None, :, :]) ** 2, axis=2)
    best_score, best_chosen, best_width = np.inf, np.zeros(0, dtype=np.int64), 1.0
    for width in np.array(_WIDTHS) * np.sqrt(d):
        columns = np.concatenate([base, np.exp(-distance / width**2)], axis=1)
        path = _core.select_columns(_core.DenseColumns(columns, y), 1 + d + limit, given=1 + d)
        size = np.arange(1, len(path.chosen) + 1)
        floor = np.finfo(np.float64).eps * max(float(y @ y), np.finfo(np.float64).tiny)
        bic = n * np.log(np.maximum(path.rest, floor)) + size * np.log(n)
        at = int(np.argmin(bic)) if n_centers is None else len(size) - 1
        if bic[at] < best_score:
            chosen = np.array(path.chosen[: at + 1], dtype=np.int64)
            best_score, best_chosen, best_width = float(bic[at]), chosen[chosen > d] - d - 1, float(width)
    return _solved(z, y, base, places[best_chosen], best_width)


def _solved(z: FloatArray, y: FloatArray, base: FloatArray, centers: FloatArray, width: float) -> _Network:
    """Weights by least squares with a slight ridge on everything but the constant."""
    n, d = z.shape
    gaussians = np.exp(-np.sum((z[:, None, :] - centers[None, :, :]) ** 2, axis=2) / width**2)
    columns = np.concatenate([base, gaussians], axis=1)
    ridge = np.sqrt(_RIDGE * n) * np.eye(columns.shape[1])[1:]
    stacked = np.concatenate([columns, ridge])
    weights = np.linalg.lstsq(stacked, np.concatenate([y, np.zeros(len(ridge))]), rcond=None)[0]
    return _Network(float(weights[0]), weights[1 : d + 1], centers, np.full(centers.shape, width), weights[d + 1 :])
