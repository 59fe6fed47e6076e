"""How rich the model of a lot may be: functions, directions, clusters, and what cross-validation over units says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray, Progress
from ..train.means import UnitMeans
from .basis import LotBasis
from .model import LotState, UnitSums, evidence, fitted, predictive
from .surprise import FALSE_ALARM, inflation, p_value, scores

__all__ = ["LEAST_UNITS", "Envelope", "Learned", "folds_of", "learn", "sums_of", "that_count"]

Envelope = tuple[tuple[float, float], tuple[float, float]]

LEAST_UNITS = 3  # with two there is no telling what is shared
_MOST_DIRECTIONS = 6  # beyond them no lot has gained
_UNITS_A_DIRECTION = 5  # with fewer a direction is a portrait of one of them
_MOST_CLUSTERS = 4  # each that is tried costs as much time as all directions
_LEAST_IN_CLUSTER = 3  # units: as for a lot
_ROUNDS = (
    8,
    16,
    20,
)  # with all functions, with those that count, for each model: the evidence changes by < 1 then
_AGAIN = 6  # rounds of a model that starts from another of nearly the same units
_COUNTS = 1e-3  # signal-to-noise ratio below which a function says nothing
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
        inside: Units that it is made of, shape (units,); the others stand apart.
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


def learn(units: Sequence[UnitMeans], envelope: Envelope, say: Progress) -> Learned:
    """Learns what units share.

    Args:
        units: At least `LEAST_UNITS`.
        envelope: Ranges of T (C) and dT/dt (C/min) of the lot.
        say: Told what is being done.
    """
    bias = np.concatenate([u.bias_dph for u in units])
    count = np.concatenate([u.count for u in units])
    center = float(np.average(bias, weights=count))
    unit = float(np.sqrt(np.average((bias - center) ** 2, weights=count))) or 1.0
    every = LotBasis.over(*envelope)
    sums = sums_of(units, every, center, unit)
    together = np.zeros(len(units), dtype=np.int64)
    say("smoothness of the maps")
    first = fitted(sums, every, 0, together, _ROUNDS[0])
    used = that_count(sums, every.variance(first.rest) + every.variance(first.of_mean))
    sums, basis = sums.only(used), every.only(used)
    inside = np.ones(len(units), dtype=bool)
    state = _chosen(sums, basis, say)
    say("every unit left out")
    p, scale, apart = _left_out(sums, state)
    if apart.any() and (~apart).sum() >= LEAST_UNITS:
        inside = ~apart
        say("without those that stand apart")
        state = _chosen(sums.select(inside), basis, say)
        again, scale, _ = _left_out(sums.select(inside), state)
        p[inside] = again
    left = _left_dph(units, inside, state, center, unit)
    return Learned(state, center, unit, scale, inside, p, left)


def sums_of(units: Sequence[UnitMeans], basis: LotBasis, center: float, unit: float) -> UnitSums:
    """What recordings say of the coefficients, in units of the lot."""
    precision, moment = [], []
    for u in units:
        values = basis.values(u.temperature_c, u.slope_c_per_min)
        weight = u.count * (unit / u.sigma_dph) ** 2
        precision.append((values * weight[:, None]).T @ values)
        moment.append(values.T @ (weight * (u.bias_dph - center) / unit))
    return UnitSums(np.array(precision), np.array(moment))


def that_count(sums: UnitSums, variance: FloatArray) -> NDArray[np.bool_]:
    """Which functions of a process with these variances recordings say anything of."""
    most = np.diagonal(sums.precision, axis1=1, axis2=2).max(axis=0)
    used = variance * most > _COUNTS
    used[0] = True
    return np.asarray(used)


def _chosen(sums: UnitSums, basis: LotBasis, say: Progress) -> LotState:
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
    """As many shared directions as pay for themselves; clusters are held against one cloud with the same freedom."""
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
    """How many numbers recordings of a unit tell of its deviation."""
    shrunk = np.linalg.inv(np.linalg.inv(state.spread()) + sums.precision)
    told = len(state.basis.kept) - np.einsum("ij,uji->u", np.linalg.inv(state.spread()), shrunk)
    return float(np.mean(told))


def _clustered(sums: UnitSums, plain: LotState, number: int) -> LotState | None:
    """The best model with so many clusters and no direction; None where no partition has enough units in each."""
    tried = [
        fitted(sums, plain.basis, 0, cluster, _AGAIN, start=plain)
        for cluster in _partitions(sums, plain, number)
    ]
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
    return state.evidence - _told(state.cluster)


def _partitions(sums: UnitSums, plain: LotState, number: int) -> list[NDArray[np.int64]]:
    """Candidates: units along the directions in which they differ most, parted by k-means from a few starts."""
    from scipy.cluster.vq import kmeans2

    spread = plain.spread()
    posterior = np.linalg.inv(np.linalg.inv(spread) + sums.precision)
    moved = np.einsum("uij,uj->ui", posterior, sums.moment - sums.precision @ plain.means[0])
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


def folds_of(units: int) -> int:
    """Number of folds of the cross-validation."""
    return min(_FOLDS, units)


def _smallest(cluster: NDArray[np.int64], number: int) -> int:
    return int(np.bincount(cluster, minlength=number).min())


def _told(cluster: NDArray[np.int64]) -> float:
    """What it costs to say who is in which cluster, nats."""
    share = np.bincount(cluster) / len(cluster)
    return -float(np.sum(np.log(share[cluster])))


def _left_out(sums: UnitSums, state: LotState) -> tuple[FloatArray, float, NDArray[np.bool_]]:
    """p-value of each unit under the lot without its fold, the inflation that they ask for, and who stands apart."""
    n = len(sums)
    folds = np.arange(n) % folds_of(n)
    found: list[tuple[FloatArray, FloatArray]] = [(np.zeros(0), np.zeros(0))] * n
    for fold in range(int(folds.max()) + 1):
        rest = folds != fold
        _, cluster = np.unique(state.cluster[rest], return_inverse=True)
        seen = fitted(sums.select(rest), state.basis, state.rank, cluster, _AGAIN, start=state)
        for k in np.flatnonzero(~rest):
            one = sums.select(np.array([k]))
            ways = predictive(seen)
            mean, covariance = ways[int(np.argmax([evidence(one, *way)[0] for way in ways]))]
            found[k] = scores(one.precision[0], one.moment[0], mean, covariance)
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
