"""Serials that differ from the rest of their fleet: robust distance of each figure from the fleet's median."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...metrics import MAD_TO_SIGMA
from ...results.fleet import FleetOutlier, FleetUnit, Spread

__all__ = ["FIGURES", "outliers", "spread"]

#: Figures that are looked at, and whether they are compared by their ratio (logarithm).
FIGURES = {
    "before_rms_dph": True,
    "after_rms_dph": True,
    "rms_over_floor": True,
    "noise_floor_dph": True,
    "bias_dph": False,
    "after_mean_dph": False,
    "sum_abs_weights_dph": True,
}
_LEAST = 8  # fewer serials do not say what a usual one is
# Once in two million normal figures: of a fleet of a thousand with seven figures none by chance
_SIGMAS = 5.0
_LEAST_RATIO = 0.02  # of figures compared by their ratio: closer ones are alike, however close the others are


def spread(units: Sequence[FleetUnit], figure: str) -> Spread | None:
    """Median, least and largest value of a figure; None where no serial has it."""
    values = [value for unit in units if (value := getattr(unit, figure)) is not None]
    if not values:
        return None
    return Spread(median=float(np.median(values)), least=float(min(values)), largest=float(max(values)))


def outliers(units: Sequence[FleetUnit]) -> list[FleetOutlier]:
    """Serials that stand apart, the farthest first; each serial with each of its figures that does."""
    found: list[FleetOutlier] = []
    for figure, by_ratio in FIGURES.items():
        pairs = [(unit.name, float(value)) for unit in units if (value := getattr(unit, figure)) is not None]
        known = [(name, value) for name, value in pairs if value > 0.0 or not by_ratio]
        if len(known) < _LEAST:
            continue
        values = np.array([value for _, value in known])
        scaled = np.log(values) if by_ratio else values
        apart = np.abs(scaled - np.median(scaled))
        sigma = max(MAD_TO_SIGMA * float(np.median(apart)), _LEAST_RATIO / _SIGMAS if by_ratio else 0.0)
        if sigma == 0.0:
            continue
        median = float(np.median(values))
        found += [
            FleetOutlier(name=name, figure=figure, value=value, median=median, sigmas=float(distance / sigma))
            for (name, value), distance in zip(known, apart, strict=True)
            if distance > _SIGMAS * sigma
        ]
    return sorted(found, key=lambda o: (-o.sigmas, o.name))
