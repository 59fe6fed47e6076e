"""Noise of the angle that a gyro gathers, cell by cell and between their edges, in the terms of IEEE Std 647."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from ..common.arrays import FloatArray
from .grid import CELL_S, REFERENCE_C
from .scenario import NoiseLevels

_SPREAD = 10.0**0.5  # ratio of neighbouring correlation times in the flicker noise


@dataclass(frozen=True, slots=True)
class CellNoise:
    """Noise of the angle in one run, without quantisation.

    Attributes:
        angle_arcsec: Angle gathered in each cell, shape (cells,).
        white_arcsec: Standard deviation of its white part, shape (cells,).
    """

    angle_arcsec: FloatArray
    white_arcsec: FloatArray


def cell_noise(
    seeds: np.random.SeedSequence, levels: NoiseLevels, temperature_c: FloatArray, slope_c_per_min: FloatArray
) -> CellNoise:
    """Draw the noise of a run from the temperatures (C) and rates (C/min) of its cells, shape (cells,) each."""
    cells = len(temperature_c)
    white, flicker, walk, kicks = (np.random.default_rng(child) for child in seeds.spawn(4))
    sigma = white_sigma_arcsec(levels, temperature_c, slope_c_per_min)
    angle = sigma * white.standard_normal(cells)
    if levels.bias_instability_dph:
        angle += CELL_S * _flicker_dph(flicker, cells, levels.bias_instability_dph)
    if levels.rate_random_walk_dph_per_sqrt_h:
        step = levels.rate_random_walk_dph_per_sqrt_h * np.sqrt(CELL_S / 3600.0)
        angle += CELL_S * np.cumsum(walk.normal(0.0, step, cells))
    if levels.outliers_per_h:
        hit = kicks.random(cells) < levels.outliers_per_h * CELL_S / 3600.0
        size = kicks.uniform(0.5, 1.5, cells) * kicks.choice([-1.0, 1.0], cells)
        angle += np.where(hit, levels.outlier_arcsec * size, 0.0)
    return CellNoise(angle, sigma)


def white_sigma_arcsec(levels: NoiseLevels, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> FloatArray:
    """Return the standard deviation of the angle random walk of each cell, arcsec, shape (cells,).

    It grows by a share for each C above 20 C (below, if the share is negative) and each C/min of heating or cooling.
    """
    growth = (
        1.0
        + levels.arw_growth_per_c * (temperature_c - REFERENCE_C)
        + levels.arw_growth_per_c_per_min * np.abs(slope_c_per_min)
    )
    return np.asarray(levels.arw_deg_per_sqrt_h * 3600.0 * np.sqrt(CELL_S / 3600.0) * np.maximum(growth, 0.1))


def _flicker_dph(rng: np.random.Generator, cells: int, bias_instability_dph: float) -> FloatArray:
    """Draw flicker noise with spectral density B²/(2π f) (two-sided), a sum of Markov processes, shape (cells,).

    The correlation times go from a cell to ten times the record, evenly in their logarithm; the variance of each is
    B² ln(ratio)/π, so that the Allan deviation stands at √(2 ln 2/π) B between both ends.
    """
    count = int(np.ceil(np.log(10.0 * cells) / np.log(_SPREAD))) + 1
    sigma = bias_instability_dph * np.sqrt(np.log(_SPREAD) / np.pi)
    total = np.zeros(cells)
    for index in range(count):
        decay = float(np.exp(-(_SPREAD**-index)))
        start = rng.normal(0.0, sigma)
        steps = rng.normal(0.0, sigma * np.sqrt(1.0 - decay**2), cells)
        total += lfilter([1.0], [1.0, -decay], steps, zi=[decay * start])[0]
    return total


def bridge_arcsec(rng: np.random.Generator, parts: int, white_arcsec: FloatArray) -> FloatArray:
    """Draw the deviation of the white angle from even growth at the inner edges of cells, shape (cells, parts − 1).

    It is a Brownian bridge: with the even growth added it is a random walk with `white_arcsec` for a whole cell.
    """
    steps = rng.standard_normal((len(white_arcsec), parts), dtype=np.float32)
    steps -= steps.mean(axis=1, keepdims=True)
    walk = np.cumsum(steps[:, :-1], axis=1, dtype=np.float64)
    return np.asarray(walk * (white_arcsec[:, None] / np.sqrt(parts)))


def quantised(angle_arcsec: FloatArray, quantum_arcsec: float, phase: FloatArray) -> FloatArray:
    """Return the angle as it is read in steps of the quantum while dither moves it, the known dither taken off.

    `phase` is the dither at the readings in quanta, uniform over 0 ... 1. The error is uniform over one quantum and
    independent from reading to reading: IEEE's Q = quantum/√12.
    """
    return np.asarray(quantum_arcsec * (np.floor(angle_arcsec / quantum_arcsec + phase) - phase + 0.5))
