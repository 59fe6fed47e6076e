"""Learning what units of a type share: the hierarchical model, and how rich it may be.

In the coordinates in which lot and noise are both diagonal, a unit of the lot has independent normal scores, whatever
its runs were. The most powerful test of a given deviation against one that is some times larger weighs their squares
by what runs can tell of each; the sum is, for a unit of the lot, a sum of weighted chi-squares.

Coefficients of the map of unit u, which belongs to cluster c:  w_u = m_c + W z_u + e_u,  with m_c ~ N(0, K(θ_m)),
z_u ~ N(0, I), e_u ~ N(0, S(θ_e)): a mean map, a few directions in which units differ, and a smooth rest of each unit's
own. K and S are diagonal (`basis.py`). What a unit's recordings say of w_u is a Gaussian with known precision and
moment; so everything but W, θ_m, θ_e and the clusters is integrated out exactly, and these by expectation and
maximisation (factor analysis: Rubin and Thayer 1982; priors of processes from many tasks: Schwaighofer, Tresp and
Yu 2005). The mean keeps its covariance: a lot of few units knows its mean badly, and says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, gammaincc

from ..._core import posteriors
from ...common.arrays import FloatArray
from ...common.progress import Progress, Stages
from .basis import CONSTANT, PRIOR_LOG, PriorBasis
from .unit_means import UnitMeans

FALSE_ALARM = 0.01  # of the test: docs/lot.md
_STRANGE = 16.0  # an unrelated unit's variance over the lot's, where the test has most power: four times as far away
_LEAST_FREEDOM = 3  # below it Student's t has no variance, and a prior must have one
_TELLING = 1.0  # variance by the lot over variance by noise, from which on a score says how wide the lot is


def freedom_of(units: int, clusters: int, directions: int) -> float:
    """Degrees of freedom of a lot's spread: units less what was fitted to them; 3 at least."""
    return float(max(units - clusters - directions, _LEAST_FREEDOM))


def student_variance(freedom: float) -> float:
    """Variance of Student's t, by which a spread that is known from few units is widened."""
    return freedom / (freedom - 2.0) if np.isfinite(freedom) else 1.0


def scores(
    precision: FloatArray, moment: FloatArray, mean: FloatArray, factor: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Signal-to-noise ratios of the independent directions, and the squared scores in them: 1 on average.

    Args:
        precision, moment: What the unit's recordings say (`UnitSums`), shapes (n, n) and (n,).
        mean, factor: Of the lot, and the lower triangle whose square its covariance is, the same shapes.
    """
    ratio, vectors = np.linalg.eigh(factor.T @ precision @ factor)
    known = ratio > 1e-9 * ratio[-1]
    moved = vectors.T @ (factor.T @ (moment - precision @ mean))
    ratio, moved = ratio[known], moved[known]
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
    """Return the factor of a lot's covariance from units that it was not learnt from; 1 at least."""
    ratio = np.concatenate([r[r > _TELLING] for r, _ in found]) if found else np.zeros(0)
    squares = np.concatenate([s[r > _TELLING] for r, s in found]) if found else np.zeros(0)
    if len(ratio) == 0:
        return 1.0
    return max(1.0, float(np.mean((squares * (1.0 + ratio) - 1.0) / ratio)))


_EVERY = 4  # rounds between two fits of the processes' parameters: each is a search


@dataclass(frozen=True, slots=True)
class UnitSums:
    """Log likelihood −½ wᵀ G w + bᵀ w of the coefficients of units, from their recordings.

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
        """Return the likelihood for some of the functions, the others being 0."""
        return UnitSums(self.precision[:, used][:, :, used], self.moment[:, used])


@dataclass(frozen=True, slots=True)
class LotState:
    """State of the estimation of a lot.

    Attributes:
        basis: The functions.
        directions: W, shape (n, rank).
        rest, of_mean: Log parameters of the two processes.
        cluster: Cluster of each unit that it was fitted to, shape (units,).
        means: Posterior mean of every cluster's mean, shape (clusters, n).
        covariances: Their posterior covariances, shape (clusters, n, n).
        evidence: Log evidence of the units, up to a constant of the recordings.
    """

    basis: PriorBasis
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
    basis: PriorBasis,
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
    state, posterior, _ = _conditioned(units, state)
    return replace(state, evidence=_log_evidence(units, state, *posterior))


def _round(units: UnitSums, state: LotState, rank: int, *, fit: bool) -> LotState:
    state, (posterior, _), moved = _conditioned(units, state)
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
    rest = basis.fitted_parameters(left, n, rest)
    of_mean = state.of_mean
    if fit:
        squares = (state.means**2 + np.diagonal(state.covariances, axis1=1, axis2=2)).mean(axis=0)
        of_mean = basis.fitted_parameters(squares, len(state.means), of_mean, free=False)
    return replace(state, directions=directions, rest=rest, of_mean=of_mean)


def _conditioned(units: UnitSums, state: LotState) -> tuple[LotState, tuple[FloatArray, FloatArray], FloatArray]:
    """The clusters' means; of each unit the covariance of its coefficients, its log determinant, their deviation.

    With S the spread, G the precision of a unit and P = (S⁻¹ + G)⁻¹ its posterior covariance, what a unit says of its
    cluster's mean m has the precision G − G P G = S⁻¹ − S⁻¹ P S⁻¹ and the moment b − G P b = S⁻¹ P b; its deviation
    from m is P (b − G m) = P (b + S⁻¹ m) − m. One inverse is all that a unit costs.
    """
    inverse: FloatArray = np.asarray(np.linalg.inv(state.spread()), dtype=np.float64)
    posterior, log_determinant = posteriors(inverse, units.precision)
    known = state.basis.variance(state.of_mean)
    member = np.eye(int(state.cluster.max()) + 1)[:, state.cluster]  # 1 where a unit is in a cluster
    summed = np.tensordot(member, posterior, 1)
    shared = member.sum(axis=1)[:, None, None] * inverse - inverse @ summed @ inverse
    covariances = np.linalg.inv(np.diag(1.0 / known) + shared)
    totals = member @ _times(posterior, units.moment) @ inverse
    means = np.einsum("cij,cj->ci", covariances, totals)
    own = means[state.cluster]
    moved = np.subtract(_times(posterior, units.moment + own @ inverse), own)
    return (replace(state, means=means, covariances=covariances), (posterior, log_determinant), np.asarray(moved))


def _log_evidence(units: UnitSums, state: LotState, posterior: FloatArray, log_determinant: FloatArray) -> float:
    """Log evidence of the units, up to a constant of the recordings; arguments as `_conditioned` gives them."""
    known = state.basis.variance(state.of_mean)
    totals = np.linalg.solve(state.covariances, state.means[..., None])[..., 0]
    value = 0.5 * float(np.sum(units.moment * _times(posterior, units.moment)))
    value += 0.5 * float(log_determinant.sum())
    value -= 0.5 * len(units) * float(np.linalg.slogdet(state.spread())[1])
    value += 0.5 * float(np.sum(totals * state.means))
    value += 0.5 * float(np.linalg.slogdet(state.covariances)[1].sum())
    return value - 0.5 * len(state.means) * float(np.sum(np.log(known)))


def _times(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """A matrix of each unit times its vector, shape (units, n)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def predictive(state: LotState) -> list[tuple[FloatArray, FloatArray]]:
    """Mean and covariance of the coefficients of a unit that was not seen, one for each cluster."""
    spread = state.spread()
    return [(m, spread + c) for m, c in zip(state.means, state.covariances, strict=True)]


def evidence(units: UnitSums, mean: FloatArray, covariance: FloatArray) -> FloatArray:
    """Log evidence of each unit's recordings where w ~ N(mean, covariance), up to the constant of the recordings."""
    moment = units.moment - units.precision @ mean
    inverse: FloatArray = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    posterior, log_determinant = posteriors(inverse, units.precision)
    value = 0.5 * np.sum(moment * _times(posterior, moment), axis=1) + 0.5 * log_determinant
    value = value - 0.5 * float(np.linalg.slogdet(covariance)[1])
    return np.asarray(value + units.moment @ mean - 0.5 * np.einsum("i,uij,j->u", mean, units.precision, mean))


Envelope = tuple[tuple[float, float], tuple[float, float]]

LEAST_UNITS = 3  # with two there is no telling what is shared
_MOST_DIRECTIONS = 6  # beyond them no lot has gained
_UNITS_A_DIRECTION = 5  # with fewer a direction is a portrait of one of them
_MOST_CLUSTERS = 4  # each that is tried costs as much time as all directions
_LEAST_IN_CLUSTER = 3  # units: as for a lot
_ROUNDS = (8, 16, 20)  # with all functions, with those that count, for each model: the evidence changes by < 1 then
_SAMPLE = 256  # units at most that say which functions count: a variance from so many is known to a tenth
_AGAIN = 6  # rounds of a model that starts from another of nearly the same units
LEAST_RATIO = 1e-3
"""Variance of a coefficient over that of its noise: with less, recordings say nothing of it."""
_FOLDS = 5  # each leaves four fifths of the units, enough to stand for the lot
_STARTS = 8  # of the search for clusters
_REFINED = 2  # partitions whose units may change clusters: of many units every start gives another one


@dataclass(frozen=True, slots=True)
class Learned:
    """A lot that was learnt.

    Attributes:
        state: Model of the units in it.
        center_dph, unit_dph: Zero and unit of its coefficients, deg/h.
        scale: By what its covariances are multiplied (cross-validation).
        inside: Units that it is made of, shape (units,); the others are outliers.
        p_values: Of each unit under the lot without it.
        left_out_dph: RMS of what the lot leaves of units that it has not seen, and what their own mean leaves, deg/h.
    """

    state: LotState
    center_dph: float
    unit_dph: float
    scale: float
    inside: NDArray[np.bool_]
    p_values: FloatArray
    left_out_dph: tuple[float, float]


# As `gyrotc lot -v` measures them on a lot of `gyrotc simulate --units`.
_STAGES = {
    "smoothness of the maps": 0.2,
    "clusters and directions": 0.3,
    "every unit left out": 0.4,
    "without the outliers": 0.1,
}


def learn_prior(units: Sequence[UnitMeans], envelope: Envelope, progress: Progress) -> Learned:
    """Learn what units share.

    Args:
        units: At least `LEAST_UNITS`.
        envelope: Ranges of T (C) and dT/dt (C/min) of the lot.
        progress: Takes note of every stage.
    """
    bias = np.concatenate([u.bias_dph for u in units])
    count = np.concatenate([u.count for u in units])
    center = float(np.average(bias, weights=count))
    unit = float(np.sqrt(np.average((bias - center) ** 2, weights=count))) or 1.0
    every = PriorBasis.over(*envelope)
    say = Stages(progress, _STAGES)
    say("smoothness of the maps")
    sample = sums_of(units[:: -(-len(units) // _SAMPLE)], every, center, unit)
    first = fitted(sample, every, 0, np.zeros(len(sample), dtype=np.int64), _ROUNDS[0])
    used = that_count(sample, every.variance(first.rest) + every.variance(first.of_mean))
    basis = every.only(used)
    sums = sums_of(units, basis, center, unit)
    inside = np.ones(len(units), dtype=bool)
    state = _chosen(sums, basis, say.within("clusters and directions"))
    say("every unit left out")
    p, scale, outside = _left_out(sums, state)
    if outside.any() and (~outside).sum() >= LEAST_UNITS:
        inside = ~outside
        say("without the outliers")
        state = _chosen(sums.select(inside), basis, say.within("without the outliers"))
        again, scale, _ = _left_out(sums.select(inside), state)
        p[inside] = again
    left = _left_dph(units, inside, state, center, unit)
    return Learned(state, center, unit, scale, inside, p, left)


def sums_of(
    units: Sequence[UnitMeans], basis: PriorBasis, center: float, unit: float, own: FloatArray | None = None
) -> UnitSums:
    """Return the log likelihood of the coefficients, in units of the lot.

    Args:
        units: Their recordings.
        basis: The functions.
        center, unit: Zero and unit of the coefficients, deg/h.
        own: Variances of what a power-on has of its own, of the first coefficients, in units of the lot; None: the
            recordings of a unit are taken as they are.
    """
    n = len(basis.kept)
    precision, moment = np.zeros((len(units), n, n)), np.zeros((len(units), n))
    for k, u in enumerate(units):
        for part in (u,) if own is None else u.power_ons():
            values = basis.values(part.temperature_c, part.slope_c_per_min)
            weight = part.count * (unit / part.sigma_dph) ** 2
            joint = (values * weight[:, None]).T @ np.column_stack([values, (part.bias_dph - center) / unit])
            joint = joint if own is None else _about_the_map(joint, np.sqrt(own))
            precision[k] += joint[:, :n]
            moment[k] += joint[:, n]
    return UnitSums(precision, moment)


def _about_the_map(joint: FloatArray, root: FloatArray) -> FloatArray:
    """Return precision and moment of a power-on with what it has of its own integrated out.

    Args:
        joint: Precision and moment side by side, shape (n, n + 1), as if the power-on had nothing of its own.
        root: Roots of the variances of what it has, of the first coefficients.
    """
    first = len(root)
    inner = np.eye(first) + root[:, None] * joint[:first, :first] * root
    return np.asarray(joint - (joint[:, :first] * root) @ np.linalg.solve(inner, root[:, None] * joint[:first]))


def that_count(sums: UnitSums, variance: FloatArray) -> NDArray[np.bool_]:
    """Return a mask of the functions that recordings tell anything of, in a process with these variances."""
    most = np.diagonal(sums.precision, axis1=1, axis2=2).max(axis=0)
    used = variance * most > LEAST_RATIO
    used[0] = True
    return np.asarray(used)


def _chosen(sums: UnitSums, basis: PriorBasis, say: Progress) -> LotState:
    """The model with the largest evidence, each direction paid for by half the logarithm of the units a number."""
    together = np.zeros(len(sums), dtype=np.int64)
    plain = fitted(sums, basis, 0, together, _ROUNDS[1])
    price = 0.5 * np.log(len(sums)) * _freedom(sums, plain)
    best, value = _with_directions(sums, plain, plain.evidence, price, say)
    for number in range(2, _MOST_CLUSTERS + 1):
        say(f"{number} clusters")
        parted = _clustered(sums, plain, number)
        if parted is None:
            break
        split, its = _with_directions(sums, parted, _worth(parted), price, say)
        if its <= value:
            break
        best, value = split, its
    return best


def _with_directions(
    sums: UnitSums, state: LotState, value: float, price: float, say: Progress
) -> tuple[LotState, float]:
    """Add as many shared directions as pay for themselves; clusters compete with one cloud of the same freedom."""
    paid = value - state.evidence
    for rank in range(1, min(_MOST_DIRECTIONS, len(sums) // _UNITS_A_DIRECTION) + 1):
        say(f"{rank} directions")
        tried = fitted(sums, state.basis, rank, state.cluster, _ROUNDS[2], start=state)
        its = tried.evidence + paid - rank * price
        if its <= value:
            break
        state, value = tried, its
    return state, value


def _freedom(sums: UnitSums, state: LotState) -> float:
    """Return how many numbers the recordings of a unit tell of its deviation."""
    inverse: FloatArray = np.asarray(np.linalg.inv(state.spread()), dtype=np.float64)
    shrunk = np.sum(inverse * posteriors(inverse, sums.precision)[0].mean(axis=0))
    return len(state.basis.kept) - float(shrunk)


def _clustered(sums: UnitSums, plain: LotState, number: int) -> LotState | None:
    """The best model with so many clusters and no direction; None where no partition has enough units in each."""
    tried = [fitted(sums, plain.basis, 0, cluster, _AGAIN, start=plain) for cluster in _partitions(sums, plain, number)]
    tried.sort(key=_worth, reverse=True)
    found: list[LotState] = []
    for first in tried[:_REFINED]:
        state = first
        for _ in range(3):
            ways = predictive(state)
            nearest = np.argmax([evidence(sums, *way) for way in ways], axis=0)
            if np.array_equal(nearest, state.cluster) or _smallest(nearest, number) < _LEAST_IN_CLUSTER:
                break
            state = fitted(sums, plain.basis, 0, nearest, _AGAIN, start=state)
        found.append(state)
    return max(found, key=_worth, default=None)


def _worth(state: LotState) -> float:
    """Log evidence of a partition, what it costs to say it taken off."""
    return state.evidence - _labels_cost(state.cluster)


def _partitions(sums: UnitSums, plain: LotState, number: int) -> list[NDArray[np.int64]]:
    """Candidates: units along the directions in which they differ most, parted by k-means from a few starts."""
    from scipy.cluster.vq import kmeans2

    moved = _conditioned(sums, plain)[2]
    _, vectors = np.linalg.eigh(moved.T @ moved)
    found: dict[bytes, NDArray[np.int64]] = {}
    for start in range(_STARTS):
        axes = vectors[:, -1 - start % 4 :]
        _, label = kmeans2(moved @ axes, number, seed=start, minit="++")
        _, label = np.unique(label, return_inverse=True)
        if _smallest(label, number) >= _LEAST_IN_CLUSTER:
            order = np.argsort([int(np.argmax(label == c)) for c in range(number)])
            named = np.argsort(order)[label].astype(np.int64)
            found[named.tobytes()] = named
    return list(found.values())


def fold_count(units: int) -> int:
    """Number of folds of the cross-validation."""
    return min(_FOLDS, units)


def _smallest(cluster: NDArray[np.int64], number: int) -> int:
    return int(np.bincount(cluster, minlength=number).min())


def _labels_cost(cluster: NDArray[np.int64]) -> float:
    """Return the cost of stating the cluster of each unit, nats."""
    share = np.bincount(cluster) / len(cluster)
    return -float(np.sum(np.log(share[cluster])))


def _left_out(sums: UnitSums, state: LotState) -> tuple[FloatArray, float, NDArray[np.bool_]]:
    """p-value of each unit under the lot without its fold, the inflation that they ask for, and who is an outlier."""
    n = len(sums)
    folds = np.arange(n) % fold_count(n)
    found: list[tuple[FloatArray, FloatArray]] = [(np.zeros(0), np.zeros(0))] * n
    for fold in range(int(folds.max()) + 1):
        rest = folds != fold
        _, cluster = np.unique(state.cluster[rest], return_inverse=True)
        seen = fitted(sums.select(rest), state.basis, state.rank, cluster, _AGAIN, start=state)
        ways = predictive(seen)
        factors = [np.linalg.cholesky(covariance) for _, covariance in ways]
        nearest = np.argmax([evidence(sums.select(~rest), *way) for way in ways], axis=0)
        for k, way in zip(np.flatnonzero(~rest).tolist(), nearest.tolist(), strict=True):
            found[k] = scores(sums.precision[k], sums.moment[k], ways[way][0], factors[way])
    freedom = state.freedom
    far = np.array([p_value(*one, freedom) for one in found]) < FALSE_ALARM / n
    scale = inflation([one for one, away in zip(found, far, strict=True) if not away])
    p = np.array([p_value(r, squares * (1.0 + r) / (1.0 + scale * r), freedom) for r, squares in found])
    return p, scale, p < FALSE_ALARM / n


def _left_dph(
    units: Sequence[UnitMeans], inside: NDArray[np.bool_], state: LotState, center: float, unit: float
) -> tuple[float, float]:
    """RMS about the mean map of the other units of a cluster, and about a constant, noise taken off, deg/h."""
    squares = np.zeros(2)
    chosen = [u for u, kept in zip(units, inside, strict=True) if kept]
    size = np.bincount(state.cluster)
    for u, c in zip(chosen, state.cluster, strict=True):
        expected = center + unit * (state.basis.values(u.temperature_c, u.slope_c_per_min) @ state.means[c])
        others = size[c] / max(size[c] - 1.0, 1.0)  # its own share in the mean
        own = u.bias_dph - np.average(u.bias_dph, weights=u.count)
        noise = u.sigma_dph**2 * len(u.count) / float(u.count.sum())
        for k, left in enumerate(((u.bias_dph - expected) * others, own)):
            squares[k] += max(float(np.average(left**2, weights=u.count)) - noise, 0.0)
    with_lot, alone = np.sqrt(squares / len(chosen))
    return float(with_lot), float(alone)
