"""What training gives: networks in the shape of `model.json`, and what is known about them.

Or known before: what training takes of a unit from units of its type, or from its earlier model (`Prior`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..common.arrays import FloatArray
from ..results.lot import KnownMap, LotUse
from ..results.training import EarlierUse
from .data import Scaling, TrainingData
from .evidence import Process

Network = Mapping[str, Any]

_CENTER_GRID = 2.0**20  # so that tables hold centers without further rounding (docs/numerics.md)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a method hands to `fit`.

    Attributes:
        networks: The networks as `model.json` has them (docs/FORMAT.md): w0, linear, centers, widths, weights, region.
        curves: For `training.json`.
        predicted_rms_ratio: Predicted RMS over noise floor, None if withheld.
        withheld: Why, empty if it is not.
        polynomial: Further summands (power of z_T, power of z_r, deg/h), for comparison only.
        process: The evidence model that the networks follow, where the method has one.
    """

    networks: Sequence[Network]
    curves: Mapping[str, Any]
    predicted_rms_ratio: float | None = None
    withheld: str = "the method predicts nothing"
    polynomial: Sequence[tuple[int, int, float]] = ()
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

    @property
    def networks(self) -> Sequence[Network]:
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
        """Parameters of the map as 32-bit words: 24 + 20 M for one network, 4 for each further summand."""
        parts = sum(12 + 20 * len(network["weights"]) for network in self.networks)
        return 12 + parts + 4 * len(self.outcome.polynomial)

    @property
    def sum_abs_weights(self) -> float:
        """Largest Σ|w| of the networks, deg/h."""
        return max(float(np.abs(network["weights"]).sum()) for network in self.networks)


def network(
    w0: float,
    linear: ArrayLike = (0.0, 0.0),
    centers: ArrayLike = (),
    widths: ArrayLike = (),
    weights: ArrayLike = (),
) -> dict[str, Any]:
    """A network of plain numbers without a region."""
    return {
        "w0": float(w0),
        "linear": np.asarray(linear, dtype=np.float64).tolist(),
        "centers": np.asarray(centers, dtype=np.float64).tolist(),
        "widths": np.asarray(widths, dtype=np.float64).tolist(),
        "weights": np.asarray(weights, dtype=np.float64).tolist(),
        "region": None,
    }


def snapped(network: Network, scale: Mapping[str, Any]) -> dict[str, Any]:
    """A network with its centers on multiples of 2^-20 of a scale, so that tables hold them without further rounding.

    It moves a center by less than 5e-7 half ranges, far below what the data can tell; the model is what is stored.
    """
    (center, half), slope = scale["temperature_c"], scale["slope_c_per_min"]
    centers = [
        [center + half * _on_grid((t - center) / half), slope * _on_grid(r / slope)] for t, r in network["centers"]
    ]
    return {**network, "centers": centers}


def _on_grid(z: float) -> float:
    return round(z * _CENTER_GRID) / _CENTER_GRID


def rescaled(network: Network, old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """The same function of temperature and its rate in another scale: linear part and widths count half ranges."""
    (c_old, h_old), (c_new, h_new) = old["temperature_c"], new["temperature_c"]
    wider = (h_new / h_old, new["slope_c_per_min"] / old["slope_c_per_min"])
    linear_t, linear_r = network["linear"]
    return {
        **network,
        "w0": network["w0"] + linear_t * (c_new - c_old) / h_old,
        "linear": [linear_t * wider[0], linear_r * wider[1]],
        "widths": [
            [None if w is None else w / k for w, k in zip(pair, wider, strict=True)] for pair in network["widths"]
        ],
    }


def predict(fit: Fit, temperature_c: ArrayLike, slope_c_per_min: ArrayLike) -> FloatArray:
    """Bias of the map in deg/h at inputs in C and C/min, clamped to the envelope; shapes broadcast."""
    s = fit.scaling
    t = np.clip(np.asarray(temperature_c, dtype=np.float64), *s.temperature_c)
    r = np.clip(np.asarray(slope_c_per_min, dtype=np.float64), *s.slope_c_per_min)
    t, r = np.broadcast_arrays(t, r)
    bias = networks_dph(fit.networks, s, t, r)
    z_t, z_r = s.normalise(t, r)
    for power_t, power_r, weight in fit.outcome.polynomial:
        bias = bias + weight * z_t**power_t * z_r**power_r
    return bias


def networks_dph(
    networks: Sequence[Network], scaling: Scaling, temperature_c: FloatArray, slope: FloatArray
) -> FloatArray:
    """Networks at inputs that are already clamped, deg/h; over the overlap of their regions blended linearly.

    A network's share is the distance to the nearest inner edge of its region, in lengths of the region.
    """
    if len(networks) == 1:
        return _network_dph(networks[0], scaling, temperature_c, slope)
    total, shares = np.zeros(temperature_c.shape), np.zeros(temperature_c.shape)
    for one in networks:
        share = np.ones(temperature_c.shape)
        for key, x, envelope in (
            ("temperature_c", temperature_c, scaling.temperature_c),
            ("slope_c_per_min", slope, scaling.slope_c_per_min),
        ):
            low, high = one["region"][key]
            length = (high - low) or 1.0
            if low > envelope[0]:
                share = np.minimum(share, (x - low) / length)
            if high < envelope[1]:
                share = np.minimum(share, (high - x) / length)
        share = np.maximum(share, 0.0)
        total += share * _network_dph(one, scaling, temperature_c, slope)
        shares += share
    return np.asarray(total / shares)


def _network_dph(network: Network, scaling: Scaling, temperature_c: FloatArray, slope: FloatArray) -> FloatArray:
    """One network (docs/FORMAT.md, section 1), deg/h."""
    t, r = scaling.normalise(temperature_c, slope)
    bias = network["w0"] + network["linear"][0] * t + network["linear"][1] * r
    for (c_t, c_r), (d_t, d_r), weight in zip(network["centers"], network["widths"], network["weights"], strict=True):
        u = ((t - (c_t - scaling.center_c) / scaling.half_range_c) / d_t) ** 2
        u = u + ((r - c_r / scaling.half_range_c_per_min) / d_r) ** 2
        bias = bias + weight * np.exp(-u)
    return np.asarray(bias, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Given:
    """What a prior made of a unit's samples.

    Attributes:
        map: Networks and scaling over both envelopes; None: the prior was not used.
        findings: What a user should know.
        reason: Why the map was chosen.
        lot, prior: For `training.json`: what a lot did, or an earlier model.
        known: What the map follows, for `training.json`; None: the prior was not used.
    """

    map: tuple[Outcome, Scaling] | None
    findings: list[dict[str, Any]]
    reason: str = ""
    lot: LotUse | None = None
    prior: EarlierUse | None = None
    known: KnownMap | None = None


class Prior(Protocol):
    """Knowledge of a unit's map that does not come from its own samples."""

    @property
    def key(self) -> str:
        """Hash of what it was made from."""

    def check_axis(self, axis: str | None) -> None:
        """Raises InputError where it is not of this axis."""

    def with_samples(self, samples: TrainingData, own: Scaling, serial: str, *, seed: int, average_s: float) -> Given:
        """Tests whether cleaned samples agree with it, and makes a map of both if they do.

        Args:
            own: Scaling of the samples.
            serial: The unit's.
            seed: Of the Kohonen network.
            average_s: Averaging of RMS figures, s.
        """
