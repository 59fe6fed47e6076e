"""The default method: evidence model, compressed into few anisotropic Gaussians, size by departure.

1. Means over 50 s are gathered into bins; a Hilbert-space Gaussian process is fitted by maximum evidence.
2. A Kohonen network on the bins proposes places; orthogonal least squares picks among them; variable
   projection moves all centers and widths. The target is the mean of the process, not the samples.
3. The number of centers is the smallest whose departure d from the process' mean is at most 1/10 of the
   process' own expected squared error v. Predicted RMS over noise floor: √(1 + v + d).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyrotc import _core
from gyrotc.train.data import Bins, Scaling, TrainingData, average, gather
from gyrotc.train.noise import not_white
from gyrotc.train.result import Outcome, network

__all__ = ["fit_mrbf"]

Floats = NDArray[np.float64]

MEAN_S = 50.0
MAX_CENTERS = 24
_DEPARTURE = 0.1
_SETTLED = 0.01
_RIDGE = 0.01
_KOHONEN_NODES = 40
_TRIM_SIGMA = 4.5
_TRIMS = 3
_GAP_GRID = (17, 9)
_GAP_WEIGHT = 0.02


@dataclass(frozen=True, slots=True)
class _Samples:
    """Means over 50 s, standardised."""

    t: Floats
    r: Floats
    y: Floats
    weight: Floats
    run: NDArray[np.int64]
    center: float
    spread: float
    seconds: float


def fit_mrbf(
    data: TrainingData, scaling: Scaling, *, seed: int, centers: int | None, average_s: float
) -> Outcome:
    """Trains on cleaned samples whose temperature spans at least 2 C.

    Args:
        data: Cleaned samples.
        scaling: Normalisation of the inputs.
        seed: Of the Kohonen network.
        centers: Number of centers asked for; None: chosen from the data.
        average_s: Averaging of RMS figures, s.
    """
    began = time.process_time()
    samples = _standardised(average(data, MEAN_S), scaling)
    process, bins, kept = _evidence(samples)
    evidence_s = time.process_time() - began
    sizes, chosen, departures = _compress(process, bins, scaling, seed, centers)
    expected = process.freedom / bins.samples * average_s / samples.seconds
    per_noise = average_s / (samples.seconds * process.sigma**2)
    residual = (samples.y - process.mean(samples.t, samples.r))[kept]
    curves = {
        "sizes": [
            {"centers": m, "departure": float(d * per_noise), "misfit": float(n.misfit)}
            for m, (n, d) in enumerate(zip(sizes, departures, strict=True))
        ],
        "chosen": chosen,
        "expected_error": float(expected),
        "evidence": {
            "log_parameters": [float(p) for p in process.log_parameters],
            "value": float(process.value),
            "evaluations": int(process.evaluations),
            "freedom": float(process.freedom),
        },
        "samples": len(data),
        "means": len(samples.y),
        "bins": len(bins.t),
        "trimmed": int(np.sum(~kept)),
        "seconds": {"evidence": evidence_s, "compression": time.process_time() - began - evidence_s},
    }
    withheld = not_white(residual, samples.run[kept], samples.weight[kept])
    predicted = float(np.sqrt(1.0 + expected + departures[chosen] * per_noise))
    return Outcome(
        networks=(_physical(sizes[chosen], samples, scaling),),
        curves=curves,
        predicted_rms_ratio=None if withheld else predicted,
        withheld=withheld,
    )


def _standardised(means: TrainingData, scaling: Scaling) -> _Samples:
    t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
    weight = means.weight / np.median(means.weight)
    center = float(np.average(means.bias_dph, weights=weight))
    spread = float(np.sqrt(np.average((means.bias_dph - center) ** 2, weights=weight)))
    spread = spread if spread > 0.0 else 1.0
    y = (means.bias_dph - center) / spread
    return _Samples(t, r, y, weight, means.run, center, spread, float(np.median(means.duration_s)))


def _evidence(samples: _Samples) -> tuple[_core.EvidenceModel, Bins, NDArray[np.bool_]]:
    """Process on all samples but outliers (|residual| beyond 4.5 robust σ, at most three rounds)."""
    kept = np.ones(len(samples.y), dtype=bool)
    start = None
    for round_ in range(_TRIMS + 1):
        bins = gather(samples.t[kept], samples.r[kept], samples.y[kept], samples.weight[kept])
        process = _core.EvidenceModel(bins.t, bins.r, bins.count, bins.mean, bins.within, bins.samples)
        if start is None:
            process.optimise()
        else:
            process.optimise_from(start)
        residual = np.abs(samples.y - process.mean(samples.t, samples.r)) * np.sqrt(samples.weight)
        inside = residual <= _TRIM_SIGMA * 1.4826 * np.median(residual[kept])
        if round_ == _TRIMS or np.array_equal(inside, kept) or inside.sum() < 0.5 * len(kept):
            break
        kept, start = inside, process.log_parameters
    return process, bins, kept


def _compress(
    process: _core.EvidenceModel, bins: Bins, scaling: Scaling, seed: int, centers: int | None
) -> tuple[list[_core.Network], int, list[float]]:
    """Networks by size, the index of the chosen one, mean squared departures (standardised) on the bins."""
    grid_t, grid_r = _envelope_grid(scaling)
    t, r = np.r_[bins.t, grid_t], np.r_[bins.r, grid_r]
    total = float(bins.count.sum())
    weight = np.r_[bins.count, np.full(len(grid_t), _GAP_WEIGHT * total / len(grid_t))]
    noise = process.sigma**2
    solver = _core.VariableProjection(t, r, weight, process.mean(t, r), _RIDGE * noise)
    nodes = _core.kohonen(np.stack([bins.t, bins.r], axis=1), _KOHONEN_NODES, seed=seed).nodes
    enough = _DEPARTURE * process.freedom * noise
    limit, stop = (MAX_CENTERS, enough) if centers is None else (centers, 0.0)
    sizes = solver.path(nodes, limit, stop, _SETTLED * enough, 0.01 * enough)
    target = process.mean(bins.t, bins.r)
    departures = [
        float(np.average((target - evaluate(n, bins.t, bins.r)) ** 2, weights=bins.count)) for n in sizes
    ]
    if centers is not None:
        return sizes, len(sizes) - 1, departures
    good = [m for m, d in enumerate(departures) if d * total <= enough]
    return sizes, good[0] if good else len(sizes) - 1, departures


def _envelope_grid(scaling: Scaling) -> tuple[Floats, Floats]:
    """Points over the whole envelope: between the samples, too, the network shall follow the process."""
    t, r = np.meshgrid(
        np.linspace(*scaling.temperature_c, _GAP_GRID[0]), np.linspace(*scaling.slope_c_per_min, _GAP_GRID[1])
    )
    return scaling.normalise(t.ravel(), r.ravel())


def evaluate(network: _core.Network, t: Floats, r: Floats) -> Floats:
    """A standardised network at normalised inputs."""
    w = network.weights
    value = w[0] + w[1] * t + w[2] * r
    for (c, d, s, q), weight in zip(network.shapes.T, w[3:], strict=True):
        value = value + weight * np.exp(-(((t - c) / np.exp(s)) ** 2) - ((r - d) / np.exp(q)) ** 2)
    return np.asarray(value)


def _physical(found: _core.Network, samples: _Samples, scaling: Scaling) -> dict[str, Any]:
    """The network in deg/h, C and C/min, centers ordered by temperature."""
    order = np.lexsort((found.shapes[1], found.shapes[0]))
    w = found.weights * samples.spread
    c, d, s, q = found.shapes[:, order]
    centers = np.stack(
        [c * scaling.half_range_c + scaling.center_c, d * scaling.half_range_c_per_min], axis=1
    )
    return network(w[0] + samples.center, w[1:3], centers, np.exp(np.stack([s, q], axis=1)), w[3:][order])
