"""Single algorithms beside other implementations: the Kohonen network, variable projection."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from gyrotc import _core
from numpy.typing import NDArray

from .problems import cloud

__all__ = ["KOHONEN", "VARPRO"]

Floats = NDArray[np.float64]


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
