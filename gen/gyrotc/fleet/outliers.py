"""Serials that differ from the rest of their fleet: robust distance of each figure from the fleet's median."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from ..common.metrics import MAD_TO_SIGMA
from ..results.fleet import FleetOutlier, FleetUnit, Spread

__all__ = ["FIGURES", "outliers", "spread"]

#: Figures that are looked at, and whether they are compared by their ratio (logarithm).
FIGURES = {
    "before_rms_dph": True,
    "after_rms_dph": True,
    "rms_over_floor": True,
    "noise_floor_dph": True,
    "bias_dph": False,
    "after_mean_dph": False,
}
_LEAST = 8  # fewer serials do not say what a usual one is
_SIGMAS = 5.0  # once in two million normal figures: of a thousand gyros with six figures none by chance
_LEAST_OF_RMS = 0.1  # of the others, in shares of what usually remains: means of 1e-9 deg/h say nothing
_LEAST_RATIO = 0.02  # of figures compared by their ratio: closer ones are alike, however close the others are


def spread(entries: Sequence[FleetUnit], figure: str) -> Spread | None:
    """Median, least and largest value of a figure; None where no serial has it."""
    values = [float(value) for entry in entries if (value := getattr(entry, figure)) is not None]
    if not values:
        return None
    return Spread(median=float(np.median(values)), least=min(values), largest=max(values))


def outliers(entries: Sequence[FleetUnit]) -> list[FleetOutlier]:
    """Serials that stand apart from those of their axis, each with each figure that does, the farthest first."""
    kinds: dict[str | None, list[FleetUnit]] = defaultdict(list)
    for entry in entries:
        kinds[entry.axis].append(entry)
    found = [outlier for kind in kinds.values() for outlier in _of_kind(kind)]
    return sorted(found, key=lambda o: (-o.sigmas, o.name))


def _of_kind(entries: Sequence[FleetUnit]) -> list[FleetOutlier]:
    found = []
    usual = spread(entries, "after_rms_dph")
    usual_rms = usual.median if usual else 0.0
    for figure, by_ratio in FIGURES.items():
        known = [(e.name, v) for e in entries if (v := getattr(e, figure)) is not None]
        known = [(name, v) for name, v in known if v > 0.0 or not by_ratio]
        if len(known) < _LEAST:
            continue
        values = np.array([value for _, value in known])
        scaled = np.log(values) if by_ratio else values
        apart = np.abs(scaled - np.median(scaled))
        sigma = max(
            MAD_TO_SIGMA * float(np.median(apart)),
            _LEAST_RATIO / _SIGMAS if by_ratio else _LEAST_OF_RMS / _SIGMAS * usual_rms,
        )
        if sigma == 0.0:
            continue
        found += [
            FleetOutlier(
                name=name,
                figure=figure,
                value=float(value),
                median=float(np.median(values)),
                sigmas=float(distance / sigma),
            )
            for (name, value), distance in zip(known, apart, strict=True)
            if distance > _SIGMAS * sigma
        ]
    return found
