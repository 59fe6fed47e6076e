"""Noise of block means: covariance models, the grid of colours, the declared noise, whitening.

A colour is white noise of standard deviation 1 (of block means) plus a slow part; the scale is estimated
for each colour (`search`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from ..common.arrays import FloatArray
from ..recordings.records import Dataset

_FLICKER_S = tuple(100.0 * 4.0**k for k in range(6))  # s, from one block to a day


@dataclass(frozen=True, slots=True)
class Colour:
    """A covariance model of block means, up to its scale.

    Attributes:
        white: Variance of the white part, of block means.
        slow: Variance of the Markov part before averaging.
        tau_s: Correlation time of the Markov part, s; 0: flicker (`flicker_row`).
        walk: Variance that a rate random walk gathers in an hour.
        quantum: Variance of the angle at each edge of a block, over block_s².
    """

    white: float = 1.0
    slow: float = 0.0
    tau_s: float = 1.0
    walk: float = 0.0
    quantum: float = 0.0

    def matrix(self, number: NDArray[np.int64], block_s: float) -> FloatArray:
        """Covariance of the blocks `number` of one run, shape (n, n)."""
        lags = np.arange(int(number[-1]) - int(number[0]) + 1 if number.size else 0)
        row = np.where(lags == 0, self.white, 0.0)
        if self.slow:
            one = flicker_row(lags, block_s) if self.tau_s == 0.0 else markov_row(lags, block_s, self.tau_s)
            row = row + self.slow * one
        row = row + self.quantum * np.where(lags == 0, 2.0, np.where(lags == 1, -1.0, 0.0))
        cov = row[np.abs(number[:, None] - number[None, :])]
        if self.walk:
            middle = (number + 0.5) * (block_s / 3600.0)
            cov = cov + self.walk * np.minimum(middle[:, None], middle[None, :])
        return np.asarray(cov)


def markov_row(lags: NDArray[np.int64], block_s: float, tau_s: float) -> FloatArray:
    """Covariance of block means of a Markov process of variance 1, by lag in blocks."""
    x = block_s / tau_s
    own = 2.0 * (x + np.expm1(-x)) / x**2
    other = (np.expm1(-x) / x) ** 2 * np.exp(-np.maximum(lags - 1, 0) * x)
    return np.asarray(np.where(lags == 0, own, other))


def flicker_row(lags: NDArray[np.int64], block_s: float) -> FloatArray:
    """Return the covariances of flicker noise: equal Markov processes, correlation times in steps of a factor 4."""
    return np.asarray(sum(markov_row(lags, block_s, tau) for tau in _FLICKER_S))


def _grid() -> tuple[Colour, ...]:
    out = [Colour()]
    for tau, ratios in (
        (400.0, (0.25, 0.5)),
        (1500.0, (0.15, 0.25, 0.4, 0.7)),
        (5000.0, (0.1, 0.17, 0.27, 0.45, 0.8)),
        (20000.0, (0.1, 0.2, 0.35, 0.7)),
        (0.0, (0.06, 0.1, 0.16, 0.28, 0.5)),
    ):
        out += [Colour(slow=r**2, tau_s=tau) for r in ratios]
    out += [Colour(walk=w**2) for w in (0.1, 0.2, 0.4)]
    for white, quantum in ((0.4, 0.3), (0.1, 0.45)):
        out += [Colour(white=white, quantum=quantum)]
        out += [Colour(white=white, quantum=quantum, slow=r**2, tau_s=0.0) for r in (0.02, 0.05, 0.12)]
        out += [Colour(white=white, quantum=quantum, slow=r**2, tau_s=20000.0) for r in (0.05, 0.15)]
    return tuple(out)


NOISE_COLOURS: tuple[Colour, ...] = _grid()


@dataclass(frozen=True, slots=True)
class Declared:
    """Noise that a unit is declared to have (IEEE Std 647): N deg/√h, B and K deg/h(/√h), quantum in arcsec."""

    arw_deg_per_sqrt_h: float
    bias_instability_dph: float = 0.0
    rate_random_walk_dph_per_sqrt_h: float = 0.0
    quantum_arcsec: float = 0.0

    def colour(self, block_s: float) -> Colour:
        """Covariance of block means in (deg/h)², scale included.

        White: N² 3600/block_s. Flicker: B²/(2π f) is the sum of Markov processes of variance
        B² ln 4/π each, in steps of a factor 4. Quantisation: rounding error uniform over one count, q²/12 at each edge.
        """
        return Colour(
            white=self.arw_deg_per_sqrt_h**2 * 3600.0 / block_s,
            slow=self.bias_instability_dph**2 * np.log(4.0) / np.pi,
            tau_s=0.0,
            walk=self.rate_random_walk_dph_per_sqrt_h**2,
            quantum=(self.quantum_arcsec / block_s) ** 2 / 12.0,
        )


def declared_noise(dataset: Dataset) -> Declared | None:
    """Declared noise with a white part; without one there is nothing to compare with."""
    noise = dataset.noise
    if noise is None or not noise.arw_deg_per_sqrt_h:
        return None
    return Declared(
        noise.arw_deg_per_sqrt_h,
        noise.bias_instability_dph or 0.0,
        noise.rate_random_walk_dph_per_sqrt_h or 0.0,
        noise.quantum_arcsec or 0.0,
    )


NOISE_WORDS: dict[str, str] = {
    "noise_level": "The noise has another level than declared",
    "noise_colour": "The noise has another colour than declared",
    "noise_variance": "The noise varies with temperature, ramp rate or time since power-on",
    "outliers": "Rows are outliers",
    "temperature_quantisation": "The temperature is recorded in coarse steps",
}


class Whitener:
    """Multiplies joined block data by the inverse Cholesky factor of a colour, run by run.

    Args:
        colour: The covariance model.
        blocks: Numbers of the used blocks, per run.
        block_s: Length of a block, s.
        sigma: Factor of the standard deviation of every block, shape (N,); None: 1.
    """

    def __init__(
        self,
        colour: Colour,
        blocks: Sequence[NDArray[np.int64]],
        block_s: float,
        sigma: FloatArray | None = None,
    ) -> None:
        self._sigma = sigma
        made: dict[bytes, FloatArray] = {}
        self._factors: list[tuple[slice, FloatArray]] = []
        at = 0
        for number in blocks:
            key = (number if colour.walk else number - number[0]).tobytes()
            if key not in made:
                made[key] = cholesky(colour.matrix(number, block_s), lower=True, check_finite=False)
            self._factors.append((slice(at, at + number.size), made[key]))
            at += number.size
        self.log_det = 2.0 * sum(float(np.log(np.diag(f)).sum()) for _, f in self._factors)
        if sigma is not None:
            self.log_det += 2.0 * float(np.log(sigma).sum())

    def __call__(self, data: FloatArray) -> FloatArray:
        """Whitened data L⁻¹ x, shape as given, (N,) or (N, k)."""
        return self._solve(self._scaled(data), 0)

    def back(self, white: FloatArray) -> FloatArray:
        """L⁻ᵀ w: applied to whitened data it gives the data times the inverse covariance."""
        return self._scaled(self._solve(white, 1))

    def colour(self, white: FloatArray) -> FloatArray:
        """L w: noise with this covariance from white noise, shape (N, k)."""
        out = np.empty_like(white)
        for part, factor in self._factors:
            out[part] = factor @ white[part]
        return out if self._sigma is None else np.asarray(out * self._sigma[:, None])

    def _scaled(self, data: FloatArray) -> FloatArray:
        if self._sigma is None:
            return data
        return np.asarray(data / (self._sigma if data.ndim == 1 else self._sigma[:, None]))

    def _solve(self, data: FloatArray, transposed: int) -> FloatArray:
        out = np.empty_like(data)
        for part, factor in self._factors:
            out[part] = solve_triangular(factor, data[part], lower=True, trans=transposed, check_finite=False)
        return out
