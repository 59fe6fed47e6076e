"""The hierarchical model of a lot: its arithmetic, without what decides how rich it may be.

Coefficients of the map of unit u, which belongs to cluster c:  w_u = m_c + W z_u + e_u,  with m_c ~ N(0, K(θ_m)),
z_u ~ N(0, I), e_u ~ N(0, S(θ_e)): a mean map, a few directions in which units differ, and a smooth rest of each unit's
own. K and S are diagonal (`basis.py`). What a unit's recordings say of w_u is a Gaussian with known precision and
moment; so everything but W, θ_m, θ_e and the clusters is integrated out exactly, and these by expectation and
maximisation (factor analysis: Rubin and Thayer 1982; priors of processes from many tasks: Schwaighofer, Tresp and
Yu 2005). The mean keeps its covariance: a lot of few units knows its mean badly, and says so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from .basis import CONSTANT, PRIOR_LOG, LotBasis, fitted_parameters
from .surprise import freedom_of

__all__ = ["LotState", "UnitSums", "evidence", "fitted", "predictive"]


_EVERY = 4  # rounds between two fits of the processes' parameters: each is a search


@dataclass(frozen=True, slots=True)
class UnitSums:
    """What recordings of units say of their coefficients: log likelihood −½ wᵀ G w + bᵀ w.

    Attributes:
        precision: G, shape (units, n, n).
        moment: b, shape (units, n).
    """

    precision: FloatArray
    moment: FloatArray

    def __len__(self) -> int:
        return len(self.moment)

    def select(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> UnitSums:
        return UnitSums(self.precision[which], self.moment[which])

    def only(self, used: NDArray[np.bool_]) -> UnitSums:
        """The same for some of the functions, the others being 0."""
        return UnitSums(self.precision[:, used][:, :, used], self.moment[:, used])


@dataclass(frozen=True, slots=True)
class LotState:
    """What is estimated, and what follows from it.

    Attributes:
        basis: The functions.
        directions: W, shape (n, rank).
        rest, of_mean: Log parameters of the two processes.
        cluster: Cluster of each unit that it was fitted to, shape (units,).
        means: Posterior mean of every cluster's mean, shape (clusters, n).
        covariances: Their posterior covariances, shape (clusters, n, n).
        evidence: Log evidence of the units, up to a constant of the recordings.
    """

    basis: LotBasis
    directions: FloatArray
    rest: FloatArray
    of_mean: FloatArray
    cluster: NDArray[np.int64]
    means: FloatArray
    covariances: FloatArray
    evidence: float

    @property
    def rank(self) -> int:
        return int(self.directions.shape[1])

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the spread."""
        return freedom_of(len(self.cluster), len(self.means), self.rank)

    def spread(self) -> FloatArray:
        """Covariance of units about the mean of their cluster, shape (n, n)."""
        return np.asarray(np.diag(self.basis.variance(self.rest)) + self.directions @ self.directions.T)


def fitted(
    units: UnitSums,
    basis: LotBasis,
    rank: int,
    cluster: NDArray[np.int64],
    rounds: int,
    start: LotState | None = None,
) -> LotState:
    """Expectation and maximisation over a number of rounds; clusters stay as given."""
    first = PRIOR_LOG.copy()
    of_mean = first.copy()
    of_mean[0] = CONSTANT
    n = len(basis.kept)
    empty = np.zeros((n, 0))
    state = LotState(basis, empty, first, of_mean, cluster, np.zeros((0, n)), np.zeros((0, n, n)), -np.inf)
    if start is not None:
        state = replace(state, rest=start.rest, of_mean=start.of_mean, directions=start.directions)
    for number in range(rounds):
        state = _round(units, state, rank, fit=number % _EVERY == _EVERY - 1)
    return _weighed(units, *_conditioned(units, state)[:2])


def _round(units: UnitSums, state: LotState, rank: int, *, fit: bool) -> LotState:
    state, posterior, moved = _conditioned(units, state)
    n, basis = len(units), state.basis
    second = posterior.sum(axis=0) + moved.T @ moved  # of the deviations from the clusters' means
    directions, rest = state.directions, state.rest
    if directions.shape[1] < rank:
        values, vectors = np.linalg.eigh(second / n)
        top = slice(len(values) - rank, None)
        directions = vectors[:, top] * np.sqrt(np.maximum(0.5 * values[top], 1e-12))
        return replace(state, directions=directions)
    left = np.diag(second) / n
    if rank:
        back = np.linalg.solve(state.spread(), directions).T
        scores = n * (np.eye(rank) - back @ directions) + back @ second @ back.T
        cross = second @ back.T
        directions = np.linalg.solve(scores, cross.T).T
        left = (np.diag(second) - np.sum(directions * cross, axis=1)) / n
    rest = fitted_parameters(basis, left, n, rest)
    of_mean = state.of_mean
    if fit:
        squares = (state.means**2 + np.diagonal(state.covariances, axis1=1, axis2=2)).mean(axis=0)
        of_mean = fitted_parameters(basis, squares, len(state.means), of_mean, free=False)
    return replace(state, directions=directions, rest=rest, of_mean=of_mean)


def _conditioned(units: UnitSums, state: LotState) -> tuple[LotState, FloatArray, FloatArray]:
    """The clusters' means, and of each unit the covariance of its coefficients and their deviation from the mean.

    With S the spread, G the precision of a unit and P = (S⁻¹ + G)⁻¹ its posterior covariance, what a unit says of its
    cluster's mean has the precision G − G P G = S⁻¹ − S⁻¹ P S⁻¹ and the moment b − G P b = S⁻¹ P b: their sums need
    that of P alone, and an inverse is all that each unit costs.
    """
    spread = state.spread()
    inverse = np.linalg.inv(spread)
    told = inverse + units.precision
    posterior: FloatArray = np.asarray(np.linalg.inv(told), dtype=np.float64)
    alone = _times(posterior, units.moment)
    known = state.basis.variance(state.of_mean)
    groups = [state.cluster == c for c in range(int(state.cluster.max()) + 1)]
    shared = [g.sum() * inverse - inverse @ posterior[g].sum(axis=0) @ inverse for g in groups]
    covariances = np.array([np.linalg.inv(np.diag(1.0 / known) + one) for one in shared])
    totals = np.array([inverse @ alone[g].sum(axis=0) for g in groups])
    means = np.einsum("cij,cj->ci", covariances, totals)
    moved = np.subtract(alone, _times(posterior, _times(units.precision, means[state.cluster])))
    return replace(state, means=means, covariances=covariances), posterior, np.asarray(moved)


def _weighed(units: UnitSums, state: LotState, posterior: FloatArray) -> LotState:
    """The state with its log evidence, which no round of a fit asks for: a determinant for each unit."""
    spread, known = state.spread(), state.basis.variance(state.of_mean)
    totals = np.linalg.solve(state.covariances, state.means[..., None])[..., 0]
    value = 0.5 * float(np.sum(units.moment * _times(posterior, units.moment)))
    value += 0.5 * float(np.linalg.slogdet(posterior)[1].sum())
    value -= 0.5 * len(units) * float(np.linalg.slogdet(spread)[1])
    value += 0.5 * float(np.sum(totals * state.means))
    value += 0.5 * float(np.linalg.slogdet(state.covariances)[1].sum())
    value -= 0.5 * len(state.means) * float(np.sum(np.log(known)))
    return replace(state, evidence=value)


def _times(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """A matrix of each unit times its vector, shape (units, n)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def predictive(state: LotState, scale: float = 1.0) -> list[tuple[FloatArray, FloatArray]]:
    """Mean and covariance of the coefficients of a unit that was not seen, one for each cluster."""
    spread = scale * state.spread()
    return [(m, spread + scale * c) for m, c in zip(state.means, state.covariances, strict=True)]


def evidence(units: UnitSums, mean: FloatArray, covariance: FloatArray) -> FloatArray:
    """Log evidence of each unit's recordings where w ~ N(mean, covariance), up to the constant of the recordings."""
    precision = np.linalg.inv(covariance) + units.precision
    moment = units.moment - units.precision @ mean
    solved = np.linalg.solve(precision, moment[..., None])[..., 0]
    value = 0.5 * np.sum(moment * solved, axis=1) - 0.5 * np.linalg.slogdet(precision)[1]
    value = value - 0.5 * float(np.linalg.slogdet(covariance)[1])
    return np.asarray(
        value + units.moment @ mean - 0.5 * np.einsum("i,uij,j->u", mean, units.precision, mean)
    )
