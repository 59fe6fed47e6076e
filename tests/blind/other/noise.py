"""Noise with a spectrum of 1/f^alpha beside a white one, made by its spectrum, and the covariance of its means."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_LONGER = 4  # the spectrum is made over so many times the record: its slowest parts go on beyond both ends


@dataclass(frozen=True)
class PowerLaw:
    """Two-sided density white² · 100 s · (1 + (corner/f)^alpha), (deg/h)²/Hz.

    Attributes:
        white_dph: Standard deviation of 100-s means without the coloured part, deg/h.
        corner_hz: Where both parts are alike.
        alpha: Exponent of the coloured part.
    """

    white_dph: float
    corner_hz: float
    alpha: float

    def density(self, f: Array) -> Array:
        """At frequencies f > 0, Hz."""
        return 100.0 * self.white_dph**2 * (1.0 + (self.corner_hz / f) ** self.alpha)

    def sheet(self) -> dict[str, float]:
        """What a data sheet would say: angle random walk, and the bias instability that has this density at 1 mHz."""
        slow = float(self.density(np.array([1e-3]))[0]) - 100.0 * self.white_dph**2
        return {
            "arw_deg_per_sqrt_h": self.white_dph * (100.0 / 3600.0) ** 0.5,
            "bias_instability_dph": float(np.sqrt(2.0 * np.pi * 1e-3 * slow)),
        }


def draw_noise(rng: np.random.Generator) -> PowerLaw:
    """White noise over a factor of three; the coloured part begins to lead at three minutes to five hours."""
    white = float(np.exp(rng.uniform(np.log(4e-4), np.log(1.2e-3))))
    corner = float(np.exp(rng.uniform(np.log(5e-5), np.log(1e-3))))
    return PowerLaw(white, corner, float(rng.uniform(0.5, 1.5)))


def draw(noise: PowerLaw, seconds: int, rng: np.random.Generator) -> Array:
    """One realisation at 1 s, deg/h."""
    n = 1 << int(np.ceil(np.log2(_LONGER * seconds)))
    f = np.fft.rfftfreq(n, 1.0)
    size = np.sqrt(noise.density(f[1:]) * n / 2.0)
    spectrum = np.r_[0.0, size * (rng.standard_normal(f.size - 1) + 1j * rng.standard_normal(f.size - 1))]
    return np.fft.irfft(spectrum, n)[:seconds]


def covariance(noise: PowerLaw, blocks: int, block_s: int) -> Array:
    """Covariance of consecutive means, (deg/h)², from the same spectrum."""
    n = 1 << int(np.ceil(np.log2(_LONGER * blocks * block_s)))
    f = np.fft.rfftfreq(n, 1.0)[1:]
    averaged = noise.density(f) * np.sinc(f * block_s) ** 2
    row = np.fft.irfft(np.r_[0.0, averaged], n)[: blocks * block_s : block_s]
    k = np.arange(blocks)
    return np.asarray(row[np.abs(k[:, None] - k[None, :])])
