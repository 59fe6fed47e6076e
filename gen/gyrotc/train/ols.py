"""Train networks of equal Gaussians by orthogonal least squares: those of Ding et al. 2014, and one on a grid.

========== ==================================== ==========================================
method     candidates, in the order taken       number of centers
========== ==================================== ==========================================
rbf_random random samples, as drawn             ρ (eq. 16)
mrbf_paper Kohonen nodes, by error reduction    ρ (eq. 16)
rbf_ols    regular grid, by error reduction     BIC, or ρ if it is given
========== ==================================== ==========================================

All Gaussians have one width for both normalised inputs, chosen from a series of seven. w0 is the first column.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import _core
from ..common.arrays import FloatArray
from .data import Scaling, TrainingData, average_samples
from .networks import network
from .noise import floor_dph
from .result import Outcome

RIDGE = 1e-8
"""Ridge of the weights, as a share of the weight of all samples: slight, for candidates that nearly coincide."""

# Widths that are tried, in half ranges, each about 1.5 times the one before.
_WIDTHS = (0.15, 0.22, 0.33, 0.5, 0.75, 1.1, 1.6)
# Centers of T and of dT/dt of the grid (docs/training.md, section 5).
_GRID = (21, 13)
# Random samples, or nodes: as many centers as the largest of the paper's networks has.
_NODES = 135
# Limits the time of a fit on the grid.
_MAX_GRID_CENTERS = 30
# By BIC, the smallest network is taken whose criterion is within this share of the least.
_TOLERANCE = 1e-3
# The default ρ asks for a residual of this many noise floors.
_RESIDUAL_FLOORS = 1.02

_Dictionary = Callable[[float], _core.EqualGaussians]


def fit_ols(
    method: str,
    data: TrainingData,
    scaling: Scaling,
    *,
    seed: int,
    centers: int | None,
    rho: float | None,
    average_s: float,
    ridge: float = RIDGE,
) -> Outcome:
    """Train `rbf_random`, `mrbf_paper` or `rbf_ols`.

    Args:
        method: Name of the method.
        data: Cleaned samples.
        scaling: Normalisation of the inputs.
        seed: Seed of the random samples, or of the Kohonen network.
        centers: Number of centers, of which only the width is then chosen; None if the samples decide.
        rho: Threshold of eq. (16); None for that of the method: where the residual reaches the noise, or BIC.
        average_s: Length of the means, s (the paper's filter: 100 s).
        ridge: Ridge of the weights, as a share of the weight of all samples; 0 for plain least squares.
    """
    started = time.process_time()
    means = average_samples(data, average_s)
    t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
    problem = _Problem(
        samples=_core.Samples(t, r, means.bias_dph, means.weight),
        total_weight=float(means.weight.sum()),
        rho=_noise_share(means) if rho is None and method != "rbf_ols" else rho,
        max_centers=_max_centers(method) if centers is None else centers,
        fixed=centers is not None,
        in_order=method == "rbf_random",
    )
    dictionary = _dictionary(method, t, r, seed)
    choices = [_choose_size(problem, dictionary(width), width) for width in _WIDTHS]
    best = min(choices, key=lambda choice: choice.score)
    places, gaussians = _gaussians(best)
    weights = _core.least_squares(problem.samples, gaussians, ridge * problem.total_weight)
    order = np.lexsort((places[:, 1], places[:, 0]))
    physical = places * [scaling.half_range_c, scaling.half_range_c_per_min] + [scaling.center_c, 0.0]
    return Outcome(
        networks=(network(weights[0], (0.0, 0.0), physical[order], gaussians[order, 2:], weights[1:][order]),),
        curves={
            "rho": problem.rho,
            "width": best.width,
            "error_reduction": best.path.reduction[: best.columns].tolist(),
            "criterion": {f"{choice.width:g}": choice.curve.tolist() for choice in choices},
            "chosen": best.columns - 1,
            "means": len(means),
            "seconds": {"total": time.process_time() - started},
        },
    )


@dataclass(frozen=True, slots=True)
class _Problem:
    """Means over `average_s` at normalised inputs, and how the number of centers is chosen.

    Attributes:
        rho: Threshold of eq. (16); None if BIC decides.
        max_centers: Number of centers that is not exceeded; if `fixed`, the number itself.
        in_order: True if candidates are taken as they come.
    """

    samples: _core.Samples
    total_weight: float
    rho: float | None
    max_centers: int
    fixed: bool
    in_order: bool


@dataclass(frozen=True, slots=True)
class _Choice:
    """A width, and how many columns (w0 included) of its path are used; a smaller score is better.

    Attributes:
        curve: Criterion by the number of columns.
    """

    score: float
    width: float
    dictionary: _core.EqualGaussians
    path: _core.OlsPath
    columns: int
    curve: FloatArray


def _max_centers(method: str) -> int:
    return _MAX_GRID_CENTERS if method == "rbf_ols" else _NODES


def _dictionary(method: str, t: FloatArray, r: FloatArray, seed: int) -> _Dictionary:
    """Return the candidates of a method by their width; their places are the same for all widths."""
    if method == "rbf_ols":
        n_t, n_r = _GRID
        t0, t1, r0, r1 = t.min(), t.max(), r.min(), r.max()
        steps = (max(t1 - t0, 1e-3) / (n_t - 1), max(r1 - r0, 1e-3) / (n_r - 1))
        return lambda width: _core.EqualGaussians.on_grid(t0, steps[0], n_t, r0, steps[1], n_r, width, width)
    points = np.stack([t, r], axis=1)
    if method == "mrbf_paper":
        places = _core.kohonen(points, _NODES, seed=seed).nodes
    else:
        places = np.random.default_rng(seed).permutation(np.unique(points, axis=0))[:_NODES]
    return lambda width: _core.EqualGaussians.at(places, width, width)


def _noise_share(means: TrainingData) -> float:
    """Return the ρ at which the residual is 2 % above the noise that first differences of the bias show."""
    power = float(np.average(means.bias_dph**2, weights=means.weight))
    noise_dph = floor_dph(means, means.bias_dph, float(np.median(means.duration_s)))
    return (_RESIDUAL_FLOORS * noise_dph) ** 2 / power if power > 0.0 else 0.0


def _choose_size(problem: _Problem, dictionary: _core.EqualGaussians, width: float) -> _Choice:
    """Choose the number of centers of one width."""
    dictionary.add(problem.samples)
    rho = 0.0 if problem.rho is None or problem.fixed else problem.rho
    path = _core.select_columns(dictionary, problem.max_centers + 1, rho=rho, in_order=problem.in_order)
    columns = len(path.chosen)
    if problem.rho is None:
        size, n = np.arange(1, columns + 1), dictionary.samples
        curve = np.asarray(path.rest / problem.total_weight * np.exp(size * np.log(n) / n))  # exp of BIC / n
        if not problem.fixed:
            columns = int(np.argmax(curve <= curve.min() + _TOLERANCE * abs(curve.min()))) + 1
        return _Choice(float(curve[columns - 1]), width, dictionary, path, columns, curve)
    curve = path.rest / dictionary.energy if dictionary.energy > 0.0 else path.rest
    reached = curve[-1] < problem.rho and not problem.fixed
    # The width that reaches ρ with the fewest centers; where none does, or their number is fixed, the least residual.
    score = float(columns if reached else 1e6 + curve[-1])
    return _Choice(score, width, dictionary, path, columns, curve)


def _gaussians(choice: _Choice) -> tuple[FloatArray, FloatArray]:
    """Return the chosen centers, shape (n, 2), and centers with both widths, shape (n, 4); normalised."""
    index = np.array(choice.path.chosen[1 : choice.columns], dtype=np.int64) - 1
    places = choice.dictionary.centers[index]
    return places, np.concatenate([places, np.full((len(places), 2), choice.width)], axis=1)
