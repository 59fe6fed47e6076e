"""The evidence model on training samples: means over 50 s, standardised, outliers dropped.

Its mean is the target that `mrbf` compresses; its variance is the shape of the uncertainty.

The evidence of a flexible process can be raised without limit by following every mean and calling what is left
noise. So the noise that differences of neighbouring means show holds it: σ is never taken to be less than a
quarter of it, outliers are measured by no less than it, and at most a tenth of the means is dropped.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..common.arrays import FloatArray
from ..common.errors import GyrotcError
from ..common.metrics import MAD_TO_SIGMA, median
from .data import Bins, Scaling, TrainingData, average, gather, weighted_mean
from .noise import difference_sigma

MEAN_S = 50.0  # 100 s would smear a ripple of 11 C at 5 C/min: docs/training.md, section 1
_TRIM_SIGMA = 4.5  # a normal deviation lies beyond it once in 150,000
_TRIMS = 3  # rounds of dropping and fitting again
_TRIM_SHARE = 0.1  # more than this share cannot be outliers: then the process does not fit, and nothing more is dropped
_TRIM_NOISE = 0.8  # of what differences show, less their own scatter: a smaller residual has been followed, not left
_LEAST_NOISE = 0.25  # of what differences show: smooth structure makes them larger than the noise, hardly smaller
_LEAST_SIGMA = 1e-4  # of the spread: below it the normal equations lose their last digits
GRID = 2.0**24  # of the standardised bias, so that the last digit of its unit (deg/h, rad/s) steers nothing


class TrainingFailed(GyrotcError):
    """The equations of a fit could not be solved, or what came out must not be used; the text says why."""


class MapModel(Protocol):
    """What is asked of a model of the map in standardised units: the evidence model, or a lot with a unit's runs."""

    @property
    def log_parameters(self) -> FloatArray: ...
    @property
    def sigma(self) -> float: ...
    @property
    def freedom(self) -> float: ...
    @property
    def value(self) -> float: ...
    @property
    def evaluations(self) -> int: ...
    def mean(self, t: FloatArray, r: FloatArray) -> FloatArray: ...
    def variance(self, t: FloatArray, r: FloatArray) -> FloatArray: ...


@dataclass(frozen=True, slots=True)
class Asked:
    """Where corrections will be asked for, as a lot's units show it.

    Attributes:
        temperature_c, slope_c_per_min: Places, shape (n,).
        share: Of the time, the same shape.
        between_dph: Standard deviation of the constant from power-on to power-on, by the lot's units, deg/h.
    """

    temperature_c: FloatArray
    slope_c_per_min: FloatArray
    share: FloatArray
    between_dph: float


@dataclass(frozen=True, slots=True)
class Process:
    """A conditioned process and the samples that it has seen.

    Attributes:
        model: The process in standardised units.
        bins: What it was conditioned on.
        t, r: Normalised inputs of the means.
        y: Standardised bias of the means: (bias − center)/spread.
        weight: Their weights, median 1.
        run: Their runs.
        kept: False for outliers.
        center, spread: deg/h.
        seconds: Length of a mean, s.
        asked: With a lot: where its units were; None: where the samples are.
    """

    model: MapModel
    bins: Bins
    t: FloatArray
    r: FloatArray
    y: FloatArray
    weight: FloatArray
    run: NDArray[np.int64]
    kept: NDArray[np.bool_]
    center: float
    spread: float
    seconds: float
    asked: Asked | None = None

    def mean_dph(self, t: FloatArray, r: FloatArray) -> FloatArray:
        """Mean at normalised inputs, deg/h."""
        return self.center + self.spread * self.model.mean(t, r)

    def variance_dph2(self, t: FloatArray, r: FloatArray) -> FloatArray:
        """Variance of the mean at normalised inputs, (deg/h)²."""
        return self.spread**2 * self.model.variance(t, r)

    @property
    def scales(self) -> tuple[float, float]:
        """Shortest scales over which it forgets, of the normalised inputs."""
        _, short, _, _, _, of_t, of_r, _ = np.exp(self.model.log_parameters)
        return float(min(short, of_t)), float(of_r)

    @property
    def noise_dph(self) -> float:
        """σ of a mean of weight 1, deg/h."""
        return self.spread * self.model.sigma


def fit_process(data: TrainingData, scaling: Scaling, like: Process | None = None) -> Process:
    """Maximum evidence on samples; |residual| beyond 4.5 robust σ is dropped; at most three rounds and a tenth.

    Args:
        like: A process on nearly the same samples, from whose parameters the search starts.

    Raises:
        TrainingFailed: The equations cannot be solved.
    """
    means = average(data, MEAN_S)
    t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
    weight = means.weight / median(means.weight)
    center = weighted_mean(means.bias_dph, weight)
    spread = float(np.sqrt(weighted_mean((means.bias_dph - center) ** 2, weight)))
    spread = spread if spread > 0.0 else 1.0
    y = np.round((means.bias_dph - center) / spread * GRID) / GRID
    kept = np.ones(len(y), dtype=bool)
    scale = difference_sigma(means, y, weight)
    least = max(_LEAST_NOISE * scale, _LEAST_SIGMA)
    start = like.model.log_parameters if like else None
    for round_ in range(_TRIMS + 1):
        bins = gather(t[kept], r[kept], y[kept], weight[kept])
        model = _optimised(bins, least, start)
        residual = np.abs(y - model.mean(t, r)) * np.sqrt(weight)
        robust = MAD_TO_SIGMA * median(residual[kept])
        inside = residual <= _TRIM_SIGMA * max(robust, _TRIM_NOISE * scale)
        settled = round_ == _TRIMS or np.array_equal(inside, kept)
        if settled or np.count_nonzero(~inside) > _TRIM_SHARE * len(inside):
            break
        kept, start = inside, model.log_parameters
    seconds = median(means.duration_s)
    return Process(model, bins, t, r, y, weight, means.run, kept, center, spread, seconds)


def _optimised(bins: Bins, least: float, start: FloatArray | None) -> _core.EvidenceModel:
    """The best process whose σ is at least `least`: searched freely first, for the bound changes a search's path."""
    for bound in (0.0, least):
        model = _core.EvidenceModel(bins.t, bins.r, bins.count, bins.mean, bins.within, bins.samples, bound)
        try:
            if start is None:
                model.optimise()
            else:
                model.optimise_from(start)
        except RuntimeError as error:
            if bound:
                raise TrainingFailed(f"the evidence model cannot be solved ({error})") from error
            continue
        if model.sigma >= least:
            break
    return model


def conditioned(
    process: Process, t: FloatArray, r: FloatArray, bias_dph: FloatArray, weight: FloatArray
) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """Mean, deg/h, of a process with the same parameters that has seen other means, at normalised inputs.

    Raises:
        TrainingFailed: The equations cannot be solved.
    """
    center = weighted_mean(bias_dph, weight)
    return conditioned_on(process, gather(t, r, (bias_dph - center) / process.spread, weight / median(weight)), center)


def conditioned_on(process: Process, bins: Bins, center: float) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """The same for means that are gathered: `bins.mean` is their bias less `center` (deg/h), over the spread."""
    model = _core.EvidenceModel(bins.t, bins.r, bins.count, bins.mean, bins.within, bins.samples)
    try:
        model.condition(process.model.log_parameters)
    except RuntimeError as error:
        raise TrainingFailed(f"the evidence model cannot be solved ({error})") from error
    return lambda t, r: center + process.spread * model.mean(t, r)
