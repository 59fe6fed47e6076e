"""What training gives: networks in the shape of `model.json`, and what is known about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyrotc.train.data import Scaling

__all__ = ["Fit", "predict"]


@dataclass(frozen=True, slots=True)
class Fit:
    """A trained map.

    Attributes:
        method: Name of the method.
        networks: As in `model.json` (docs/FORMAT.md): w0, linear, centers, widths, weights, region.
        scaling: Normalisation of the inputs and their range in training.
        findings: What a user should know, each with id, text and evidence.
        curves: For `training.json`: cost by size, evidence, times.
        predicted_rms_ratio: Predicted RMS of the compensated bias over the noise floor, None if withheld.
        withheld: Why the prediction is withheld, empty if it is not.
        noise_floor_dph: Estimated noise of means over `average_s`, deg/h.
        average_s: Averaging of RMS figures, s.
        fallback_dph: Weighted mean of the training bias, deg/h.
    """

    method: str
    networks: Sequence[Mapping[str, Any]]
    scaling: Scaling
    findings: Sequence[Mapping[str, Any]]
    curves: Mapping[str, Any]
    predicted_rms_ratio: float | None
    withheld: str
    noise_floor_dph: float
    average_s: float
    fallback_dph: float

    @property
    def scale(self) -> dict[str, Any]:
        """`scale` of `model.json`."""
        s = self.scaling
        return {
            "temperature_c": [s.center_c, s.half_range_c],
            "slope_c_per_min": s.half_range_c_per_min,
        }

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
    def table_bytes(self) -> int:
        """Bytes of the map's parameters as 32-bit words: 24 + 20 M for one network."""
        return 12 + sum(12 + 20 * len(network["weights"]) for network in self.networks)

    @property
    def sum_abs_weights(self) -> float:
        """Largest Σ|w| of the networks, deg/h."""
        return max(float(np.abs(network["weights"]).sum()) for network in self.networks)


def predict(fit: Fit, temperature_c: ArrayLike, slope_c_per_min: ArrayLike) -> NDArray[np.float64]:
    """Bias of the map in deg/h at inputs in C and C/min, clamped to the envelope; shapes broadcast."""
    s = fit.scaling
    t = np.clip(np.asarray(temperature_c, dtype=np.float64), *s.temperature_c)
    r = np.clip(np.asarray(slope_c_per_min, dtype=np.float64), *s.slope_c_per_min)
    t, r = np.broadcast_arrays(t, r)
    return network_dph(fit.networks[0], s, t, r)


def network_dph(
    network: Mapping[str, Any],
    scaling: Scaling,
    temperature_c: NDArray[np.float64],
    slope: NDArray[np.float64],
) -> NDArray[np.float64]:
    """One network at inputs that are already clamped (docs/FORMAT.md, section 1), deg/h."""
    t, r = scaling.normalise(temperature_c, slope)
    bias = network["w0"] + network["linear"][0] * t + network["linear"][1] * r
    for (c_t, c_r), (d_t, d_r), weight in zip(
        network["centers"], network["widths"], network["weights"], strict=True
    ):
        u = np.zeros_like(t)
        if d_t is not None:
            u = u + ((t - (c_t - scaling.center_c) / scaling.half_range_c) / d_t) ** 2
        if d_r is not None:
            u = u + ((r - c_r / scaling.half_range_c_per_min) / d_r) ** 2
        bias = bias + weight * np.exp(-u)
    return np.asarray(bias, dtype=np.float64)
