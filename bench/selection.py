"""Orthogonal least squares: the same candidates and widths for gyrotc and its peers, one thread each.

Each contestant gets samples, a grid of candidates, widths and the number of centers; it returns the residual RMS of
the network that it chose. Building the dictionary counts: who does not need one has the advantage.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence

import numpy as np
from gyrotc import _core
from numpy.typing import NDArray

__all__ = ["CONTESTANTS", "Task", "dictionary", "grid_of"]

Floats = NDArray[np.float64]
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
    gaussians = np.concatenate([places, np.full((len(places), 2), dictionary.width_t)], axis=1)
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


CONTESTANTS: dict[str, Callable[[Task], float]] = {
    "gyrotc, grid": _gyrotc_grid,
    "gyrotc, any candidates": _gyrotc_any,
    "scikit-learn OMP": _omp,
    "fastcan": _fastcan,
    "SysIdentPy FROLS": _frols,
}
