"""Training: samples in, networks out. It knows numbers only, no files."""

from __future__ import annotations

from typing import Any

import numpy as np

from gyrotc.errors import InputError
from gyrotc.train.data import MIN_TEMPERATURE_SPAN_C, Scaling, TrainingData, cleaned, scaling_of
from gyrotc.train.mrbf import fit_mrbf
from gyrotc.train.noise import floor_dph
from gyrotc.train.result import Fit, network_dph, predict

__all__ = ["METHODS", "Fit", "TrainingData", "fit", "predict"]

METHODS = ("mrbf",)
_MAX_CENTERS = 512


def fit(
    data: TrainingData,
    *,
    method: str = "mrbf",
    seed: int = 0,
    centers: int | None = None,
    rho: float | None = None,
    average_s: float = 100.0,
) -> Fit:
    """Trains a map bias = f(T, dT/dt). The same samples in any order give the same result.

    Args:
        data: Samples; exact duplicates by run and time count once.
        method: One of `METHODS`.
        seed: Of everything random.
        centers: Largest number of centers; None: chosen from the data.
        rho: Stop rule of the orthogonal least squares methods, eq. (16) of Ding et al. 2014.
        average_s: Averaging of RMS figures, s.

    Raises:
        InputError: Bad samples or arguments.
    """
    if method not in METHODS:
        raise InputError("method", repr(method), "one of " + ", ".join(METHODS))
    if centers is not None and not 0 <= centers <= _MAX_CENTERS:
        raise InputError("centers", repr(centers), f"0 ... {_MAX_CENTERS}")
    if not (np.isfinite(average_s) and average_s > 0.0):
        raise InputError("average_s", repr(average_s), "a number of seconds above 0")
    samples = cleaned(data)
    scaling = scaling_of(samples)
    mean = float(np.average(samples.bias_dph, weights=samples.weight))
    if np.ptp(samples.temperature_c) < MIN_TEMPERATURE_SPAN_C:
        return _constant(samples, scaling, mean, method, average_s)
    outcome = fit_mrbf(samples, scaling, seed=seed, centers=centers, average_s=average_s)
    residual = samples.bias_dph - network_dph(
        outcome.network, scaling, samples.temperature_c, samples.slope_c_per_min
    )
    return Fit(
        method=method,
        networks=(outcome.network,),
        scaling=scaling,
        findings=(),
        curves=outcome.curves,
        predicted_rms_ratio=None if outcome.withheld else outcome.predicted_rms_ratio,
        withheld=outcome.withheld,
        noise_floor_dph=floor_dph(samples, residual, average_s),
        average_s=average_s,
        fallback_dph=mean,
    )


def _constant(samples: TrainingData, scaling: Scaling, mean: float, method: str, average_s: float) -> Fit:
    """A temperature span under 2 C says nothing about temperature: the mean is the model."""
    span = float(np.ptp(samples.temperature_c))
    network: dict[str, Any] = {
        "w0": mean,
        "linear": [0.0, 0.0],
        "centers": [],
        "widths": [],
        "weights": [],
        "region": None,
    }
    finding = {
        "id": "no_temperature_information",
        "text": f"Temperature spans only {span:.2f} C: the model is the mean bias.",
        "evidence": {"span_c": span, "required_c": MIN_TEMPERATURE_SPAN_C},
    }
    return Fit(
        method=method,
        networks=(network,),
        scaling=scaling,
        findings=(finding,),
        curves={"sizes": [], "chosen": 0, "samples": len(samples)},
        predicted_rms_ratio=None,
        withheld="a constant model has nothing to predict from",
        noise_floor_dph=floor_dph(samples, samples.bias_dph - mean, average_s),
        average_s=average_s,
        fallback_dph=mean,
    )
