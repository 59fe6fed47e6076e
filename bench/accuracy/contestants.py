"""Methods that are compared, and what they are compared on: simulated gyros, clouds of samples of any size.

Orthogonal least squares over the same candidates and widths, one thread each; whole methods on one gyro, block means in
and a map out (peers get 100-s means with standardised inputs); the Kohonen network and variable projection alone.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from gyrotc import _core
from gyrotc.recordings import load
from gyrotc.simulate import read_truth, simulate
from gyrotc.train import TrainingData, average_samples, fit, front_end, predict, samples_of
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Predictor = Callable[[Floats, Floats], Floats]

BLOCK_S = 10.0
AVERAGE_S = 100.0


@dataclass(frozen=True, slots=True)
class Gyro:
    """A simulated gyro: blocks of set 1, blocks of set 2 by run, noise of the 100-s means of set 2 by run."""

    train: tuple[TrainingData, ...]
    exam: tuple[TrainingData, ...]
    noise: tuple[Floats, ...]


@lru_cache(maxsize=40)
def gyro(scenario: str, seed: int) -> Gyro:
    """Simulates a scenario and passes it through the front end."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "data"
        simulate(scenario, seed=seed, out=folder)
        dataset, truth = load(folder), read_truth(folder)
        assert truth is not None
        front = front_end(dataset.runs, BLOCK_S)
        parts = [samples_of(front.blocks(run), front.block_s, k) for k, run in enumerate(dataset.runs)]
        roles = [run.role for run in dataset.runs]
        noise = tuple(truth.mean_noise_dph(r.file, AVERAGE_S) for r in dataset.runs if r.role == "exam")
    train = tuple(p for p, role in zip(parts, roles, strict=True) if role == "train")
    exam = tuple(p for p, role in zip(parts, roles, strict=True) if role == "exam")
    return Gyro(train, exam, noise)


def means(data: TrainingData) -> tuple[Floats, Floats, Floats]:
    """Temperature, its rate and bias of 100-s means: what the peers are trained on."""
    m = average_samples(data, AVERAGE_S)
    return m.temperature_c, m.slope_c_per_min, m.bias_dph


def ratio(predict: Predictor, unit: Gyro, runs: Sequence[int] | None = None) -> float:
    """Exam RMS of compensated 100-s means over the RMS of the noise that was really added."""
    squares, noise = 0.0, 0.0
    for k in range(len(unit.exam)) if runs is None else runs:
        s = unit.exam[k]
        after = s.bias_dph - predict(s.temperature_c, s.slope_c_per_min)
        per = round(AVERAGE_S / BLOCK_S)
        residual = after[: len(after) // per * per].reshape(-1, per).mean(axis=1)
        squares += float(residual @ residual)
        noise += float(unit.noise[k] @ unit.noise[k])
    return float(np.sqrt(squares / noise))


def cloud(n: int) -> tuple[Floats, Floats, Floats]:
    """n samples at normalised inputs, distributed as the paper's: half in holds, half on ramps; a smooth map, noise."""
    rng = np.random.default_rng(n)
    half = n // 2
    t = np.concatenate(
        [rng.choice([-0.95, 0.2, 0.95], half) + rng.normal(0.0, 0.01, half), rng.uniform(-1, 1, n - half)]
    )
    r = np.concatenate([rng.normal(0.0, 0.01, half), rng.choice([-1.0, -0.6, -0.2, 0.2, 0.6, 1.0], n - half)])
    t, r = np.clip(t, -1.0, 1.0), np.clip(r + rng.normal(0.0, 0.01, n), -1.0, 1.0)
    y = np.sin(3.0 * t) / (1.5 + t * t) + 0.3 * r * np.exp(t) / (1.0 + r * r) + rng.normal(0.0, 0.5, n)
    return t, r, y


Task = tuple[Floats, Floats, Floats, tuple[int, int], Sequence[float], int]  # t, r, y, grid, widths, centers


def grid_of(shape: tuple[int, int]) -> Floats:
    """Centers of a regular grid over the normalised inputs, one row each."""
    t, r = np.meshgrid(np.linspace(-1, 1, shape[0]), np.linspace(-1, 1, shape[1]), indexing="ij")
    return np.stack([t.ravel(), r.ravel()], axis=1)


def dictionary(t: Floats, r: Floats, centers: Floats, width: float) -> Floats:
    """Constant and Gaussians as columns; the exponentials of both axes are made once each."""
    a = np.exp(-(((t[:, None] - np.unique(centers[:, 0])) / width) ** 2))
    b = np.exp(-(((r[:, None] - np.unique(centers[:, 1])) / width) ** 2))
    columns = np.empty((len(t), 1 + len(centers)))
    columns[:, 0] = 1.0
    np.multiply(a[:, :, None], b[:, None, :], out=columns[:, 1:].reshape(len(t), a.shape[1], b.shape[1]))
    return columns


def _least(rest_by_width: Sequence[Floats], n: int) -> tuple[float, float, tuple[int, int]]:
    """(least BIC, residual sum of squares there, (width, size − 1)); rest: sums for 1, 2, ... columns."""
    return min(
        (float(n * np.log(rest[k] / n) + (k + 1) * np.log(n)), float(rest[k]), (i, k))
        for i, rest in enumerate(rest_by_width)
        for k in range(len(rest))
    )


def _best(rest_by_width: Sequence[Floats], n: int) -> float:
    """Residual RMS at the least BIC over widths and sizes."""
    return float(np.sqrt(_least(rest_by_width, n)[1] / n))


def _along(columns: Floats, y: Floats, chosen: Sequence[int]) -> Floats:
    """Residual sums of squares of the chosen columns, 1, 2, ... of them."""
    q = np.linalg.qr(columns[:, list(chosen)])[0]
    return np.asarray(np.maximum(y @ y - np.cumsum((q.T @ y) ** 2), 1e-300))


def _gyrotc(task: Task, make: Callable[[float], _core.EqualGaussians]) -> float:
    t, r, y, _, widths, centers = task
    samples = _core.Samples(t, r, y, np.ones(len(y)))
    paths = []
    for width in widths:
        dictionary = make(width)
        dictionary.add(samples)
        paths.append((dictionary, _core.select_columns(dictionary, centers + 1)))
    bic, _, best = _least([path.rest for _, path in paths], len(y))
    dictionary, path = paths[best[0]]
    places = dictionary.centers[np.array(path.chosen[1 : best[1] + 1], dtype=np.int64) - 1]
    gaussians = np.concatenate([places, np.full((len(places), 2), widths[best[0]])], axis=1)
    weights = _core.least_squares(samples, gaussians, 1e-8 * len(y))
    assert np.isfinite(weights).all() and np.isfinite(bic)
    return float(np.sqrt(path.rest[best[1]] / len(y)))


def _gyrotc_grid(task: Task) -> float:
    n_t, n_r = task[3]
    return _gyrotc(
        task,
        lambda w: _core.EqualGaussians.on_grid(-1.0, 2.0 / (n_t - 1), n_t, -1.0, 2.0 / (n_r - 1), n_r, w, w),
    )


def _gyrotc_any(task: Task) -> float:
    """The same candidates, given as a list: nothing of the grid is used."""
    centers = grid_of(task[3])
    return _gyrotc(task, lambda w: _core.EqualGaussians.at(centers, w, w))


def _omp(task: Task) -> float:
    """scikit-learn: orthogonal matching pursuit on the precomputed Gram of normalised columns, the whole path."""
    from sklearn.linear_model import orthogonal_mp_gram

    t, r, y, shape, widths, centers = task
    rest = []
    for width in widths:
        columns = dictionary(t, r, grid_of(shape), width)
        norms = np.sqrt(np.einsum("ij,ij->j", columns, columns))
        norms[norms == 0.0] = 1.0
        columns /= norms
        gram, moments = columns.T @ columns, columns.T @ y
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            weights = orthogonal_mp_gram(gram, moments, n_nonzero_coefs=centers + 1)
        rest.append(_along(columns, y, np.flatnonzero(weights).tolist())[-1:])
    return float(np.sqrt(min(float(x[0]) for x in rest) / len(y)))


def _fastcan(task: Task) -> float:
    """fastcan: sum of squared correlations (its eta-cosine form was no faster here and took twice the memory)."""
    from fastcan import FastCan

    t, r, y, shape, widths, centers = task
    rest = []
    for width in widths:
        columns = dictionary(t, r, grid_of(shape), width)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = FastCan(centers, tol=1e-5, verbose=0).fit(columns[:, 1:], y)
        rest.append(_along(columns, y, [0, *(int(k) + 1 for k in found.indices_)]))
    return _best(rest, len(y))


def _frols(task: Task) -> float:
    """SysIdentPy: error-reduction ratios of its FROLS on our columns."""
    from sysidentpy.model_structure_selection import FROLS

    t, r, y, shape, widths, centers = task
    rest = []
    for width in widths:
        columns = dictionary(t, r, grid_of(shape), width)
        model = FROLS(n_terms=centers + 1, order_selection=False)
        model.max_lag = 0
        _, pivots, _ = model.error_reduction_ratio(columns, y[:, None], centers + 1)
        rest.append(_along(columns, y, [int(k) for k in pivots[: centers + 1]]))
    return _best(rest, len(y))


SELECTIONS: dict[str, Callable[[Task], float]] = {
    "gyrotc, grid": _gyrotc_grid,
    "gyrotc, any candidates": _gyrotc_any,
    "scikit-learn OMP": _omp,
    "fastcan": _fastcan,
    "SysIdentPy FROLS": _frols,
}


Learner = Callable[[TrainingData], tuple[Predictor, int]]  # the map and the bytes of its numbers as 32-bit words


def _method(method: str) -> Learner:
    def learn(data: TrainingData) -> tuple[Predictor, int]:
        found = fit(data, method=method)
        return lambda t, r: predict(found, t, r), found.parameter_bytes

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


METHODS: dict[str, Learner] = {
    "gyrotc mrbf (default)": _method("mrbf"),
    "gyrotc rbf_ols": _method("rbf_ols"),
    "gyrotc bank": _method("bank"),
    "paper: mrbf_paper": _method("mrbf_paper"),
    "paper: rbf_random": _method("rbf_random"),
    "paper: mlr": _method("mlr"),
    "polynomial of order 5": _poly5,
    "scikit-learn GPR": _gpr,
    "scikit-learn SVR": _svr,
    "scikit-learn MLP, 16": _mlp,
}


def _points(n: int) -> Floats:
    t, r, _ = cloud(n)
    return np.stack([t, r], axis=1)


def _quantisation(samples: Floats, nodes: Floats) -> float:
    """RMS distance of every hundredth sample to its nearest node."""
    d = np.min(np.linalg.norm(samples[::100, None] - nodes[None], axis=2), axis=1)
    return float(np.sqrt(np.mean(d**2)))


def _gyrotc_kohonen(n: int, m: int) -> Callable[[], float]:
    samples = _points(n)
    return lambda: _quantisation(samples, _core.kohonen(samples, m, max_epochs=1, seed=1).nodes)


def _numpy_kohonen(n: int, m: int) -> Callable[[], float]:
    """The same rule, a vectorised search of the winner for each sample."""
    samples = _points(n)

    def run() -> float:
        rng = np.random.default_rng(1)
        nodes = samples[rng.permutation(n)[:m]].copy()
        rate, decay = 0.5, 0.01 ** (1.0 / (n - 1))
        for x in samples[rng.permutation(n)]:
            d = nodes - x
            winner = np.argmin(np.einsum("ij,ij->i", d, d))
            nodes[winner] += rate * (x - nodes[winner])
            rate *= decay
        return _quantisation(samples, nodes)

    return run


def _minisom(n: int, m: int) -> Callable[[], float]:
    from minisom import MiniSom

    samples = _points(n)

    def run() -> float:
        som = MiniSom(1, m, 2, sigma=0.01, learning_rate=0.5, random_seed=1)
        som.random_weights_init(samples)
        som.train(samples, n, random_order=True)
        return _quantisation(samples, som.get_weights().reshape(-1, 2))

    return run


def _six(seed: int) -> tuple[Floats, Floats, Floats, Floats]:
    """500 noisy bins of six Gaussians, and a start near them (columns c, d, log s, log q): one optimum for all."""
    rng = np.random.default_rng(seed)
    t, r = rng.uniform(-1, 1, 500), rng.uniform(-1, 1, 500)
    true = np.array([[-0.8, -0.5, -0.2, 0.2, 0.5, 0.8], [0.0, 0.5, -0.5, 0.5, -0.5, 0.0], *[[-0.7] * 6] * 2])
    c, d, s, q = true[:, :, None]
    g = np.exp(-(((t - c) / np.exp(s)) ** 2) - ((r - d) / np.exp(q)) ** 2)
    y = np.array([1.0, -0.8, 0.9, -1.0, 0.7, -0.6]) @ g + rng.normal(0.0, 0.01, 500)
    return t, r, y, true + rng.normal(0.0, 0.1, true.shape)


def _gyrotc_varpro() -> Callable[[], float]:
    t, r, y, start = _six(3)

    def run() -> float:
        solver = _core.VariableProjection(t, r, np.ones(500), y, 1e-8)
        return float(np.sqrt(solver.refine(solver.project(start), 1e-6, 60).misfit / 500))

    return run


def _scipy_varpro() -> Callable[[], float]:
    """Levenberg-Marquardt of MINPACK on the nonlinear parameters, weights by least squares inside."""
    from scipy.optimize import least_squares

    t, r, y, start = _six(3)

    def residual(p: Floats) -> Floats:
        c, d, s, q = p.reshape(4, 6)
        g = np.exp(-(((t[:, None] - c) * np.exp(-s)) ** 2) - ((r[:, None] - d) * np.exp(-q)) ** 2)
        x = np.concatenate([np.ones((500, 1)), t[:, None], r[:, None], g], axis=1)
        return np.asarray(y - x @ np.linalg.lstsq(x, y, rcond=None)[0])

    def run() -> float:
        found = least_squares(residual, start.ravel(), method="lm")
        return float(np.sqrt(2.0 * found.cost / 500))

    return run


KOHONEN = {"gyrotc": _gyrotc_kohonen, "numpy": _numpy_kohonen, "MiniSom": _minisom}
VARPRO = {"gyrotc": _gyrotc_varpro, "scipy least_squares": _scipy_varpro}
