"""Score every candidate beside a model: an energy of normal variables, as minus the logarithm of its p-value.

The largest score of all is compared with the largest of all in data without any effect (Westfall and Young 1993).
These draws depend on the temperature records alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from ..common.arrays import FloatArray, IntArray
from ..common.statistics import TOLERANCE
from .tolerances import INDEPENDENT, MAIN

_DRAWS = 4000  # 40 draws lie beyond the 1 % point: it is known to one sixth of itself
_LAMBDA = np.geomspace(1e-3, 1e5, 33)  # variances of a random effect, in units of the noise of its weights


@dataclass(frozen=True)
class ScoredColumns:
    """Columns that belong together: index sets into the joined columns of a view.

    Attributes:
        single: Columns that are candidates alone, shape (s,).
        pairs: Candidates of two columns, shape (q, 2).
        variance: Candidates whose weights have one common variance.
    """

    single: IntArray
    pairs: IntArray
    variance: tuple[IntArray, ...]


@dataclass(frozen=True)
class Projection:
    """Whitened inner products after some columns are projected out.

    Attributes:
        a: Inner products of the columns with the data, over the noise scale, shape (P,).
        gram: Inner products of the columns, shape (P, P).
        before: Norms² of the columns before, shape (P,).
        common: From columns to orthogonal directions for the omnibus test, shape (P, p).
        rest: Whitened energy of the data that is left (not over the scale).
        log_det: log det of the noise's covariance and of the inner products of the projected columns.
        rank: Number of columns projected out.
    """

    a: FloatArray
    gram: FloatArray
    before: FloatArray
    common: FloatArray
    rest: float
    log_det: float
    rank: int

    @cached_property
    def alive(self) -> NDArray[np.bool_]:
        """Mask of the columns that still have a signature."""
        return np.asarray(np.diag(self.gram) > INDEPENDENT * self.before)

    @cached_property
    def structure(self) -> tuple[FloatArray, FloatArray]:
        """Independent directions of the dictionary and their energies: what a random mixture of signatures has.

        Returns:
            Coordinates with variance 1 without structure, shape (P, r), and energies, shape (r,), descending.
        """
        inner = self.common.T @ self.gram @ self.common
        size, vectors = np.linalg.eigh(inner)
        keep = size > MAIN**2 * size[-1]
        return np.asarray(self.common @ (vectors[:, keep] / np.sqrt(size[keep])))[:, ::-1], size[keep][::-1]


@dataclass(frozen=True)
class NegativeLogScores:
    """−log p of every candidate, in the order single, pairs, variance, structure; shape (..., candidates)."""

    single: FloatArray
    pairs: FloatArray
    variance: FloatArray
    structure: FloatArray

    def joined(self) -> FloatArray:
        return np.concatenate([self.single, self.pairs, self.variance, self.structure], axis=-1)


def score(projection: Projection, columns: ScoredColumns, a: FloatArray) -> NegativeLogScores:
    """Scores for inner products `a`, shape (P,) or (draws, P)."""
    size = np.diag(projection.gram)
    alive = projection.alive
    single = columns.single
    z = np.abs(a[..., single]) / np.sqrt(np.where(alive[single], size[single], np.inf))
    one = -(np.log(2.0) + log_ndtr(-z))
    return NegativeLogScores(
        single=one,
        pairs=0.5 * _pair_energy(projection, columns.pairs, a),
        variance=np.stack([_variance(projection, v, a) for v in columns.variance], axis=-1)
        if columns.variance
        else np.zeros((*a.shape[:-1], 0)),
        structure=_structure(projection, a)[..., None],
    )


def _pair_energy(projection: Projection, pairs: IntArray, a: FloatArray) -> FloatArray:
    """Energy of the data in the plane of two columns."""
    g = projection.gram
    p, q = pairs[:, 0], pairs[:, 1]
    gpp, gqq, gpq = g[p, p], g[q, q], g[p, q]
    det = gpp * gqq - gpq**2
    ok = (det > INDEPENDENT * gpp * gqq) & projection.alive[p] & projection.alive[q]
    ap, aq = a[..., p], a[..., q]
    energy = (gqq * ap**2 - 2.0 * gpq * ap * aq + gpp * aq**2) / np.where(ok, det, np.inf)
    return np.asarray(energy)


def _variance(projection: Projection, index: IntArray, a: FloatArray) -> FloatArray:
    """−log p of the likelihood ratio of one common variance against none (half a chi-square)."""
    gram = projection.gram[np.ix_(index, index)]
    ratio = variance_ratio_of(gram, a[..., index], float(projection.before[index].max()))[0]
    return np.asarray(-log_ndtr(-np.sqrt(ratio)))


def variance_ratio_of(gram: FloatArray, a: FloatArray, before: float) -> tuple[FloatArray, FloatArray]:
    """Likelihood ratio 2 Δ log L and the variance (in the unit of the columns' weights) that gives it.

    Args:
        gram: Inner products of the columns, shape (k, k).
        a: Those with the data, shape (..., k).
        before: Largest norm² that a column had.
    """
    size, vectors = np.linalg.eigh(gram)
    keep = size > TOLERANCE * max(before, 1e-300)
    return ratio_of((a @ vectors[:, keep]) ** 2 / size[keep], size[keep])


def ratio_of(energy: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the ratio from energies of independent directions, shape (..., r), and sizes, shape (r,)."""
    if s.size == 0:
        none = np.zeros(energy.shape[:-1])
        return none, none
    gain = np.outer(_LAMBDA / s.mean(), s)
    ratio = energy @ (gain / (1.0 + gain)).T - np.log1p(gain).sum(axis=1)
    best = np.argmax(ratio, axis=-1)
    top = np.take_along_axis(ratio, np.asarray(best)[..., None], axis=-1)[..., 0]
    return np.maximum(top, 0.0), np.where(top > 0.0, _LAMBDA[best] / s.mean(), 0.0)


def _structure(projection: Projection, a: FloatArray) -> FloatArray:
    """−log p of one common variance of all signatures against none."""
    directions, size = projection.structure
    ratio = ratio_of((a @ directions) ** 2, size)[0]
    return np.asarray(-log_ndtr(-np.sqrt(ratio)))


def p_values(scores: FloatArray, projection: Projection, columns: ScoredColumns, seed: int) -> FloatArray:
    """Return how often the largest score in data without effect is above each of some scores; shape as theirs."""
    null = np.sort(draw_null(projection, columns, seed))
    return np.asarray((null.size - np.searchsorted(null, scores) + 1.0) / (null.size + 1.0))


def draw_null(projection: Projection, columns: ScoredColumns, seed: int, draws: int = _DRAWS) -> FloatArray:
    """Largest score in data without effect, shape (draws,)."""
    used = np.flatnonzero(projection.alive)
    gram = projection.gram[np.ix_(used, used)]
    gram = gram + np.diag(TOLERANCE * projection.before[used] + 1e-12)
    factor = root_of_gram(gram)
    normal = np.random.default_rng(seed).standard_normal((draws, used.size))
    a = np.zeros((draws, projection.a.size))
    a[:, used] = normal @ factor.T
    return np.asarray(score(projection, columns, a).joined().max(axis=-1))


def root_of_gram(gram: FloatArray) -> FloatArray:
    """A factor F with F F' = gram; what rounding made negative in it, of columns that hardly differ, counts as 0."""
    try:
        return np.asarray(np.linalg.cholesky(gram))
    except np.linalg.LinAlgError:
        size, vectors = np.linalg.eigh(gram)
        return np.asarray(vectors * np.sqrt(np.maximum(size, 0.0)))
