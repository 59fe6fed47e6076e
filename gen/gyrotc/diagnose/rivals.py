"""Other causes that explain the recordings as well, and whether these recordings can distinguish them.

The likelihood of each cause is known, but not how far it can be trusted: a cause with a free time constant follows
noise more closely than one without, and offsets that are drawn anew in every run may lie on a line by chance. So
recordings are simulated (parametric bootstrap: Efron and Tibshirani 1993, chapter 6) in which the named cause, or the
rival in its place, acts at its fitted size, with the fitted noise on these temperatures. In each the lead of the named
cause over the rival is computed as it was in the measured ones. How often a lead like the measured one comes of the
one, and how often of the other, is the odds. Everything is inner products of whitened columns; nothing is refitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..common.arrays import FloatArray
from ..common.statistics import orthonormal
from .candidates import Candidate, price_of
from .posterior import LOOKED_AT, Rival, odds_of
from .profile_likelihood import Gains, Point
from .scores import ratio_of
from .tolerances import INDEPENDENT

RivalKey = tuple[str, str]  # cause and channel ("" for none)
Kinds = tuple[RivalKey, ...]  # of a model, sorted
_T = TypeVar("_T")


def ranked_rivals(pool: Sequence[Point], chosen: tuple[Candidate, ...], k: int, size: int) -> tuple[Rival, ...]:
    """Return all other causes in the place of the k-th chosen one, everything else kept in kind, nearest first.

    Args:
        pool: All models with as many causes as are chosen.
        size: Number of blocks.
    """
    own, others = rival_key(chosen[k]), [rival_key(c) for c in (*chosen[:k], *chosen[k + 1 :])]
    best: dict[RivalKey, float] = {}
    for point in pool:
        kind = _beside([rival_key(member) for member in point.members], others)
        if kind is not None:
            best[kind] = max(best.get(kind, -np.inf), point.criterion(size))
    ranked = sorted(((v, kind) for kind, v in best.items() if kind != own), reverse=True)
    return tuple(Rival(id, best[own] - v, channel or None) for v, (id, channel) in ranked)


def rival_key(candidate: Candidate) -> RivalKey:
    """Cause and channel."""
    return candidate.id, candidate.channel or ""


def kinds_of(members: Sequence[Candidate]) -> Kinds:
    """Return the kinds of a model, sorted."""
    return tuple(sorted(map(rival_key, members)))


def _beside(members: Sequence[_T], others: Sequence[_T]) -> _T | None:
    """The one member of a model besides the others; None where the model lacks one of these."""
    rest = list(members)
    for other in others:
        if other not in rest:
            return None
        rest.remove(other)
    return rest[0]


_DRAWS = 300  # of each cause: odds of 9 to 1 are then known to about a third
_SEED = 17  # any: the same recordings have the same odds
_MOST_RIVALS = 4  # the nearest: whoever comes after them adds little to their sum
_MOST_POINTS, _REACH = 8, 15.0
"""Points of a cause's grid that stand for it: its best ones on these recordings, as far as they explain nearly as much
(e^-7.5 of the likelihood)."""
_FINEST = 0.05  # difference of the criterion below which nothing is decided: one part in 40 of the likelihood


def calibrated(
    gains: Gains, pool: Sequence[Point], chosen: tuple[Candidate, ...], k: int, ranked: Sequence[Rival]
) -> tuple[Rival, ...]:
    """The rivals of the k-th cause with odds no better for the named cause than simulation bears out, likeliest first.

    Args:
        gains: Of the measured recordings.
        pool: All models with as many causes as are chosen.
        chosen: The named causes, one or two; the other one stays at its place in the grid.
        ranked: All rivals of the k-th, nearest first.
    """
    near = [r for r in ranked if r.distance <= LOOKED_AT and r.odds is None and r.id != chosen[k].id]
    near = near[:_MOST_RIVALS]
    if not near:
        return tuple(ranked)
    others = (*chosen[:k], *chosen[k + 1 :])
    kinds = [rival_key(chosen[k]), *((r.id, r.channel or "") for r in near)]
    place = RivalPlace(gains, others)
    models = {kind: [place.model(c) for c in best_points(pool, others, kind)] for kind in kinds}
    simulated = SimulatedRivals(place, {kind: found for kind, found in models.items() if found})
    odds = {}
    for rival, kind in zip(near, kinds[1:], strict=True):
        if kinds[0] in simulated.models and kind in simulated.models:
            odds[rival] = max(odds_of(rival), simulated.odds(kinds[0], kind))
    reported = [replace(r, odds=odds[r]) if r in odds else r for r in ranked]
    return tuple(sorted(reported, key=lambda r: -odds_of(r)))


def best_points(pool: Sequence[Point], others: tuple[Candidate, ...], kind: RivalKey) -> list[Candidate]:
    """The best points of a cause's grid beside the others."""
    found: list[tuple[float, Candidate]] = []
    for point in pool:
        own = _beside(point.members, others)
        if own is not None and rival_key(own) == kind and all(own != c for _, c in found):
            found.append((point.gain, own))
    found.sort(key=lambda entry: -entry[0])
    return [c for gain, c in found[:_MOST_POINTS] if gain >= found[0][0] - _REACH]


@dataclass(frozen=True)
class RivalModel:
    """A cause at one point of its grid, as directions in whitened space.

    Attributes:
        held: Orthonormal columns of all that the model holds besides what `plus` adds, shape (N, h).
        plus: Orthonormal columns that it adds, shape (N, r); of a changed input the whole model.
        minus: Of a changed input the columns of the model with the plain map, shape (N, s); else none.
        size: Of weights with a common variance: energies of the directions, shape (r,).
        price: Of its parameters in the criterion.
    """

    held: FloatArray
    plus: FloatArray
    minus: FloatArray
    size: FloatArray | None
    price: float

    def gain(self, plus: FloatArray, minus: FloatArray) -> FloatArray:
        """Gain over the model without it, from inner products with the data, shapes (r, S) and (s, S)."""
        if self.size is not None:
            return np.asarray(ratio_of((plus**2).T, self.size)[0])
        return np.asarray((plus**2).sum(axis=0) - (minus**2).sum(axis=0))

    def drawn(self, target: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray | None]:
        """Return the effect of the cause at its fitted size, shape (N,), and weights of `plus` drawn anew, (r, S)."""
        held = self.held @ (self.held.T @ target)
        along = self.plus.T @ target
        if self.size is None:
            return np.asarray(held + self.plus @ along), None
        variance = float(ratio_of((along**2)[None], self.size)[1][0])
        spread = np.sqrt(variance * self.size)[:, None]
        return np.asarray(held), spread * rng.standard_normal((len(spread), _DRAWS))


class RivalPlace:
    """The place of one cause beside the others."""

    def __init__(self, gains: Gains, others: tuple[Candidate, ...]) -> None:
        self.gains = gains
        self.blocks, self.map = [gains.beside], gains.map
        self.price = float(np.log(gains.size))
        for other in others:
            if other.role == "input":
                self.map = self.gains.replaced(other)
                self.blocks += self.gains.edges(other)
            else:
                self.blocks.append(gains.white(other))
        self.held = orthonormal(*self.blocks, self.map)

    def model(self, candidate: Candidate) -> RivalModel:
        none = np.zeros((self.gains.size, 0))
        price = self.price * price_of(candidate)
        if candidate.role == "input":
            blocks = [*self.blocks, *self.gains.edges(candidate)]
            changed = orthonormal(*blocks, self.gains.replaced(candidate))
            return RivalModel(none, changed, orthonormal(*blocks, self.map), None, price)
        columns = self.gains.white(candidate)
        rest = columns - self.held @ (self.held.T @ columns)
        left, size, _ = np.linalg.svd(rest, full_matrices=False)
        own = size**2 > INDEPENDENT * np.linalg.norm(columns, axis=0).max() ** 2
        random = candidate.role == "variance" and own.any()
        return RivalModel(self.held, left[:, own], none, size[own] ** 2 if random else None, price)


class SimulatedRivals:
    """Simulated recordings of every cause in a place, and how well each cause explains them."""

    def __init__(self, place: RivalPlace, models: dict[RivalKey, list[RivalModel]]) -> None:
        self.models = models
        self.target = place.gains.target
        every = [m for found in models.values() for m in found]
        self._all = np.column_stack([part for m in every for part in (m.plus, m.minus)])
        self._rng = np.random.default_rng(_SEED)
        self._noise = self._all.T @ self._rng.standard_normal((self.target.size, _DRAWS))
        self.measured = self._criteria(self._all.T @ self.target[:, None])
        self.drawn = {kind: self._criteria(self._of(found[0])) for kind, found in models.items()}

    def odds(self, named: RivalKey, rival: RivalKey) -> float:
        """Return how much likelier a lead like the measured one is if the rival acts than if the named cause does.

        At most 1: the rival has the worse criterion. Densities are of normal kernels (Silverman 1986, eq. 3.28) at the
        measured lead, as wide as leads of the named cause, about which it lies, ask for: those of offsets drawn anew
        spread over far more. Half a draw is added to each, so that no number of them makes anything impossible.
        """
        lead = float((self.measured[named] - self.measured[rival])[0])
        of = {kind: self.drawn[kind][named] - self.drawn[kind][rival] for kind in (named, rival)}
        width = max(1.06 * _DRAWS**-0.2 * float(of[named].std()), _FINEST)
        near = {kind: float(np.exp(-0.5 * ((x - lead) / width) ** 2).sum()) for kind, x in of.items()}
        return min((near[rival] + 0.5) / (near[named] + 0.5), 1.0)

    def _of(self, model: RivalModel) -> FloatArray:
        """Inner products with recordings in which a cause acts as it was fitted, shape (directions, draws)."""
        mean, weights = model.drawn(self.target, self._rng)
        found = (self._all.T @ mean)[:, None] + self._noise
        return np.asarray(found if weights is None else found + (self._all.T @ model.plus) @ weights)

    def _criteria(self, products: FloatArray) -> dict[RivalKey, FloatArray]:
        """The criterion of every cause at its best point, shape (draws,) each."""
        out: dict[RivalKey, FloatArray] = {}
        at = 0
        for kind, found in self.models.items():
            best = np.full(products.shape[1], -np.inf)
            for m in found:
                middle = at + m.plus.shape[1]
                end = middle + m.minus.shape[1]
                best = np.maximum(best, m.gain(products[at:middle], products[middle:end]) - m.price)
                at = end
            out[kind] = best
        return out
