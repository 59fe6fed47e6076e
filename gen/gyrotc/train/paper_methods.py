"""Methods of Ding et al. 2014 and peers: orthogonal least squares, linear regression, polynomials, a bank of models.

The paper has one model for each environment. At run time a gyro knows T and dT/dt only, so the envelope is
cut into cooling, holding and warming, which overlap; each gets a network of its own by the default method.

========== ==================================== ==========================================
rbf_random random samples, taken as they come   ρ (eq. 16), the width that needs fewest
mrbf_paper Kohonen nodes, by error reduction    ρ (eq. 16), the width that needs fewest
rbf_ols    regular grid, by error reduction     contiguous blocks left out with guard gaps
========== ==================================== ==========================================

All have one width δ for both normalised inputs, chosen from a series of seven, and w0 as the first column.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.metrics import LEAST_SPAN_C
from .data import Scaling, TrainingData, average
from .evidence import floor_dph
from .mrbf import fit_mrbf
from .result import Outcome, network

_HOLD = 0.1  # |dT/dt| of a hold, share of the half range; the hold's region reaches to twice that
_MIN_SAMPLES = 100  # a quarter of an hour in blocks of 10 s: with fewer a region has no map of its own


def fit_bank(data: TrainingData, scaling: Scaling, *, seed: int, centers: int | None, average_s: float) -> Outcome:
    """Trains up to three networks; one without a region where the samples do not allow three.

    `centers` counts for each network.
    """
    edge = _HOLD * scaling.half_range_c_per_min
    low, high = scaling.slope_c_per_min
    regions = [(low, -edge), (max(low, -2.0 * edge), min(high, 2.0 * edge)), (edge, high)]
    parts = [_part(data, region) for region in regions]
    if not all(_enough(part) for part in parts):
        return fit_mrbf(data, scaling, seed=seed, centers=centers, average_s=average_s)
    found = [fit_mrbf(part, scaling, seed=seed, centers=centers, average_s=average_s) for part in parts]
    networks: list[dict[str, Any]] = []
    for outcome, region in zip(found, regions, strict=True):
        bounds = {"temperature_c": list(scaling.temperature_c), "slope_c_per_min": list(region)}
        networks.append({**outcome.networks[0], "region": bounds})
    names = ("cooling", "holding", "warming")
    return Outcome(networks=networks, curves={name: outcome.curves for name, outcome in zip(names, found, strict=True)})


def _part(data: TrainingData, region: tuple[float, float]) -> TrainingData:
    inside = (data.slope_c_per_min >= region[0]) & (data.slope_c_per_min <= region[1])
    return data.select(inside)


def _enough(part: TrainingData) -> bool:
    return len(part) >= _MIN_SAMPLES and float(np.ptp(part.temperature_c)) >= LEAST_SPAN_C


Powers = tuple[int, int]

_PLANE: tuple[Powers, ...] = ((0, 0), (1, 0), (0, 1))  # powers of T and of dT/dt
# Powers up to the third order together
_FURTHER: tuple[Powers, ...] = ((2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
_HIGHEST_ORDER = 5  # polynomials of higher order swing between the data and beyond


def fit_mlr(data: TrainingData, scaling: Scaling, average_s: float) -> Outcome:
    """Stepwise regression of Ding et al. 2014, section 4.2: constant, T and dT/dt, less what BIC eliminates.

    The variable without which the criterion is least is dropped as long as the criterion falls. The paper names no
    further candidates; the constant stays, because dropping it would depend on where the scale of T begins.
    """
    began = time.process_time()
    means = average(data, average_s)
    chosen = list(_PLANE)
    best, weights = _bic(means, scaling, chosen)
    curve = [best]
    while len(chosen) > 1:
        trials = [(*_bic(means, scaling, [q for q in chosen if q != p]), p) for p in chosen[1:]]
        bic, fewer, dropped = min(trials, key=lambda trial: trial[0])
        if bic >= best:
            break
        best, weights = bic, fewer
        chosen.remove(dropped)
        curve.append(best)
    return _linear_outcome(chosen, weights, curve, time.process_time() - began)


def fit_poly_slope(data: TrainingData, scaling: Scaling, average_s: float) -> Outcome:
    """Polynomial in T and dT/dt: a plane, and further products of powers up to the third order while BIC falls."""
    began = time.process_time()
    means = average(data, average_s)
    chosen = list(_PLANE)
    best, weights = _bic(means, scaling, chosen)
    curve = [best]
    while len(chosen) < len(_PLANE) + len(_FURTHER):
        trials = [(*_bic(means, scaling, [*chosen, p]), p) for p in _FURTHER if p not in chosen]
        bic, more, added = min(trials, key=lambda trial: trial[0])
        if bic >= best:
            break
        best, weights = bic, more
        chosen.append(added)
        curve.append(best)
    return _linear_outcome(chosen, weights, curve, time.process_time() - began)


def fit_poly(data: TrainingData, scaling: Scaling, average_s: float) -> Outcome:
    """Polynomial in T of the order (1 ... 5) with the least BIC: what flight controllers do."""
    began = time.process_time()
    means = average(data, average_s)
    orders = [[(k, 0) for k in range(n + 1)] for n in range(1, _HIGHEST_ORDER + 1)]
    trials = [_bic(means, scaling, powers) for powers in orders]
    k = int(np.argmin([bic for bic, _ in trials]))
    return _linear_outcome(orders[k], trials[k][1], [bic for bic, _ in trials], time.process_time() - began)


def _bic(means: TrainingData, scaling: Scaling, powers: list[Powers]) -> tuple[float, FloatArray]:
    """Bayesian information criterion of a weighted least-squares fit, and its weights."""
    t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
    columns = np.stack([t**a * r**b for a, b in powers], axis=1)
    root = np.sqrt(means.weight / means.weight.mean())
    weights = np.linalg.lstsq(root[:, None] * columns, root * means.bias_dph, rcond=None)[0]
    n = len(means)
    rest = float(np.sum((root * (means.bias_dph - columns @ weights)) ** 2))
    floor = np.finfo(np.float64).tiny
    return n * float(np.log(max(rest / n, floor))) + len(powers) * float(np.log(n)), weights


def _linear_outcome(powers: list[Powers], weights: FloatArray, curve: list[float], seconds: float) -> Outcome:
    by_power = dict(zip(powers, (float(w) for w in weights), strict=True))
    linear = (by_power.pop((1, 0), 0.0), by_power.pop((0, 1), 0.0))
    w0 = by_power.pop((0, 0))
    return Outcome(
        networks=(network(w0, linear),),
        curves={"bic": curve, "powers": [list(p) for p in powers], "seconds": {"total": seconds}},
        polynomial=tuple((a, b, w) for (a, b), w in by_power.items()),
    )


Dictionary = Callable[[float], _core.EqualGaussians]

WIDTHS = (0.15, 0.22, 0.33, 0.5, 0.75, 1.1, 1.6)  # half ranges, each 1.5 times the one before
SIZE_RULES = ("rho", "bic", "press", "blocks", "runs")
_GRID = (21, 13)  # centers of T and of dT/dt: docs/training.md, section 3
_NODES = 135  # the largest of the paper's networks
_MAX_CENTERS = 30  # bounds the time of a fit
_FOLDS = 5  # the usual five
_BLOCKS = 20  # of time, four to a fold, so that each fold has all temperatures
_GUARD_S = 300.0  # three times the averaging: what is left out has no neighbour in training
RIDGE = 1e-8  # times all weight: slight, for candidates that nearly coincide (docs/training.md, section 2)
_TOLERANCE = 1e-3  # a smaller model whose criterion is worse by this share is preferred
_EXCESS = 1.02  # of the noise floor: what the default ρ asks for


@dataclass(frozen=True, slots=True)
class _Problem:
    """Means over `average_s` at normalised inputs, and how the size is to be chosen."""

    t: FloatArray
    r: FloatArray
    means: TrainingData
    rule: str
    rho: float
    max_centers: int
    fixed: bool
    in_order: bool

    def samples(self, mask: NDArray[np.bool_] | slice = slice(None)) -> _core.Samples:
        m = self.means
        return _core.Samples(self.t[mask], self.r[mask], m.bias_dph[mask], m.weight[mask])


@dataclass(frozen=True, slots=True)
class _Choice:
    """A width, its path and the number of columns (w0 included) taken from it; a smaller score is better."""

    score: float
    width: float
    dictionary: _core.EqualGaussians
    path: _core.OlsPath
    columns: int
    curve: list[float]


def fit_ols(
    method: str,
    data: TrainingData,
    scaling: Scaling,
    *,
    seed: int,
    centers: int | None,
    rho: float | None,
    size_rule: str | None,
    average_s: float,
    ridge: float = RIDGE,
) -> Outcome:
    """Trains `rbf_random`, `mrbf_paper` or `rbf_ols`.

    Args:
        method: Name of the method.
        data: Cleaned samples.
        scaling: Normalisation of the inputs.
        seed: Draws the random samples, or the start of the Kohonen network.
        centers: Number of centers (the rule then only chooses the width); None: by the rule.
        rho: Threshold of eq. (16); None: where the residual reaches the noise that the samples show.
        size_rule: One of `SIZE_RULES`; None: the method's own, or `rho` where `rho` is given.
        average_s: Length of the means, s (the paper's filter: 100 s).
        ridge: On the weights of the Gaussians, times all weight of the samples; 0: plain least squares.
    """
    began = time.process_time()
    means = average(data, average_s)
    t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
    dictionary = _dictionary(method, t, r, seed)
    own = "blocks" if method == "rbf_ols" else "rho"
    rule = size_rule or (own if rho is None else "rho")
    if rule not in SIZE_RULES:
        raise InputError("size rule", repr(rule), "one of " + ", ".join(SIZE_RULES))
    problem = _Problem(
        t=t,
        r=r,
        means=means,
        rule=rule,
        rho=_noise_share(means) if rho is None else rho,
        max_centers=_limit(method) if centers is None else centers,
        fixed=centers is not None,
        in_order=method == "rbf_random",
    )
    choices = [_choice(problem, dictionary, width) for width in WIDTHS]
    best = min(choices, key=lambda c: c.score)
    return _outcome(problem, best, choices, scaling, ridge, time.process_time() - began)


def _limit(method: str) -> int:
    return _MAX_CENTERS if method == "rbf_ols" else _NODES


def _dictionary(method: str, t: FloatArray, r: FloatArray, seed: int) -> Dictionary:
    """The method's candidates, for every width the same places."""
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
    """ρ at which the residual is 2 % above the noise that first differences of the bias show."""
    power = float(np.average(means.bias_dph**2, weights=means.weight))
    noise = floor_dph(means, means.bias_dph, float(np.median(means.duration_s)))
    return (_EXCESS * noise) ** 2 / power if power > 0.0 else 0.0


def _choice(problem: _Problem, dictionary: Dictionary, width: float) -> _Choice:
    whole = dictionary(width)
    whole.add(problem.samples())
    rho = problem.rho if problem.rule == "rho" and not problem.fixed else 0.0
    path = _core.select_columns(whole, problem.max_centers + 1, rho=rho, in_order=problem.in_order)
    if problem.rule == "rho":
        rest = path.rest / whole.energy if whole.energy > 0.0 else path.rest
        columns = len(path.chosen)
        reached = rest[-1] < problem.rho
        score = float(columns if reached and not problem.fixed else 1e6 + rest[-1])
        return _Choice(score, width, whole, path, columns, [float(x) for x in rest])
    curve = _criterion(problem, dictionary, width, whole, path)
    columns = len(curve) if problem.fixed else _smallest(curve)
    return _Choice(float(curve[columns - 1]), width, whole, path, columns, [float(x) for x in curve])


def _smallest(curve: FloatArray) -> int:
    """Number of columns of the smallest model whose criterion is within 0.1 % of the least."""
    return int(np.argmax(curve <= curve.min() + _TOLERANCE * abs(curve.min()))) + 1


def _criterion(
    problem: _Problem, dictionary: Dictionary, width: float, whole: _core.EqualGaussians, path: _core.OlsPath
) -> FloatArray:
    """Mean squared error that the rule expects of each model on the path."""
    if problem.rule in ("blocks", "runs"):
        return _left_out(problem, dictionary, width, whole, len(path.chosen))
    n, total = whole.samples, float(problem.means.weight.sum())
    k = np.arange(1, len(path.chosen) + 1)
    if problem.rule == "bic":
        return np.asarray(path.rest / total * np.exp(k * np.log(n) / n))
    return _press(problem, whole, path) / total


def _press(problem: _Problem, whole: _core.EqualGaussians, path: _core.OlsPath) -> FloatArray:
    """Sum of squared errors of every sample left out alone, for each model on the path (Allen 1974)."""
    root = np.sqrt(problem.means.weight)
    places = whole.centers[np.array(path.chosen[1:], dtype=np.int64) - 1]
    gaussians = np.exp(
        -(((problem.t[:, None] - places[:, 0]) / whole.width_t) ** 2)
        - ((problem.r[:, None] - places[:, 1]) / whole.width_r) ** 2
    )
    columns = root[:, None] * np.concatenate([np.ones((len(root), 1)), gaussians], axis=1)
    orthonormal = np.linalg.qr(columns)[0]
    y = root * problem.means.bias_dph
    residual = y[:, None] - np.cumsum(orthonormal * (orthonormal.T @ y), axis=1)
    leverage = np.cumsum(orthonormal**2, axis=1)
    return np.asarray(np.sum((residual / np.maximum(1.0 - leverage, 1e-6)) ** 2, axis=0))


def _left_out(
    problem: _Problem, dictionary: Dictionary, width: float, whole: _core.EqualGaussians, columns: int
) -> FloatArray:
    """Mean squared error on parts that were left out, selection included, for every size."""
    errors, weight = np.zeros(columns), 0.0
    for inside, near in _folds(problem.means, problem.rule):
        part = dictionary(width)
        part.add(problem.samples(near))
        rest = whole.copy()
        rest.subtract(part)
        path = _core.select_columns(rest, columns, in_order=problem.in_order)
        found = _core.errors_along(path, rest, problem.samples(inside))
        errors += np.concatenate([found, np.full(columns - len(found), found[-1])])
        weight += float(problem.means.weight[inside].sum())
    return errors / weight


def _folds(means: TrainingData, rule: str) -> Sequence[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
    """(left out, left out with guard gap) of each fold: whole runs, or every fifth of 20 blocks of a run."""
    runs = np.unique(means.run)
    if rule == "runs" and len(runs) > 1:
        return [(means.run == k, means.run == k) for k in runs]
    inside = np.zeros((_FOLDS, len(means)), dtype=bool)
    near = inside.copy()
    for k in runs:
        mask = means.run == k
        time_s = means.time_s[mask]
        edges = np.linspace(time_s.min(), np.nextafter(time_s.max(), np.inf), _BLOCKS + 1)
        block = np.clip(np.searchsorted(edges, time_s, side="right") - 1, 0, _BLOCKS - 1)
        distance_s = np.minimum(time_s - edges[block], edges[block + 1] - time_s)
        for fold in range(_FOLDS):
            mine = block % _FOLDS == fold
            beside = (block + 1) % _FOLDS == fold
            after = (block - 1) % _FOLDS == fold
            inside[fold, mask] = mine
            near[fold, mask] = mine | ((beside | after) & (distance_s < _GUARD_S))
    return [(a, b) for a, b in zip(inside, near, strict=True) if a.any() and not b.all()]


def _outcome(
    problem: _Problem, best: _Choice, choices: Sequence[_Choice], scaling: Scaling, ridge: float, seconds: float
) -> Outcome:
    places = best.dictionary.centers[np.array(best.path.chosen[1 : best.columns], dtype=np.int64) - 1]
    gaussians = np.concatenate([places, np.full((len(places), 2), best.width)], axis=1)
    total = float(problem.means.weight.sum())
    weights = _core.least_squares(problem.samples(), gaussians, ridge * total)
    order = np.lexsort((places[:, 1], places[:, 0]))
    physical = places * [scaling.half_range_c, scaling.half_range_c_per_min] + [scaling.center_c, 0.0]
    curves = {
        "size_rule": problem.rule,
        "rho": problem.rho,
        "width": best.width,
        "error_reduction": [float(x) for x in best.path.reduction[: best.columns]],
        "criterion": {f"{c.width:g}": c.curve for c in choices},
        "chosen": best.columns - 1,
        "means": len(problem.means),
        "seconds": {"total": seconds},
    }
    found = network(weights[0], (0.0, 0.0), physical[order], gaussians[order, 2:], weights[1:][order])
    return Outcome(networks=(found,), curves=curves)
