"""Means of a fully calibrated unit: what a lot is learnt from, and what an earlier map is compared with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...common.arrays import BoolArray, FloatArray
from ...common.errors import InputError
from ...results.training import MapMeans
from ..data import Scaling, TrainingData, average_samples, gather
from ..noise import difference_sigma
from ..process import MEAN_S, Process

_SPREAD_GRID = 2.0**30  # of a spread: as many digits as a file holds


@dataclass(frozen=True, slots=True)
class UnitMeans:
    """A fully calibrated unit.

    Attributes:
        temperature_c, slope_c_per_min, bias_dph: Gathered means, shape (means,).
        count: Independent means behind each, the same shape.
        sigma_dph: Noise of a mean of count 1, deg/h.
        power_on: Number of the power-on of each, the same shape; None: they are of one.
    """

    temperature_c: FloatArray
    slope_c_per_min: FloatArray
    bias_dph: FloatArray
    count: FloatArray
    sigma_dph: float
    power_on: NDArray[np.int64] | None = None

    def select(self, mask: BoolArray) -> UnitMeans:
        """Return some of the means."""
        power_on = None if self.power_on is None else self.power_on[mask]
        arrays = self.temperature_c[mask], self.slope_c_per_min[mask], self.bias_dph[mask], self.count[mask]
        return UnitMeans(*arrays, self.sigma_dph, power_on)

    def power_ons(self) -> list[UnitMeans]:
        """Return the means of each power-on."""
        if self.power_on is None:
            return [self]
        return [self.select(self.power_on == number) for number in np.unique(self.power_on)]


def means_of_unit(
    samples: TrainingData, scaling: Scaling, process: Process | None, power_on: NDArray[np.int64] | None = None
) -> tuple[UnitMeans, float]:
    """Means over 50 s of cleaned samples, gathered into cells of 1/50 of each half range; and their length, s.

    Args:
        scaling: Normalisation of the cells.
        process: What the outliers were found by and the noise is known from; None: nothing is left out, and the noise
            is that of differences. Noise that differences do not show (a drift) shows in what a process leaves, and
            how many means count as one, because their noise is correlated.
        power_on: Number of the power-on of each run, by its index: means of two are not gathered; None: all are.
    """
    means = average_samples(samples, MEAN_S)
    weight = means.weight / np.median(means.weight)
    sigma = difference_sigma(means, means.bias_dph, weight)
    kept, colour = np.ones(len(means), dtype=bool), 1.0
    if process is not None and len(process.kept) == len(means):
        kept, sigma, colour = process.kept, max(sigma, process.noise_dph), process.colour
    t, r = scaling.normalise(means.temperature_c[kept], means.slope_c_per_min[kept])
    bias = means.bias_dph[kept]
    number = np.zeros(len(bias), dtype=np.int64) if power_on is None else power_on[means.run[kept]]
    masks = {int(n): number == n for n in np.unique(number)}
    parts = {n: gather(t[own], r[own], bias[own], weight[kept][own]) for n, own in masks.items()}
    bins_t, bins_r, mean, count = (
        np.concatenate([getattr(part, name) for part in parts.values()]) for name in ("t", "r", "mean", "count")
    )
    sigma = sigma or max(float(np.std(bias)), abs(float(bias[0])) / _SPREAD_GRID, 1e-12)  # a record without noise
    found = UnitMeans(
        temperature_c=bins_t * scaling.half_range_c + scaling.center_c,
        slope_c_per_min=bins_r * scaling.half_range_c_per_min,
        bias_dph=mean,
        count=count / colour,
        sigma_dph=sigma,
        power_on=None if power_on is None else np.repeat([*parts], [len(part.mean) for part in parts.values()]),
    )
    return found, float(np.median(means.duration_s))


def means_of(means: MapMeans | None, where: Path) -> UnitMeans:
    """Means of a unit as arrays.

    Args:
        where: The `training.json` that they are of.

    Raises:
        InputError: There are none, or they do not go together.
    """
    if means is None:
        raise InputError(
            str(where),
            "has no means (an extended model, or an earlier gyrotc)",
            "a unit as gyrotc fleet or build makes it: give that command again",
        )
    arrays = [np.array(x) for x in (means.temperature_c, means.slope_c_per_min, means.bias_dph, means.count)]
    if len({len(x) for x in arrays}) != 1 or len(arrays[0]) == 0 or arrays[3].min() <= 0.0:
        raise InputError(f"{where}, field means", "lists that do not go together", "one of each a mean")
    return UnitMeans(arrays[0], arrays[1], arrays[2], arrays[3], means.sigma_dph)
