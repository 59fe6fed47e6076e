"""Does a unit fit its lot? The posterior predictive test, in the directions in which its runs say anything.

In the coordinates in which lot and noise are both diagonal, a unit of the lot has independent normal scores, whatever
its runs were. The most powerful test of a given deviation against one that is some times larger weighs their squares
by what runs can tell of each; the sum is, for a unit of the lot, a sum of weighted chi-squares.
"""

from __future__ import annotations

import numpy as np
from scipy.special import fdtrc, gammaincc

from ..common.arrays import FloatArray

__all__ = ["FALSE_ALARM", "freedom_of", "inflation", "of_few", "p_value", "scores"]


FALSE_ALARM = 0.01  # of the test: docs/lot.md
_STRANGE = (
    16.0  # a stranger's variance over the lot's, for which the test has most power: four times as far away
)
_LEAST_FREEDOM = 3  # below it Student's t has no variance, and a prior must have one
_TELLING = 1.0  # variance by the lot over variance by noise, from which on a score says how wide the lot is


def freedom_of(units: int, clusters: int, directions: int) -> float:
    """Degrees of freedom of a lot's spread: units less what was fitted to them; 3 at least."""
    return float(max(units - clusters - directions, _LEAST_FREEDOM))


def of_few(freedom: float) -> float:
    """Variance of Student's t, by which a spread that is known from few units is widened."""
    return freedom / (freedom - 2.0) if np.isfinite(freedom) else 1.0


def scores(
    precision: FloatArray, moment: FloatArray, mean: FloatArray, covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Signal-to-noise ratios of the independent directions, and the squared scores in them: 1 on average.

    Args:
        precision, moment: What the unit's recordings say (`UnitSums`), shapes (n, n) and (n,).
        mean, covariance: Of the lot, the same shapes.
    """
    factor = np.linalg.cholesky(covariance)
    ratio, vectors = np.linalg.eigh(factor.T @ precision @ factor)
    told = ratio > 1e-9 * ratio[-1]
    moved = vectors.T @ (factor.T @ (moment - precision @ mean))
    ratio, moved = ratio[told], moved[told]
    return ratio, np.asarray(moved**2 / (ratio * (1.0 + ratio)))


def p_value(ratio: FloatArray, squares: FloatArray, freedom: float = np.inf) -> float:
    """Probability that a unit of the lot lies as far from it (moments of the sum matched by a gamma distribution).

    Args:
        ratio, squares: As `scores` gives them.
        freedom: Degrees of freedom of the lot's spread: units that it was learnt from, less what was fitted to them.
            With few of them the statistic is that of Fisher's F.
    """
    weight = (_STRANGE - 1.0) * ratio / (1.0 + _STRANGE * ratio)
    statistic = float(np.sum(weight * squares))
    mean, variance = float(np.sum(weight)), 2.0 * float(np.sum(weight**2))
    if np.isfinite(freedom):
        return float(fdtrc(2.0 * mean**2 / variance, freedom, statistic / mean))
    return float(gammaincc(mean**2 / variance, statistic * mean / variance))


def inflation(found: list[tuple[FloatArray, FloatArray]]) -> float:
    """By what the covariance of a lot is to be multiplied, from units that it was not made of; 1 at least."""
    ratio = np.concatenate([r[r > _TELLING] for r, _ in found]) if found else np.zeros(0)
    squares = np.concatenate([s[r > _TELLING] for r, s in found]) if found else np.zeros(0)
    if len(ratio) == 0:
        return 1.0
    return max(1.0, float(np.mean((squares * (1.0 + ratio) - 1.0) / ratio)))
