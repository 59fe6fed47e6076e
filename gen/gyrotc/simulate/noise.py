"""Noise of the measured rate, in the terms of IEEE Std 647 (annex C): angle random walk, bias instability, rate random walk.

Everything is made once a second (a cell), whatever the rows are; finer rows divide a cell's angle by a bridge. So the
same seed gives the same angle at every full second for every row length. 1 deg/h is 1 arcsec/s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

if TYPE_CHECKING:
    from .scenario import NoiseLevels

__all__ = ["angle_arcsec", "bridge_arcsec", "flicker_dph", "quantised", "walk_dph", "white_sigma_arcsec"]

Array = NDArray[np.float64]

CELL_S = 1.0
_SPREAD = 10.0**0.5  # ratio of neighbouring correlation times in the flicker noise


def white_sigma_arcsec(arw_deg_per_sqrt_h: float) -> float:
    """Standard deviation of the angle that a random walk gathers in one cell, arcsec."""
    return float(arw_deg_per_sqrt_h * 3600.0 * np.sqrt(CELL_S / 3600.0))


def flicker_dph(rng: np.random.Generator, cells: int, bias_instability_dph: float) -> Array:
    """Flicker noise with spectral density B²/(2π f) (two-sided), a sum of Markov processes, shape (cells,).

    Correlation times from a cell to ten times the record, evenly in their logarithm; the variance of each is
    B² ln(ratio)/π, so that the Allan deviation stands at √(2 ln 2/π) B between both ends.
    """
    count = int(np.ceil(np.log(10.0 * cells) / np.log(_SPREAD))) + 1
    sigma = bias_instability_dph * np.sqrt(np.log(_SPREAD) / np.pi)
    total = np.zeros(cells)
    for index in range(count):
        decay = np.exp(-1.0 / _SPREAD**index)
        start = rng.normal(0.0, sigma)
        steps = rng.normal(0.0, sigma * np.sqrt(1.0 - decay**2), cells)
        total += lfilter([1.0], [1.0, -decay], steps, zi=[decay * start])[0]
    return total


def walk_dph(rng: np.random.Generator, cells: int, k_dph_per_sqrt_h: float) -> Array:
    """Rate random walk that starts at 0, shape (cells,), deg/h."""
    return np.cumsum(rng.normal(0.0, k_dph_per_sqrt_h * np.sqrt(CELL_S / 3600.0), cells))


def angle_arcsec(seeds: np.random.SeedSequence, levels: NoiseLevels, cells: int) -> Array:
    """Angle of all noise (without quantisation) gathered in each cell, arcsec, shape (cells,)."""
    white, flicker, walk = (np.random.default_rng(child) for child in seeds.spawn(3))
    total = white_sigma_arcsec(levels.arw_deg_per_sqrt_h) * white.standard_normal(cells)
    if levels.bias_instability_dph:
        total += CELL_S * flicker_dph(flicker, cells, levels.bias_instability_dph)
    if levels.rate_random_walk_dph_per_sqrt_h:
        total += CELL_S * walk_dph(walk, cells, levels.rate_random_walk_dph_per_sqrt_h)
    return total


def bridge_arcsec(rng: np.random.Generator, cells: int, parts: int, sigma_arcsec: float) -> Array:
    """How the white angle of a cell departs, at the inner edges, from growing evenly, shape (cells, parts − 1).

    A Brownian bridge: with the even growth added it is a random walk with `sigma_arcsec` for a whole cell.
    """
    steps = rng.standard_normal((cells, parts), dtype=np.float32)
    steps -= steps.mean(axis=1, keepdims=True)
    return np.cumsum(steps[:, :-1], axis=1, dtype=np.float64) * (sigma_arcsec / np.sqrt(parts))


def quantised(angle_arcsec: Array, quantum_arcsec: float, phase: Array) -> Array:
    """Angle as read in steps of the quantum while dither moves it; the known dither is taken off again.

    `phase`: dither at the readings, quanta, uniform over 0 ... 1. The error is uniform over one quantum and
    independent from reading to reading: IEEE's Q = quantum/√12.
    """
    return quantum_arcsec * (np.floor(angle_arcsec / quantum_arcsec + phase) - phase + 0.5)
