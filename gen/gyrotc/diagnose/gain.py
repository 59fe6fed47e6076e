"""The gain of an extension on runs that its choice has not seen, with intervals.

Share of removable excess: (before² − after²)/(before² − floor²), RMS of means over `average_s`. Intervals
come from drawing half-hours of the scored runs again (a paired bootstrap).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..metrics import Averages, time_statistics

__all__ = ["Gain", "floor_of", "gain_of"]

Array = NDArray[np.float64]

_PIECE_S = 1800.0
_DRAWS = 1000


@dataclass(frozen=True)
class Gain:
    """Before and after, deg/h and arcsec, on the same samples."""

    rms_before: float
    rms_after: float
    share: float | None
    low: float | None
    high: float | None
    difference_low: float
    angle_before: float | None
    angle_after: float | None
    half_hour_before: float | None
    half_hour_after: float | None

    @property
    def positive(self) -> bool:
        """Whether the lower 95 % limit of before² − after² is above zero."""
        return self.difference_low > 0.0

    def to_dict(self) -> dict[str, Any]:
        return {
            "exam_rms_before_dph": self.rms_before,
            "exam_rms_after_dph": self.rms_after,
            "share_of_excess_removed": self.share,
            "low": self.low,
            "high": self.high,
            "angle_1h_before_arcsec": self.angle_before,
            "angle_1h_after_arcsec": self.angle_after,
            "rms_30min_before_dph": self.half_hour_before,
            "rms_30min_after_dph": self.half_hour_after,
        }


def floor_of(runs: Sequence[Averages]) -> float:
    """Noise floor from first differences of the averaged residuals, robust, deg/h."""
    steps = np.concatenate([np.diff(r.after_dph) for r in runs if r.after_dph.size > 1] or [np.zeros(1)])
    return float(1.4826 * np.median(np.abs(steps - np.median(steps))) / np.sqrt(2.0))


def gain_of(
    before: Sequence[Averages], after: Sequence[Averages], floor: float, average_s: float, seed: int = 1
) -> Gain:
    """Compares two sets of residuals on the same samples."""
    b2, a2, weight = _pieces(before, after, average_s)
    total = weight.sum()
    rms_b, rms_a = float(np.sqrt(b2.sum() / total)), float(np.sqrt(a2.sum() / total))
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, weight.size, (_DRAWS, weight.size))
    n = weight[drawn].sum(axis=1)
    diff = (b2 - a2)[drawn].sum(axis=1) / n
    excess = rms_b**2 - floor**2
    share = low = high = None
    if excess > 0.02 * floor**2:
        shares = diff / excess
        share = (rms_b**2 - rms_a**2) / excess
        low, high = (float(v) for v in np.quantile(shares, [0.025, 0.975]))
    return Gain(
        rms_b,
        rms_a,
        share,
        low,
        high,
        float(np.quantile(diff, 0.025)),
        _pooled(before, average_s, "angle_1h_arcsec"),
        _pooled(after, average_s, "angle_1h_arcsec"),
        _pooled(before, average_s, "rms_30min_dph"),
        _pooled(after, average_s, "rms_30min_dph"),
    )


def _pieces(
    before: Sequence[Averages], after: Sequence[Averages], average_s: float
) -> tuple[Array, Array, Array]:
    """Sums of squares before and after, and number of samples, of half-hour pieces."""
    size = max(round(_PIECE_S / average_s), 1)
    b2, a2, weight = [], [], []
    for x, y in zip(before, after, strict=True):
        cuts = np.arange(0, x.after_dph.size, size)
        b2.append(np.add.reduceat(x.after_dph**2, cuts))
        a2.append(np.add.reduceat(y.after_dph**2, cuts))
        weight.append(np.diff(np.append(cuts, x.after_dph.size)))
    return np.concatenate(b2), np.concatenate(a2), np.concatenate(weight).astype(float)


def _pooled(runs: Sequence[Averages], average_s: float, name: str) -> float | None:
    """RMS over the runs of one of their figures."""
    values = [time_statistics(r, average_s)[name] for r in runs]
    squares = [v**2 for v in values if v is not None]
    return float(np.sqrt(np.mean(squares))) if squares else None
