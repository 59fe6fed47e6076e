"""Noise of a gyro at 1 s: white and Markov rates summed to an angle, dithered, quantised, differenced.

The covariance that the grader uses is worked out here too, for block means, from the same parts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
_OCTAVES = tuple(200.0 * 4.0**k for k in range(5))  # correlation times of the flicker sum, s


@dataclass(frozen=True)
class Noise:
    """What is really added. Units: white as standard deviation of 100-s means (deg/h)."""

    white_dph: float
    flicker_dph: float = 0.0  # each of the Markov processes of the sum, deg/h
    walk_dph: float = 0.0  # rate random walk, deg/h per sqrt(h)
    quantum_arcsec: float = 0.0

    def declared(self) -> dict[str, float]:
        """As a data sheet says it, in the units of IEEE Std 647.

        Equal Markov processes s, spaced by a factor 4 in correlation time, sum to the two-sided spectral
        density s²/(2 ln(4) f); flicker noise is B²/(2π f), so B² = π s²/ln 4.
        """
        out = {"arw_deg_per_sqrt_h": self.white_dph * (100.0 / 3600.0) ** 0.5}
        if self.flicker_dph:
            out["bias_instability_dph"] = self.flicker_dph * (np.pi / np.log(4.0)) ** 0.5
        if self.walk_dph:
            out["rate_random_walk_dph_per_sqrt_h"] = self.walk_dph
        if self.quantum_arcsec:
            out["quantum_arcsec"] = self.quantum_arcsec
        return out


def draw(noise: Noise, seconds: int, rng: np.random.Generator) -> Array:
    """One realisation, deg/h, one value per second."""
    rate = rng.normal(0.0, noise.white_dph * 10.0, seconds)
    if noise.flicker_dph:
        for tau in _OCTAVES:
            keep = np.exp(-1.0 / tau)
            kick = rng.normal(0.0, noise.flicker_dph * np.sqrt(1 - keep**2), seconds)
            kick[0] = rng.normal(0.0, noise.flicker_dph)
            rate += lfilter([1.0], [1.0, -keep], kick)
    if noise.walk_dph:
        rate += np.cumsum(rng.normal(0.0, noise.walk_dph / 60.0, seconds))
    if noise.quantum_arcsec:
        angle = np.concatenate([[0.0], np.cumsum(rate)])  # 1 deg/h = 1 arcsec/s
        shake = rng.uniform(-4.0, 4.0, angle.size)  # mechanical dither in counts, taken out again by the gyro
        counts = np.round(angle / noise.quantum_arcsec + shake) - shake
        rate = np.diff(counts) * noise.quantum_arcsec
    return np.asarray(rate)


def covariance(noise: Noise, blocks: int, block_s: float) -> Array:
    """Covariance of the means over consecutive blocks, (deg/h)²."""
    k = np.arange(blocks)
    row = np.where(k == 0, noise.white_dph**2 * 100.0 / block_s, 0.0)
    if noise.flicker_dph:
        for tau in _OCTAVES:
            x = block_s / tau
            own = 2.0 / x**2 * (x - 1.0 + np.exp(-x))
            other = (1.0 - np.exp(-x)) ** 2 / x**2 * np.exp(-(np.maximum(k, 1) - 1) * x)
            row = row + noise.flicker_dph**2 * np.where(k == 0, own, other)
    if noise.quantum_arcsec:
        # Rounding to one count: variance q²/12 at each edge of a block.
        edge = noise.quantum_arcsec**2 / 12.0 / block_s**2
        row = row + np.where(k == 0, 2 * edge, np.where(k == 1, -edge, 0.0))
    cov = row[np.abs(k[:, None] - k[None, :])]
    if noise.walk_dph:
        middle = (np.minimum(k[:, None], k[None, :]) + 0.5) * block_s / 3600.0
        cov = cov + noise.walk_dph**2 * middle
    return np.asarray(cov)
