"""The default method: evidence model, compressed into few anisotropic Gaussians, size by departure.

1. Means over 50 s are gathered into bins; a Hilbert-space Gaussian process is fitted by maximum evidence.
2. A Kohonen network on the bins proposes places; orthogonal least squares picks among them; variable
   projection moves all centers and widths. The target is the mean of the process, not the samples.
3. The number of centers is the smallest whose departure d from the process' mean is at most 1/10 of the
   process' own expected squared error v. Predicted RMS over noise floor: √(1 + v + d).
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from .. import _core
from ..common.arrays import FloatArray
from .data import Scaling, TrainingData, scaling_of
from .evidence import Process, fit_process
from .residual_noise import not_white
from .result import Outcome, network
from .simple import without_rate

__all__ = ["fit_mrbf", "fit_mrbf_t"]


MAX_CENTERS = 24  # bounds the time of a fit, and its table at 504 bytes
_DEPARTURE = 0.1  # of the expected squared error: docs/training.md, section 1, step 5
_SETTLED = 0.01  # of a misfit that is small enough: refining stops there, because no choice depends on less
_RIDGE = 0.01  # of the noise variance: it bounds the weights (docs/training.md, section 1)
_KOHONEN_NODES = 40  # candidates: docs/training.md, section 1, step 3
_GAP_GRID = (17, 9)  # points of T and of dT/dt over the envelope
_GAP_WEIGHT = 0.02  # of all samples together: the network follows the process between the ramps, too (step 4)


def fit_mrbf(
    data: TrainingData,
    scaling: Scaling,
    *,
    seed: int,
    centers: int | None,
    average_s: float,
    process: Process | None = None,
) -> Outcome:
    """Trains on cleaned samples whose temperature spans at least 2 C.

    Args:
        data: Cleaned samples.
        scaling: Normalisation of the inputs.
        seed: Draws the start of the Kohonen network.
        centers: Number of centers asked for; None: chosen from the data.
        average_s: Averaging of RMS figures, s.
        process: The evidence process of these samples, where it is known already.

    Raises:
        TrainingFailed: The equations cannot be solved.
    """
    began = time.process_time()
    process = process or fit_process(data, scaling)
    evidence_s = time.process_time() - began
    sizes, chosen, departures = _compress(process, scaling, seed, centers)
    model = process.model
    expected = model.freedom / process.bins.samples * average_s / process.seconds
    per_noise = average_s / (process.seconds * model.sigma**2)
    curves = {
        "sizes": [
            {"centers": m, "departure": float(d * per_noise), "misfit": float(n.misfit)}
            for m, (n, d) in enumerate(zip(sizes, departures, strict=True))
        ],
        "chosen": chosen,
        "expected_error": float(expected),
        **_facts(process),
        "samples": len(data),
        "seconds": {"evidence": evidence_s, "compression": time.process_time() - began - evidence_s},
    }
    kept = process.kept
    residual = (process.y - model.mean(process.t, process.r))[kept]
    withheld = not_white(residual, process.run[kept], process.weight[kept])
    predicted = float(np.sqrt(1.0 + expected + departures[chosen] * per_noise))
    return Outcome(
        networks=(_physical(sizes[chosen], process, scaling),),
        curves=curves,
        predicted_rms_ratio=None if withheld else predicted,
        withheld=withheld,
        process=process,
    )


def fit_mrbf_t(
    data: TrainingData, scaling: Scaling, *, seed: int, centers: int | None, average_s: float
) -> Outcome:
    """A map of T alone, valid over the rates of the samples; arguments and errors as `fit_mrbf`."""
    still = replace(data, slope_c_per_min=np.zeros(len(data)))
    outcome = fit_mrbf(still, scaling_of(still), seed=seed, centers=centers, average_s=average_s)
    flat = [without_rate(one) for one in outcome.networks]
    return replace(outcome, networks=flat, process=None)


def _facts(process: Process) -> dict[str, Any]:
    """What was trained on, and how the maximum of the evidence was found."""
    model = process.model
    return {
        "evidence": {
            "log_parameters": [float(p) for p in model.log_parameters],
            "value": float(model.value),
            "evaluations": int(model.evaluations),
            "freedom": float(model.freedom),
        },
        "means": len(process.y),
        "bins": len(process.bins.t),
        "trimmed": int(np.sum(~process.kept)),
    }


def _compress(
    process: Process, scaling: Scaling, seed: int, centers: int | None
) -> tuple[list[_core.Network], int, list[float]]:
    """Networks by size, the index of the chosen one, mean squared departures (standardised) on the bins."""
    model, bins = process.model, process.bins
    grid_t, grid_r = _envelope_grid(scaling)
    t, r = np.r_[bins.t, grid_t], np.r_[bins.r, grid_r]
    total = float(bins.count.sum())
    weight = np.r_[bins.count, np.full(len(grid_t), _GAP_WEIGHT * total / len(grid_t))]
    noise = model.sigma**2
    solver = _core.VariableProjection(t, r, weight, model.mean(t, r), _RIDGE * noise)
    nodes = _core.kohonen(np.stack([bins.t, bins.r], axis=1), _KOHONEN_NODES, seed=seed).nodes
    enough = _DEPARTURE * model.freedom * noise
    limit, stop = (MAX_CENTERS, enough) if centers is None else (centers, 0.0)
    sizes = solver.path(nodes, limit, stop, _SETTLED * enough, 0.01 * enough)
    target = model.mean(bins.t, bins.r)
    departures = [
        float(np.average((target - evaluate(n, bins.t, bins.r)) ** 2, weights=bins.count)) for n in sizes
    ]
    if centers is not None:
        return sizes, len(sizes) - 1, departures
    good = [m for m, d in enumerate(departures) if d * total <= enough]
    return sizes, good[0] if good else len(sizes) - 1, departures


def _envelope_grid(scaling: Scaling) -> tuple[FloatArray, FloatArray]:
    """Points over the whole envelope: between the samples, too, the network shall follow the process."""
    t, r = np.meshgrid(
        np.linspace(*scaling.temperature_c, _GAP_GRID[0]), np.linspace(*scaling.slope_c_per_min, _GAP_GRID[1])
    )
    return scaling.normalise(t.ravel(), r.ravel())


def evaluate(network: _core.Network, t: FloatArray, r: FloatArray) -> FloatArray:
    """A standardised network at normalised inputs."""
    w = network.weights
    value = w[0] + w[1] * t + w[2] * r
    for (c, d, s, q), weight in zip(network.shapes.T, w[3:], strict=True):
        value = value + weight * np.exp(-(((t - c) / np.exp(s)) ** 2) - ((r - d) / np.exp(q)) ** 2)
    return np.asarray(value)


def _physical(found: _core.Network, process: Process, scaling: Scaling) -> dict[str, Any]:
    """The network in deg/h, C and C/min, centers ordered by temperature."""
    order = np.lexsort((found.shapes[1], found.shapes[0]))
    w = found.weights * process.spread
    c, d, s, q = found.shapes[:, order]
    centers = np.stack(
        [c * scaling.half_range_c + scaling.center_c, d * scaling.half_range_c_per_min], axis=1
    )
    return network(w[0] + process.center, w[1:3], centers, np.exp(np.stack([s, q], axis=1)), w[3:][order])
