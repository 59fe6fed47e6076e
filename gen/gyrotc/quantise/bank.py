"""Model banks: what rounding costs where networks hand over, and whether their regions leave a gap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import CheckFailed
from ..model import Envelope, Model

__all__ = ["handover_error_dph", "regions"]

_CELLS = (512, 256)
_BETWEEN = 1.5  # slopes of shares between the points of the grid

Floats = NDArray[np.float64]


def regions(model: Model) -> tuple[Envelope, ...]:
    """Region of every network; the envelope where it is the only one."""
    return tuple(n.region or model.envelope for n in model.networks)


def handover_error_dph(
    model: Model, *, error_t_c: float, error_r_c_per_min: float, share_error: float
) -> float:
    """Largest effect of moved inputs and rounded shares through the shares of a bank; 0 for one network.

    Taken on a grid, with half as much again for what lies between its points.

    Args:
        model: The model.
        error_t_c: Largest error of the temperature, C.
        error_r_c_per_min: Largest error of its rate, C/min.
        share_error: Largest error of a share relative to the sum of the shares.

    Raises:
        CheckFailed: The regions leave a gap, or only touch.
    """
    if len(model.networks) == 1:
        return 0.0
    limits = (model.envelope.temperature_c, model.envelope.slope_c_per_min)
    t, r = (np.linspace(*limits[k], _CELLS[k] + 1) for k in (0, 1))
    shares = np.stack([_share(region, limits, t, r) for region in regions(model)])
    total = shares.sum(axis=0)
    if not np.all(total > 0.0):
        raise CheckFailed("the regions of the networks leave a gap, or only touch: there is nothing to blend")
    shares = shares / total
    grid = np.meshgrid(t, r, indexing="ij")
    nets = np.stack([_alone(model, k).map_dph(*grid) for k in range(len(shares))])
    spread = float(np.max(np.max(nets, axis=0) - np.min(nets, axis=0)))
    slopes = []
    for axis, points in ((0, t), (1, r)):
        step = max(float(points[1] - points[0]), 1e-12)
        middle = np.take(nets, range(1, len(points)), axis=axis + 1)
        slopes.append(float(np.max(np.abs((np.diff(shares, axis=axis + 1) * middle).sum(axis=0)))) / step)
    moved = _BETWEEN * (slopes[0] * error_t_c + slopes[1] * error_r_c_per_min)
    return moved + share_error * spread


def _alone(model: Model, k: int) -> Model:
    network = model.networks[k].model_copy(update={"region": None})
    return model.model_copy(update={"networks": (network,)})


def _share(
    region: Envelope, limits: tuple[tuple[float, float], tuple[float, float]], t: Floats, r: Floats
) -> Floats:
    """Share of a network at every pair of inputs, before they are divided by their sum."""
    sides = (region.temperature_c, region.slope_c_per_min)
    parts = []
    for x, (low, high), (first, last) in zip((t, r), sides, limits, strict=True):
        part = np.ones(x.size)
        if low > first:
            part = np.minimum(part, (x - low) / (high - low))
        if high < last:
            part = np.minimum(part, (high - x) / (high - low))
        parts.append(np.maximum(part, 0.0))
    return np.minimum(parts[0][:, None], parts[1][None, :])
