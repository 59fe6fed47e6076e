"""Marginal likelihoods of near explanations, in which the map has to pay for what it bends.

With dT/dt as an input of the map, memories contain each other. A gradient is z − T = −τ dz/dt: the map of a lagged
temperature, free in dz/dt, takes it for nothing. And a lag is f(z) = f(T) + f'(T) (z − T) + ..., of which a gradient
has all but what f bends. Profile likelihoods with equally many free functions then differ by the noise that twenty
functions happen to take, with a standard deviation of 2 √20: more than what distinguishes the causes.

Here the functions of T alone, and those of dT/dt, have weights with a variance of each group, which is estimated with
the rest (type II maximum likelihood: Rasmussen and Williams 2006, section 5.4.1). What nothing in the data asks for
takes no noise and costs nothing, and a map that has to undo by dT/dt what a wrong cause did is the less likely one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from ..common.statistics import orthonormal
from .blocks import singled_out
from .candidates import Candidate, CandidateKey, diagnosable_causes, price_of
from .posterior import LOOKED_AT, Rival, odds_of
from .profile_likelihood import CauseSet, Gains, Point, best_of
from .rivals import Kinds, kinds_of, rival_key

_Near = dict[Kinds, list[Point]]

_POINTS = 3  # of each kind's grid, its best: the optimum of the evidence lies beside that of the likelihood
_MOST_KINDS = 8  # the nearest: whoever comes after them is no rival in practice, and each costs 20 ms
_MOST_BEHIND = 2  # of these, the nearest: what a clock may stand behind, at a dozen shifts
_BOUNDS = (-6.0, 22.0)
"""Of the logarithm of a group's variance, in units of the noise that its columns have on average: nothing to all."""
_START = 8.0
"""Where the search for them begins: from 4 and 8 both, criteria differ by 1.4 at most (78 models)."""


class MarginalLikelihood:
    """Marginal likelihoods of the models of a search, as criteria: twice the logarithm, less log N for every parameter.

    Args:
        gains: Of the measured recordings.
    """

    def __init__(self, gains: Gains) -> None:
        self.gains = gains
        self.bank = gains.search.bank
        self._done: dict[tuple[frozenset[CandidateKey], bytes], float] = {}

    def preferred(self, points: Sequence[Point]) -> Point:
        """The best of all models; where a cause that changes the map's input is near, by the evidence."""
        near = self._near(points)
        if not _swaps(near):
            return best_of(points, self.gains.size)
        return max(self._weighed(near).values(), key=lambda found: found[1])[0]

    def over_nothing(self, points: Sequence[Point], best: Point) -> float:
        """Criterion of the preferred model over the map alone: by the evidence where that has chosen it."""
        near, own = self._near(points), kinds_of(best.members)
        if not _swaps(near) or own not in near:
            return best.criterion(self.gains.size)
        return self._weighed(near)[own][1]

    def judged(self, points: Sequence[Point], chosen: CauseSet, k: int, ranked: Sequence[Rival]) -> tuple[Rival, ...]:
        """Return rivals of the k-th cause, nearest first, with odds by the evidence if that chose the same causes.

        Rivals that are too far behind to be asked keep their distance to the best of all.
        """
        near = self._near(points)
        own = kinds_of(chosen)
        if not _swaps(near) or own not in near:
            return tuple(ranked)
        size = self.gains.size
        same = [p for p in points if kinds_of(p.members) == own]
        shift = best_of(points, size).criterion(size) - best_of(same, size).criterion(size)
        weighed = self._weighed(near)
        reported = []
        for rival in ranked:
            place = (rival.id, rival.channel or "")
            found = weighed.get(tuple(sorted([*map(rival_key, chosen[:k]), place, *map(rival_key, chosen[k + 1 :])])))
            if found is None:
                reported.append(replace(rival, distance=rival.distance + shift))
                continue
            behind = replace(rival, distance=max(weighed[own][1] - found[1], 0.0))
            reported.append(replace(behind, odds=odds_of(behind)))
        return tuple(sorted(reported, key=lambda r: r.distance))

    def criterion(self, members: CauseSet, left_out: NDArray[np.bool_]) -> float:
        """Return the criterion of a model over that of the map alone.

        Args:
            members: Its causes; at most one changes the map's input.
            left_out: Blocks that say nothing, for they cannot in one of the models that are compared, shape (N,).
        """
        price = sum(map(_price, members)) * float(np.log(self.gains.size))
        return self._evidence(members, left_out) - self._evidence((), left_out) - price

    def static_leads(self, points: Sequence[Point], mapped: FloatArray) -> tuple[float, float]:
        """Return the criterion of another static map over the plain one, and over the best of the models near it.

        Args:
            points: Models that it is compared with.
            mapped: Whitened functions of the static map, as many as the plain one has, shape (N, m).
        """
        near = self._near(points)
        left_out = self._unknown(near)
        price = float(np.log(self.gains.size))
        own = self._marginal(mapped, [], [], left_out) - self._evidence((), left_out) - price
        best = max((found for _, found in self._weighed(near).values()), default=0.0)
        return own, own - best

    def _unknown(self, near: _Near) -> NDArray[np.bool_]:
        """Return a mask of the blocks that at least one of the models does not know, shape (N,)."""
        left_out = np.zeros(self.gains.size, dtype=bool)
        for member in (m for points in near.values() for p in points for m in p.members if m.role == "input"):
            left_out |= ~self.bank.known[self.bank.inputs.index(member)]
        return left_out

    def _evidence(self, members: CauseSet, left_out: NDArray[np.bool_]) -> float:
        key = frozenset(m.key for m in members), left_out.tobytes()
        if key not in self._done:
            mapped = next((self.gains.replaced(m) for m in members if m.role == "input"), self.gains.map)
            added = [self.gains.white(m) for m in members if m.role == "columns"]
            drawn = [self.gains.white(m) for m in members if m.role == "variance"]
            self._done[key] = self._marginal(mapped, added, drawn, left_out)
        return self._done[key]

    def _near(self, points: Sequence[Point]) -> _Near:
        """The best points of the kinds that come near the best of all, and of those that may hide behind blocks."""
        size = self.gains.size
        ranked: _Near = {}
        for point in sorted(points, key=lambda p: -p.criterion(size)):
            ranked.setdefault(kinds_of(point.members), []).append(point)
        best = {key: found[0].criterion(size) for key, found in ranked.items()}
        least = max(best.values(), default=0.0) - LOOKED_AT
        keys = [key for key, value in best.items() if value >= least][:_MOST_KINDS]
        behind = [other for key in keys[:_MOST_BEHIND] for other in _behind(key) if best.get(other, 0.0) > 0.0]
        return {key: _few(ranked[key], size) for key in dict.fromkeys([*keys, *behind])}

    def _weighed(self, near: _Near) -> dict[Kinds, tuple[Point, float]]:
        """Return the best point and criterion of each kind, all on the blocks that each of them knows."""
        left_out = self._unknown(near)
        tried = {key: [(p, self.criterion(p.members, left_out)) for p in points] for key, points in near.items()}
        return {key: max(found, key=lambda one: one[1]) for key, found in tried.items()}

    def _marginal(
        self,
        mapped: FloatArray,
        free: Sequence[FloatArray],
        drawn: Sequence[FloatArray],
        left_out: NDArray[np.bool_],
    ) -> float:
        """Twice the log-likelihood of data over the noise, with free columns and groups of weights with a variance."""
        raw = mapped @ self._back
        basis = self.bank.basis
        of_t = raw[:, 3 : 3 + basis.along.size]
        of_rate = np.column_stack([raw[:, 2:3], raw[:, 3 + basis.along.size :]])
        edges = [self.gains.whiten(singled_out(left_out))] if left_out.any() else []
        held = orthonormal(self.gains.beside, raw[:, :2], *free, *edges)
        y = self.gains.target - held @ (held.T @ self.gains.target)
        groups = [g - held @ (held.T @ g) for g in (of_t, of_rate, *drawn)]
        return largest_evidence(y, groups) - float(y @ y)

    @cached_property
    def _back(self) -> FloatArray:
        """Return the matrix from the map's basis to the functions that it is made of, shape (m, 3 + a + b)."""
        return np.asarray(np.linalg.pinv(self.bank.basis.mix))


def largest_evidence(y: FloatArray, groups: Sequence[FloatArray]) -> float:
    """Twice the log of N(y; 0, I + Σ v_g G_g G_gᵀ) over N(y; 0, I), at the likeliest variances v."""
    base = orthonormal(*groups)
    data = base.T @ y
    inner = []
    for group in groups:
        small = base.T @ group
        power = float((small**2).sum()) / max(group.shape[1], 1)
        inner.append(small @ small.T / max(power, 1e-300))

    def cost(logs: FloatArray) -> tuple[float, FloatArray]:
        size = np.exp(logs)
        factor = cho_factor(np.eye(data.size) + sum(s * g for s, g in zip(size, inner, strict=True)), lower=True)
        weights = cho_solve(factor, data)
        inverse = cho_solve(factor, np.eye(data.size))
        value = float(data @ weights - data @ data) + 2.0 * float(np.log(np.diag(factor[0])).sum())
        slope = [
            s * (float((inverse * g).sum()) - float(weights @ g @ weights)) for s, g in zip(size, inner, strict=True)
        ]
        return value, np.array(slope)

    bounds = [_BOUNDS] * len(inner)
    return -float(minimize(cost, [_START] * len(inner), jac=True, method="L-BFGS-B", bounds=bounds).fun)


def _swaps(near: _Near) -> bool:
    return any(m.role == "input" for points in near.values() for p in points for m in p.members)


def _price(candidate: Candidate) -> int:
    """Return the number of free parameters; of a cause that changes the input its own alone: bending is paid for."""
    return 1 if candidate.role == "input" else price_of(candidate)


def _few(points: Sequence[Point], size: int) -> list[Point]:
    """The best of one kind; where it hides blocks, all that hide some at the same end of each run.

    Those that hide fewer seem better by what they gain on the others; that leaves none that is no better than the map.
    """
    hiding = [m for m in points[0].members if _hides(m.id)]
    if not hiding:
        return list(points[:_POINTS])
    rest = [m for m in points[0].members if not _hides(m.id)]
    beside = [p for p in points if [m for m in p.members if not _hides(m.id)] == rest]
    same = [p for p in beside if _end(p) == _end(points[0])]
    return [p for p in same if p.criterion(size) > 0.0] or same[:1]


def _end(point: Point) -> list[float]:
    """Return the sign of the shift of each cause that hides blocks."""
    return [float(np.sign(value)) for m in point.members if _hides(m.id) for value in m.values.values()]


def _hides(cause: str) -> bool:
    return CATALOGUE[cause].unseen_s is not None


def _behind(kinds: Kinds) -> list[Kinds]:
    """A model with one of its memories replaced by each cause that hides blocks, and so gained nothing on these."""
    hiding = [(id, "") for id in diagnosable_causes() if _hides(id)]
    memories = [k for k, (id, _) in enumerate(kinds) if CATALOGUE[id].family == "thermal_memory"]
    return [tuple(sorted([*kinds[:k], other, *kinds[k + 1 :]])) for k in memories for other in hiding]
