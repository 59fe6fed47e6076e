"""How large a cause may be: it does not change the rate by far more than the rate itself changes.

Of a signature that the static map imitates all but a trace of, the trace decides the size: texture that is none of
the cause's makes a wave of half a turn over the envelope as large as one likes, and the map takes off again what the
wave adds. Such a model fits, and is no explanation; on other temperatures it goes wrong by its own size.
"""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from ..common.orthonormal import orthonormal
from .search import Search

__all__ = ["SizeLimit"]


_MOST = 2.0  # spread of a cause over that of the rate: the map may take off half of it, and not nearly all


class SizeLimit:
    """The largest effect that is believed for one search.

    Attributes:
        spread_dph: Largest standard deviation of what a cause adds to the block means, deg/h.
        noise: Scale of the whitened noise, deg/h.
    """

    def __init__(self, search: Search) -> None:
        y = search.y - np.median(search.y)
        left_out = orthonormal(search.joined.beside)  # blocks of which nothing is left have no rate
        self.spread_dph = _MOST * float(np.std(y - left_out @ (left_out.T @ y)))
        self.noise = search.likeliest.scale

    def shares(self, columns: FloatArray) -> FloatArray:
        """Share of the largest effect that a column is for a weight of 1 to whitened data over the noise scale.

        Args:
            columns: As block means, not whitened, shape (N, k).
        """
        return np.asarray(columns.std(axis=0) * self.noise / max(self.spread_dph, 1e-300))

    def allows(self, contribution: FloatArray) -> bool:
        """Whether a fitted effect, deg/h, shape (N,), is believed."""
        return bool(contribution.std() <= self.spread_dph)
