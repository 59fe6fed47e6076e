"""Results of training: what a method hands over, and the fit that is made of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..common.arrays import FloatArray
from ..common.metrics import Averages
from ..results.fleet import KnownMap, LotUse
from ..results.training import EarlierUse
from .data import Scaling
from .folds import Fold
from .networks import NetworkEntry, networks_dph
from .process import Process


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a method, for `fit`.

    Attributes:
        networks: The networks as `model.json` has them (docs/FORMAT.md): w0, linear, centers, widths, weights, region.
        curves: For `training.json`.
        predicted_rms_ratio: Predicted RMS over noise floor, None if withheld.
        withheld: Why, empty if it is not.
        process: The evidence model that the networks follow, where the method has one.
    """

    networks: Sequence[NetworkEntry]
    curves: Mapping[str, Any]
    predicted_rms_ratio: float | None = None
    withheld: str = "the method predicts nothing"
    process: Process | None = None


@dataclass(frozen=True, slots=True)
class Fit:
    """A trained map.

    Attributes:
        method: Name of the method.
        outcome: What the method found; its fields are also attributes of the fit.
        scaling: Normalisation of the inputs and their range in training.
        findings: What a user should know, each with id, text and evidence.
        noise_floor_dph: Estimated noise of means over `average_s`, deg/h.
        average_s: Averaging of RMS figures, s.
        fallback_dph: Weighted mean of the training bias, deg/h.
        candidates: What was tried and chosen from, where the method was left to the data; as in `training.json`.
        reason: Why this one was chosen, in words.
        lot: What a lot did for it, where one was given.
        prior: What an earlier model did for it, where one was given.
        known: What it follows, where a lot or an earlier model was used, for `training.json`.
        process: What the networks follow, or else the smooth map of the samples where one was made; None: none was.
        power_on: Number of the power-on of each run, by its index; None: each run is one.
        folds: Pieces of history that were left out in turn, where model selection has done it.
        left_out: What the correction leaves on each of them without having seen it, deg/h.
    """

    method: str
    outcome: Outcome
    scaling: Scaling
    findings: Sequence[Mapping[str, Any]]
    noise_floor_dph: float
    average_s: float
    fallback_dph: float
    candidates: Sequence[Mapping[str, Any]] = ()
    reason: str = ""
    lot: LotUse | None = None
    prior: EarlierUse | None = None
    known: KnownMap | None = None
    process: Process | None = None
    power_on: NDArray[np.int64] | None = None
    folds: Sequence[Fold] = ()
    left_out: Sequence[Averages] = ()

    @property
    def networks(self) -> Sequence[NetworkEntry]:
        return self.outcome.networks

    @property
    def curves(self) -> Mapping[str, Any]:
        return self.outcome.curves

    @property
    def predicted_rms_ratio(self) -> float | None:
        return self.outcome.predicted_rms_ratio

    @property
    def withheld(self) -> str:
        return self.outcome.withheld

    @property
    def scale(self) -> dict[str, Any]:
        """`scale` of `model.json`."""
        s = self.scaling
        return {"temperature_c": [s.center_c, s.half_range_c], "slope_c_per_min": s.half_range_c_per_min}

    @property
    def envelope(self) -> dict[str, Any]:
        """`envelope` of `model.json`: the range of the training samples."""
        return {
            "temperature_c": list(self.scaling.temperature_c),
            "slope_c_per_min": list(self.scaling.slope_c_per_min),
        }

    @property
    def n_centers(self) -> int:
        return sum(len(network["weights"]) for network in self.networks)

    @property
    def parameter_bytes(self) -> int:
        """Parameters of the map as 32-bit words: 24 + 20 M for one network."""
        return 12 + sum(12 + 20 * len(network["weights"]) for network in self.networks)

    @property
    def sum_abs_weights(self) -> float:
        """Largest Σ|w| of the networks, deg/h."""
        return max(float(np.abs(network["weights"]).sum()) for network in self.networks)


def predict(fit: Fit, temperature_c: ArrayLike, slope_c_per_min: ArrayLike) -> FloatArray:
    """Bias of the map in deg/h at inputs in C and C/min, clamped to the envelope; shapes broadcast."""
    s = fit.scaling
    t = np.clip(np.asarray(temperature_c, dtype=np.float64), *s.temperature_c)
    r = np.clip(np.asarray(slope_c_per_min, dtype=np.float64), *s.slope_c_per_min)
    t, r = np.broadcast_arrays(t, r)
    return networks_dph(fit.networks, s, t, r)
