"""Whether the same selection follows in other units, in another order, and for samples that are there twice."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gyrotc.train.data import TrainingData
from gyrotc.train.methods import fit
from numpy.typing import NDArray

from .problems import gyro, joined, means
from .selection import dictionary, grid_of

__all__ = ["invariance"]

Floats = NDArray[np.float64]
Select = Callable[[TrainingData], Floats]  # samples to the chosen centers, one row each, C and C/min

_SEEDS = range(1, 6)
_RAD_PER_S = np.pi / 180.0 / 3600.0
_SAME_C = 1e-9
_OMP_GRID = (25, 12)
_OMP_WIDTH = 0.5
_OMP_CENTERS = 40


def _gyrotc(method: str) -> Select:
    def select(data: TrainingData) -> Floats:
        return np.array(fit(data, method=method).networks[0]["centers"]).reshape(-1, 2)

    return select


def _omp(data: TrainingData) -> Floats:
    """scikit-learn: 40 centers asked for among 300, bias about its mean."""
    from sklearn.linear_model import OrthogonalMatchingPursuit

    t, r, y = means(data)
    z = [(x - x.min()) / np.ptp(x) * 2.0 - 1.0 for x in (t, r)]
    centers = grid_of(_OMP_GRID)
    columns = dictionary(z[0], z[1], centers, _OMP_WIDTH)[:, 1:]
    columns = columns - columns.mean(axis=0)
    columns /= np.linalg.norm(columns, axis=0)
    model = OrthogonalMatchingPursuit(n_nonzero_coefs=_OMP_CENTERS, precompute=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # it says so when it ends early
        model.fit(columns, y - y.mean())
    return centers[np.flatnonzero(model.coef_)]


_CONTESTANTS: dict[str, Select] = {
    "gyrotc mrbf (default)": _gyrotc("mrbf"),
    "gyrotc rbf_ols": _gyrotc("rbf_ols"),
    "paper: mrbf_paper": _gyrotc("mrbf_paper"),
    "scikit-learn OMP": _omp,
}
_CHANGES: dict[str, Callable[[TrainingData], TrainingData]] = {
    "rad/s": lambda data: replace(data, bias_dph=_RAD_PER_S * data.bias_dph),
    "shuffled": lambda data: data.select(np.random.default_rng(0).permutation(len(data))),
    "every sample twice": lambda data: data.select(np.repeat(np.arange(len(data)), 2)),
}


def invariance(say: Callable[[str], None]) -> dict[str, Any]:
    """Numbers of centers in deg/h and after each change, and how many gyros kept their selection."""
    rows = []
    for name, select in _CONTESTANTS.items():
        say(f"same selection: {name}")
        plain = [select(_samples(seed, None)) for seed in _SEEDS]
        changes = {}
        for change in _CHANGES:
            found = [select(_samples(seed, change)) for seed in _SEEDS]
            same = sum(_same(a, b) for a, b in zip(plain, found, strict=True))
            changes[change] = {"centers": _sizes(found), "same": same}
        rows.append({"name": name, "centers": _sizes(plain), "changes": changes})
    return {"gyros": len(_SEEDS), "rows": rows}


def _samples(seed: int, change: str | None) -> TrainingData:
    data = joined(gyro("paper", seed).train)
    return data if change is None else _CHANGES[change](data)


def _sizes(found: Sequence[Floats]) -> list[int]:
    return [min(len(x) for x in found), max(len(x) for x in found)]


def _same(a: Floats, b: Floats) -> bool:
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=0.0, atol=_SAME_C))
