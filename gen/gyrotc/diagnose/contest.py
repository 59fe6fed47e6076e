"""Do the chosen causes hold their own against shapes that no cause has (`alternatives`)?"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from ..common.orthonormal import orthonormal
from .candidates import searched
from .changed_input import proportional_map
from .gains import Gains
from .refine import Refined
from .scores import ratio_of
from .signature_bank import Alternative
from .wide_memory import WideMemory

__all__ = ["Contest", "contest"]


_BENT = "memory that does not act in proportion"
_BEND, _BEND_SHARE = 15.0, 0.1  # energy, and share of the cause's gain, that a map may bend more than before
_OWN = 1e-3  # share of a column's energy that must be its own beside the model


@dataclass(frozen=True, slots=True)
class Contest:
    """The best other shape and its lead over the causes, as a difference of the information criterion."""

    name: str
    lead: float


def contest(
    gains: Gains, causes: Sequence[Refined], rivals: Sequence[Sequence[str]], wide: WideMemory | None = None
) -> Contest:
    """Each other shape alone and in the place of each of the causes, against all of them together.

    The criterion is that of the search: twice the log-likelihood less log N for every parameter. The causes
    have their parameters at the optimum, the others on their grid. A cause may stand back for one of its
    `rivals` (ids, for each cause): what matters is whether any causes do as well as the other shape. Hysteresis
    stands as the form that it was found in (`wide`): a switch with a gap is one of its kind.
    """
    models = _NestedModels(gains, causes)
    every = range(len(causes))
    own = max(models.criterion(every), *(models.instead(k, ids) for k, ids in enumerate(rivals)))
    if wide is not None:
        beside = [k for k in every if not searched(causes[k].candidate.id).loops]
        own = max(own, models.criterion(beside) + wide.criterion(gains.size))
    local = any(CATALOGUE[c.candidate.id].kind == "static" for c in causes)
    shapes = gains.search.bank.alternative_groups
    found = []
    for count in every:
        for kept in itertools.combinations(every, count):
            best = models.strongest(kept, [s for s in shapes if not (local and s.common)])
            found.append(Contest(best.name, models.criterion(kept) + best.lead - own))
    if local:  # a map that a switch changes imitates a finer map of part of the range, so it has to add to it
        found.append(models.strongest(every, [s for s in shapes if s.common]))
    found += [models.bent(k) for k in every if causes[k].candidate.role == "input"]
    return max(found, key=lambda c: c.lead)


class _NestedModels:
    """Models made of some of the causes (by number), and what other shapes add to them."""

    def __init__(self, gains: Gains, causes: Sequence[Refined]) -> None:
        self.gains, self.causes = gains, causes
        self.y = gains.target
        self.price = float(np.log(gains.size))
        self.always = [gains.beside, *(gains.whiten(c.edges) for c in causes if c.edges is not None)]
        self.white = [gains.whiten(c.columns) for c in causes]
        self.others = gains.whiten(gains.search.bank.alternatives)

    def held(self, kept: Sequence[int]) -> FloatArray:
        """Orthonormal columns of a model: the map, plain or of another input, and what the causes add."""
        swapped = any(self.causes[k].candidate.role == "input" for k in kept)
        static = [] if swapped else [self.gains.map]
        return orthonormal(*self.always, *static, *(self.white[k] for k in kept))

    def criterion(self, kept: Sequence[int]) -> float:
        """Of a set of causes; one with a common variance of many weights is weighed as such."""
        random = [k for k in kept if self.causes[k].candidate.role == "variance"][-1:]
        held = self.held([k for k in kept if k not in random])
        total = _energy(held, self.y) - self.price * sum(
            searched(self.causes[k].candidate.id).price for k in kept
        )
        return total + sum(_common(held, self.white[k], self.y) for k in random)

    def instead(self, k: int, ids: Sequence[str]) -> float:
        """Criterion with the k-th cause replaced by the best of some that add one column."""
        at = [s.start for c, s in self.gains.plain if c.id in ids and s.stop - s.start == 1]
        if not at:
            return -np.inf
        kept = self._without(k)
        columns = self.gains.whole[:, at]
        held = self.held(kept)
        rest = columns - held @ (held.T @ columns)
        power = np.einsum("ij,ij->j", rest, rest)
        own = power > _OWN * np.einsum("ij,ij->j", columns, columns)
        energy = np.where(own, (rest.T @ self.y) ** 2 / np.where(own, power, 1.0), 0.0)
        return self.criterion(kept) + float(energy.max()) - self.price * max(searched(i).price for i in ids)

    def strongest(self, kept: Sequence[int], shapes: Sequence[Alternative]) -> Contest:
        """The other shape that adds most to a model."""
        held = self.held(kept)
        before = np.einsum("ij,ij->j", self.others, self.others)
        rest = self.others - held @ (held.T @ self.others)
        a = rest.T @ (self.y - held @ (held.T @ self.y))
        best = Contest("", -np.inf)
        for shape in shapes:
            value = _gain(shape, rest[:, shape.columns], a[shape.columns], before[shape.columns])
            free = shape.parameters + (1 if shape.common else shape.columns.stop - shape.columns.start)
            best = max(best, Contest(shape.name, value - free * self.price), key=lambda c: c.lead)
        return best

    def bent(self, k: int) -> Contest:
        """Whether a map of moved inputs needs more of the rate than a factor, more than that of plain inputs does.

        A late map imitates memories that act other than in proportion by bending over dT/dt. The map of a true
        lag is less bent there than the one that stands in for it.
        """
        records, basis = self.gains.search.records, self.gains.search.bank.basis
        beside = [self.white[i] for i in self._without(k)]
        moved = self.gains.whiten(proportional_map(records, basis, self.causes[k].candidate))
        plain = self.gains.whiten(proportional_map(records, basis, None))
        full = _energy(self.held(range(len(self.causes))), self.y)
        static = _energy(self.held(self._without(k)), self.y)
        bend = full - _energy(orthonormal(*self.always, moved, *beside), self.y)
        usual = static - _energy(orthonormal(*self.always, plain, *beside), self.y)
        return Contest(_BENT, bend - usual - max(_BEND, _BEND_SHARE * (full - static)))

    def _without(self, k: int) -> list[int]:
        return [i for i in range(len(self.causes)) if i != k]


def _energy(held: FloatArray, y: FloatArray) -> float:
    return float(((held.T @ y) ** 2).sum())


def _common(held: FloatArray, columns: FloatArray, y: FloatArray) -> float:
    """Likelihood ratio of one variance common to the weights of some columns beside a model."""
    rest = columns - held @ (held.T @ columns)
    left, size, _ = np.linalg.svd(rest, full_matrices=False)
    keep = size > _OWN * max(float(np.linalg.norm(columns, axis=0).max()), 1e-300)
    if not keep.any():
        return 0.0
    return float(ratio_of((left[:, keep].T @ y) ** 2, size[keep] ** 2)[0])


def _gain(other: Alternative, columns: FloatArray, a: FloatArray, before: FloatArray) -> float:
    """Twice the log-likelihood that one shape adds."""
    size, vectors = np.linalg.eigh(columns.T @ columns)
    keep = size > _OWN * float(before.max())
    if not keep.any() or (not other.common and not keep.all()):
        return 0.0
    energy = (a @ vectors[:, keep]) ** 2 / size[keep]
    return float(ratio_of(energy, size[keep])[0]) if other.common else float(energy.sum())
