"""Whole methods on one gyro: block means in, a map out; gyrotc's and what one would take from a shelf.

Peers get 100-s means with standardised inputs and target, in the form their documentation gives for such data.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
from gyrotc.train.data import TrainingData
from gyrotc.train.methods import fit
from gyrotc.train.result import predict
from numpy.typing import NDArray

from .problems import Predictor, means

__all__ = ["CONTESTANTS", "Learner"]

Floats = NDArray[np.float64]
Learner = Callable[
    [TrainingData], tuple[Predictor, int]
]  # the map and the bytes of its numbers as 32-bit words


def _gyrotc(method: str) -> Learner:
    def learn(data: TrainingData) -> tuple[Predictor, int]:
        found = fit(data, method=method)
        return lambda t, r: predict(found, t, r), found.table_bytes

    return learn


def _standardised(
    data: TrainingData,
) -> tuple[Floats, Floats, Callable[[Callable[[Floats], Floats]], Predictor]]:
    """Inputs and target of the peers, and what turns their prediction into deg/h."""
    t, r, y = means(data)
    x = np.stack([t, r], axis=1)
    middle, scale, center, spread = x.mean(axis=0), x.std(axis=0), y.mean(), y.std()

    def back(model: Callable[[Floats], Floats]) -> Predictor:
        return lambda t, r: center + spread * model((np.stack([t, r], axis=1) - middle) / scale)

    return (x - middle) / scale, (y - center) / spread, back


def _gpr(data: TrainingData) -> tuple[Predictor, int]:
    """Gaussian process with a width for each input and white noise, by evidence."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    x, y, back = _standardised(data)
    model = GaussianProcessRegressor(ConstantKernel() * RBF([1.0, 1.0]) + WhiteKernel())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(x, y)
    return back(model.predict), 12 * len(y)


def _svr(data: TrainingData) -> tuple[Predictor, int]:
    from sklearn.svm import SVR

    x, y, back = _standardised(data)
    model = SVR(kernel="rbf").fit(x, y)
    return back(model.predict), 12 * len(model.support_)


def _mlp(data: TrainingData) -> tuple[Predictor, int]:
    """One hidden layer of 16, L-BFGS as its documentation advises for small data."""
    from sklearn.neural_network import MLPRegressor

    x, y, back = _standardised(data)
    model = MLPRegressor(
        hidden_layer_sizes=(16,), activation="tanh", solver="lbfgs", alpha=1e-3, max_iter=2000, random_state=0
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(x, y)
    return back(model.predict), 4 * sum(w.size for w in [*model.coefs_, *model.intercepts_])


def _poly5(data: TrainingData) -> tuple[Predictor, int]:
    """All products of powers up to the fifth order, ridge chosen by leave-one-out."""
    from sklearn.linear_model import RidgeCV
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures

    x, y, back = _standardised(data)
    model = make_pipeline(PolynomialFeatures(5), RidgeCV(np.logspace(-6, 2, 9))).fit(x, y)
    return back(model.predict), 4 * 21


CONTESTANTS: dict[str, Learner] = {
    "gyrotc mrbf (default)": _gyrotc("mrbf"),
    "gyrotc rbf_ols": _gyrotc("rbf_ols"),
    "gyrotc bank": _gyrotc("bank"),
    "paper: mrbf_paper": _gyrotc("mrbf_paper"),
    "paper: rbf_random": _gyrotc("rbf_random"),
    "paper: mlr": _gyrotc("mlr"),
    "polynomial in T": _gyrotc("poly"),
    "polynomial in T and dT/dt, by BIC": _gyrotc("poly_slope"),
    "polynomial of order 5": _poly5,
    "scikit-learn GPR": _gpr,
    "scikit-learn SVR": _svr,
    "scikit-learn MLP, 16": _mlp,
}
