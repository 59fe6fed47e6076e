"""Training: samples in, networks out. It knows numbers only, no files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..common.metrics import LEAST_SPAN_C
from ..recordings.fit_options import AUTO, DEFAULTS, METHODS, SIMPLE, BuildOptions
from .bank import fit_bank
from .candidates import select
from .data import Scaling, TrainingData, cleaned_samples, scaling_of
from .gaussian import TrainingFailed
from .mrbf import fit_mrbf, fit_mrbf_t
from .networks import network
from .noise import floor_dph
from .objection import objection_to
from .ols import RIDGE, fit_ols
from .prior.given import Prior, UnitSamples
from .result import Fit, Outcome, predict
from .simple import fit_simple
from .stepwise import fit_mlr
from .uncertainty import coverage, uncertainty_of

__all__ = [
    "AUTO",
    "METHODS",
    "SIMPLE",
    "Fit",
    "Outcome",
    "TrainingData",
    "TrainingFailed",
    "coverage",
    "fit",
    "predict",
    "trained",
    "uncertainty_of",
]

_MAPS: dict[str, Callable[..., Outcome]] = {"mrbf": fit_mrbf, "mrbf_t": fit_mrbf_t, "bank": fit_bank}
_GUARDED = ("mrbf", "mrbf_t")


def fit(
    data: TrainingData,
    *,
    method: str = "mrbf",
    seed: int = DEFAULTS.seed,
    centers: int | None = None,
    rho: float | None = None,
    average_s: float = DEFAULTS.average_s,
    power_on: NDArray[np.int64] | None = None,
    prior: Prior | None = None,
    serial: str = "",
) -> Fit:
    """Train a map bias = f(T, dT/dt). The order of the samples does not change the result.

    Args:
        data: Samples; exact duplicates by run and time count once.
        method: One of `METHODS`, taken as asked; or `AUTO`: model selection, unless a number of centers or ρ is asked
            for.
        seed: Whatever is drawn at random (start of the Kohonen network, random centers) follows from it.
        centers: Number of centers, fewer where more would gain nothing; None: chosen from the data.
        rho: Threshold of eq. (16) of Ding et al. 2014, for the methods by orthogonal least squares.
        average_s: Averaging of RMS figures, s.
        power_on: For model selection: number of the power-on of each run, by its index; None: each run is one.
        prior: What units of the type share, or the unit's earlier model; for `AUTO` and "mrbf" without a number of
            centers. Samples that do not agree with it are fitted without it, with a finding.
        serial: The unit's, to tell whether a lot has seen it.

    Raises:
        InputError: Bad samples or arguments.
        TrainingFailed: The equations of a method that was asked for by name, or of model selection, cannot be solved.
    """
    method = "mrbf" if method == AUTO and (centers is not None or rho is not None) else method
    BuildOptions(method=method, seed=seed, centers=centers, rho=rho, average_s=average_s)
    samples = cleaned_samples(data)
    scaling = scaling_of(samples)
    findings: list[dict[str, object]] = []
    selected = None
    reason = ""
    like_auto = method in (AUTO, "mrbf") and centers is None
    unit = UnitSamples(samples, scaling, power_on, serial)
    given = prior.with_samples(unit, seed=seed, average_s=average_s) if like_auto and prior else None
    findings += given.findings if given else []
    if given is not None and given.map is not None:
        (outcome, scaling), method, reason = given.map, "mrbf", given.reason
    elif np.ptp(samples.temperature_c) < LEAST_SPAN_C:
        outcome = _constant(samples)
        findings.append(_no_information(samples))
        method = "constant" if method == AUTO else method
    elif method == AUTO:
        selected = select(samples, scaling, power_on, seed=seed, average_s=average_s)
        method, outcome, reason = selected.method, selected.outcome, selected.reason
        findings += selected.findings
    else:
        outcome = trained(
            method, samples, scaling, seed=seed, centers=centers, rho=rho, average_s=average_s, power_on=power_on
        )
        against = objection_to(outcome, samples, scaling, average_s) if method in _GUARDED else ""
        if against:
            findings.append(_beyond(method, against))
    mean = float(np.average(samples.bias_dph, weights=samples.weight))
    bare = Fit(method, outcome, scaling, findings, 0.0, average_s, mean, process=outcome.process)
    residual = samples.bias_dph - predict(bare, samples.temperature_c, samples.slope_c_per_min)
    floor = floor_dph(samples, residual, average_s)
    found = replace(bare, noise_floor_dph=floor, reason=reason, power_on=power_on)
    if given is not None:
        return replace(found, lot=given.lot, prior=given.prior, known=given.known)
    if selected is not None:
        return replace(
            found,
            candidates=selected.rows,
            process=outcome.process or selected.process,
            folds=selected.folds,
            left_out=selected.left_out,
        )
    return found


def trained(
    method: str,
    data: TrainingData,
    scaling: Scaling,
    *,
    seed: int = DEFAULTS.seed,
    centers: int | None = None,
    rho: float | None = None,
    average_s: float = DEFAULTS.average_s,
    ridge: float = RIDGE,
    power_on: NDArray[np.int64] | None = None,
) -> Outcome:
    """Train one method on cleaned samples, whatever they tell about temperature; the arguments are those of `fit`.

    Args:
        ridge: For the methods by orthogonal least squares, as `fit_ols` takes it.
        power_on: For the maps that follow the Gaussian model.

    Raises:
        TrainingFailed: The equations cannot be solved.
    """
    if method == "mlr":
        return fit_mlr(data, scaling, average_s)
    if method in SIMPLE:
        return fit_simple(method, data, scaling, average_s)
    if method in _MAPS:
        return _MAPS[method](data, scaling, seed=seed, centers=centers, average_s=average_s, power_on=power_on)
    return fit_ols(method, data, scaling, seed=seed, centers=centers, rho=rho, average_s=average_s, ridge=ridge)


def _constant(samples: TrainingData) -> Outcome:
    """A temperature span under 2 C says nothing about temperature: the mean is the model."""
    mean = float(np.average(samples.bias_dph, weights=samples.weight))
    return Outcome(
        networks=(network(mean),),
        curves={"sizes": [], "chosen": 0, "samples": len(samples)},
        withheld="a constant model has nothing to predict from",
    )


def _no_information(samples: TrainingData) -> dict[str, object]:
    span = float(np.ptp(samples.temperature_c))
    return {
        "id": "no_temperature_information",
        "text": f"Temperature spans only {span:.2f} C: nothing can be learnt about it; the model is the mean bias.",
        "evidence": {"span_c": span, "required_c": LEAST_SPAN_C},
    }


def _beyond(method: str, against: str) -> dict[str, object]:
    return {
        "id": "map_beyond_data",
        "text": f"The map of {method}, which was asked for by name, should not be used: {against}. Without it "
        "model selection chooses a correction that keeps to the data.",
        "evidence": {"method": method},
    }
