"""Measure what the default training reaches on simulated gyros, and how it behaves when asked for more or given less.

Besides: the same samples in other units, in another order, and every one twice.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gyrotc.train import Fit, TrainingData, fit, joined, predict
from numpy.typing import NDArray

from ..campaigns import say
from . import contestants
from .contestants import Gyro, dictionary, grid_of, gyro, means, ratio

SCENARIOS = ("paper", "paper-ripple", "paper-ripple-strong")
_CENTERS = (14, 20, 40, 60)
_SLOW = {"scikit-learn GPR": 3, "scikit-learn MLP, 16": 3}  # so many gyros only
_NOISE = (1.0 / 3.0, 3.0)
_RAMPS = {"1 C/min": 3, "3 C/min": 4, "5 C/min": 5}  # index of the environment


def accuracy(gyros: int = 10) -> dict[str, Any]:
    """Return what each method reaches on so many simulated gyros of each scenario."""
    seeds = range(1, gyros + 1)
    return {
        "default": [_default(scenario, seeds) for scenario in SCENARIOS],
        "more_centers": [_more_centers(scenario, seeds) for scenario in SCENARIOS],
        "left_out": [_left_out(scenario, seeds) for scenario in SCENARIOS[:2]],
        "noise": [_other_noise(factor, seeds) for factor in _NOISE],
        "methods": [_method(name, seeds) for name in contestants.METHODS],
    }


def _fit(data: TrainingData, **options: Any) -> tuple[Fit, float]:
    began = time.process_time()
    found = fit(data, **options)
    return found, time.process_time() - began


def _ratio(found: Fit, unit: Gyro, runs: Sequence[int] | None = None) -> float:
    return ratio(lambda t, r: predict(found, t, r), unit, runs)


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "worst": float(np.max(values)), "best": float(np.min(values))}


def _default(scenario: str, seeds: range) -> dict[str, Any]:
    ratios, sizes, seconds, surplus, weights, withheld = [], [], [], [], [], 0
    for seed in seeds:
        say(f"{scenario}, gyro {seed}")
        unit = gyro(scenario, seed)
        found, spent = _fit(joined(unit.train))
        ratios.append(_ratio(found, unit))
        sizes.append(found.n_centers)
        seconds.append(spent)
        weights.append(found.sum_abs_weights)
        if found.predicted_rms_ratio is None:
            withheld += 1
        else:
            surplus.append(ratios[-1] - found.predicted_rms_ratio)
    return {
        "scenario": scenario,
        "gyros": len(seeds),
        "ratio": _spread(ratios),
        "centers": _spread(sizes),
        "bytes": {k: 24 + 20 * v for k, v in _spread(sizes).items()},
        "seconds": _spread(seconds),
        "found_minus_predicted": float(np.median(surplus)) if surplus else None,
        "withheld": withheld,
        "sum_abs_weights_dph": float(max(weights)),
    }


def _more_centers(scenario: str, seeds: range) -> dict[str, Any]:
    """Largest departure of the ratio from that of the chosen size, over five gyros, for each number asked for."""
    rows: dict[str, list[float]] = {str(n): [] for n in _CENTERS}
    for seed in seeds[:5]:
        say(f"{scenario}, gyro {seed}, more centers than chosen")
        unit = gyro(scenario, seed)
        chosen = _ratio(_fit(joined(unit.train))[0], unit)
        for n in _CENTERS:
            rows[str(n)].append(_ratio(_fit(joined(unit.train), centers=n)[0], unit) - chosen)
    return {"scenario": scenario, "largest": {n: float(max(v, key=abs)) for n, v in rows.items()}}


def _left_out(scenario: str, seeds: range) -> dict[str, Any]:
    """Ratio on a ramp rate that no training run had, and with it."""
    rows: dict[str, Any] = {}
    for name, k in _RAMPS.items():
        without, with_it = [], []
        for seed in seeds:
            say(f"{scenario}, gyro {seed}, without {name}")
            unit = gyro(scenario, seed)
            rest = joined([part for i, part in enumerate(unit.train) if i != k])
            without.append(_ratio(_fit(rest)[0], unit, [k]))
            with_it.append(_ratio(_fit(joined(unit.train))[0], unit, [k]))
        rows[name] = {"without": _spread(without), "with": _spread(with_it)}
    every = [row["without"]["median"] for row in rows.values()]
    return {"scenario": scenario, "ramps": rows, "median": float(np.median(every))}


def _other_noise(factor: float, seeds: range) -> dict[str, Any]:
    """The noise of training and exam made larger or smaller: what was added is known, so it can be scaled."""
    ratios, sizes = [], []
    for seed in seeds:
        say(f"noise x {factor:.2g}, gyro {seed}")
        unit = gyro("paper", seed)
        scaled = _with_noise(unit, factor, seed)
        found, _ = _fit(joined(scaled.train))
        ratios.append(_ratio(found, scaled))
        sizes.append(found.n_centers)
    return {"factor": factor, "ratio": _spread(ratios), "centers": _spread(sizes)}


def _with_noise(unit: Gyro, factor: float, seed: int) -> Gyro:
    """The map of a good fit as the truth, white noise of `factor` times the paper's on it."""
    rng = np.random.default_rng(seed)
    truth, _ = _fit(joined([*unit.train, *unit.exam]), centers=20)
    sigma = factor * 7e-4 * np.sqrt(10.0)

    def noisy(part: TrainingData) -> tuple[TrainingData, Any]:
        noise = rng.normal(0.0, sigma, len(part))
        columns = {name: getattr(part, name) for name in TrainingData.__dataclass_fields__}
        columns["bias_dph"] = predict(truth, part.temperature_c, part.slope_c_per_min) + noise
        return TrainingData(**columns), noise[: len(noise) // 10 * 10].reshape(-1, 10).mean(axis=1)

    train = [noisy(part)[0] for part in unit.train]
    exam = [noisy(part) for part in unit.exam]
    return Gyro(tuple(train), tuple(e for e, _ in exam), tuple(n for _, n in exam))


def _method(name: str, seeds: range) -> dict[str, Any]:
    learn = contestants.METHODS[name]
    ratios, sizes, seconds = [], [], []
    for seed in seeds[: _SLOW.get(name, len(seeds))]:
        say(f"{name}, gyro {seed}")
        unit = gyro("paper", seed)
        data = joined(unit.train)
        began = time.process_time()
        predictor, size = learn(data)
        seconds.append(time.process_time() - began)
        ratios.append(ratio(predictor, unit))
        sizes.append(size)
    return {
        "name": name,
        "gyros": len(ratios),
        "ratio": _spread(ratios),
        "bytes": float(np.median(sizes)),
        "seconds": float(np.median(seconds)),
    }


Floats = NDArray[np.float64]
Select = Callable[[TrainingData], Floats]  # samples to the chosen centers, one row each, C and C/min

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


def invariance(gyros: int = 5) -> dict[str, Any]:
    """Numbers of centers in deg/h and after each change, and how many gyros kept their selection."""
    rows, seeds = [], range(1, gyros + 1)
    for name, select in _CONTESTANTS.items():
        say(f"same selection: {name}")
        plain = [select(_samples(seed, None)) for seed in seeds]
        changes = {}
        for change in _CHANGES:
            found = [select(_samples(seed, change)) for seed in seeds]
            same = sum(_same(a, b) for a, b in zip(plain, found, strict=True))
            changes[change] = {"centers": _sizes(found), "same": same}
        rows.append({"name": name, "centers": _sizes(plain), "changes": changes})
    return {"gyros": gyros, "rows": rows}


def _samples(seed: int, change: str | None) -> TrainingData:
    data = joined(gyro("paper", seed).train)
    return data if change is None else _CHANGES[change](data)


def _sizes(found: Sequence[Floats]) -> list[int]:
    return [min(len(x) for x in found), max(len(x) for x in found)]


def _same(a: Floats, b: Floats) -> bool:
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=0.0, atol=_SAME_C))
