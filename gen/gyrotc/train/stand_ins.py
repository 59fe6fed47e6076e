"""What a term of a channel adds on average while its channel is not known: a network of temperature and its rate.

It is fitted to what map and other terms leave of the training samples, so that map and stand-in together are the best
correction of one thermometer that these samples give. The fit is that of a map, which takes no more Gaussians than
the noise can tell.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..model import Model
from .data import TrainingData
from .evidence import TrainingFailed
from .methods import fit
from .result import predict, rescaled, snapped
from .uncertainty import of_few

__all__ = ["StandIn", "stand_in_of"]


_METHODS = ("mrbf", "linear", "constant")  # the first whose map keeps to the samples


@dataclass(frozen=True, slots=True)
class StandIn:
    """What stands for a term.

    Attributes:
        network: As `model.json` has it, in the scale of the model.
        added: What it adds at every training sample, deg/h, shape (n,).
        sigma_dph: 1 σ of what the term would have added about it, at the next power-on.
    """

    network: dict[str, Any]
    added: FloatArray
    sigma_dph: float


def stand_in_of(model: Model, samples: TrainingData, effect: FloatArray) -> StandIn | None:
    """The stand-in of a term; None where nothing can be fitted.

    Args:
        model: The model with its map.
        samples: Those that the map was trained on, without what the terms add.
        effect: What the term adds at these samples, deg/h; NaN where its channel is not known, shape (n,).
    """
    known = np.isfinite(effect)
    seen = samples.select(known)
    of_map = model.map_dph(seen.temperature_c, seen.slope_c_per_min)
    target = replace(seen, bias_dph=seen.bias_dph - of_map + effect[known])
    scale = model.to_dict()["scale"]
    for method in _METHODS:
        try:
            found = fit(target, method=method, average_s=model.average_s)
        except TrainingFailed:
            continue
        if any(finding["id"] == "map_beyond_data" for finding in found.findings):
            continue
        added = predict(found, samples.temperature_c, samples.slope_c_per_min)
        network = snapped(rescaled(found.networks[0], found.scale, scale), scale)
        return StandIn(network, added, _next_rms(effect[known] - added[known], seen.run))
    return None


def _next_rms(left: FloatArray, run: NDArray[np.int64]) -> float:
    """RMS to expect at the next power-on: spread within the runs, and of their means as few runs show it."""
    _, index, count = np.unique(run, return_inverse=True, return_counts=True)
    mean = np.bincount(index, left) / count
    within = float(np.mean((left - mean[index]) ** 2))
    n = len(count)
    between = float(np.var(mean, ddof=1)) * (1.0 + 1.0 / n) * of_few(n) if n > 1 else float(mean[0] ** 2)
    return float(np.sqrt(within + between))
