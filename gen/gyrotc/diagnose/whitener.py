"""Whitening of block means: noise of any colour becomes white noise of standard deviation 1."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from ..common.arrays import FloatArray
from .colours import Colour

__all__ = ["Whitener"]


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
        self._blocks = blocks
        factors: dict[bytes, FloatArray] = {}
        for number in blocks:
            key = (number - number[0]).tobytes() if not colour.walk else number.tobytes()
            if key not in factors:
                factors[key] = cholesky(colour.matrix(number, block_s), lower=True, check_finite=False)
        self._factor = [factors[(n - n[0]).tobytes() if not colour.walk else n.tobytes()] for n in blocks]
        self.log_det = 2.0 * sum(float(np.log(np.diag(f)).sum()) for f in self._factor)
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
        at = 0
        for factor in self._factor:
            part = slice(at, at + len(factor))
            out[part] = factor @ white[part]
            at += len(factor)
        return out if self._sigma is None else np.asarray(out * self._sigma[:, None])

    def _scaled(self, data: FloatArray) -> FloatArray:
        if self._sigma is None:
            return data
        return np.asarray(data / (self._sigma if data.ndim == 1 else self._sigma[:, None]))

    def _solve(self, data: FloatArray, transposed: int) -> FloatArray:
        out = np.empty_like(data)
        at = 0
        for factor in self._factor:
            part = slice(at, at + len(factor))
            out[part] = solve_triangular(factor, data[part], lower=True, trans=transposed, check_finite=False)
            at += len(factor)
        return out
