"""Networks of the map in the form of `model.json`: make, evaluate and rescale them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..common.arrays import FloatArray
from .data import Scaling

NetworkEntry = Mapping[str, Any]

_CENTER_GRID = 2.0**20  # so that tables hold centers without further rounding (docs/numerics.md)


def network(
    w0: float, linear: ArrayLike = (0.0, 0.0), centers: ArrayLike = (), widths: ArrayLike = (), weights: ArrayLike = ()
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


def snapped(network: NetworkEntry, scale: Mapping[str, Any]) -> dict[str, Any]:
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


def rescaled(network: NetworkEntry, old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """Express a function of temperature and its rate in another scale: linear part and widths count half ranges."""
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


def networks_dph(
    networks: Sequence[NetworkEntry], scaling: Scaling, temperature_c: FloatArray, slope: FloatArray
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


def _network_dph(network: NetworkEntry, scaling: Scaling, temperature_c: FloatArray, slope: FloatArray) -> FloatArray:
    """One network (docs/FORMAT.md, section 1), deg/h."""
    t, r = scaling.normalise(temperature_c, slope)
    bias = network["w0"] + network["linear"][0] * t + network["linear"][1] * r
    for (c_t, c_r), (d_t, d_r), weight in zip(network["centers"], network["widths"], network["weights"], strict=True):
        u = ((t - (c_t - scaling.center_c) / scaling.half_range_c) / d_t) ** 2
        u = u + ((r - c_r / scaling.half_range_c_per_min) / d_r) ** 2
        bias = bias + weight * np.exp(-u)
    return np.asarray(bias, dtype=np.float64)
