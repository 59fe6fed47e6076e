"""Do the chosen causes hold their own against shapes that no cause has (`others`)?"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bank import Other, proportional_map
from .catalogue import PENALTY
from .detect import ratio_of
from .likelihood import Gains
from .refine import Refined

__all__ = ["Contest", "contest"]

Array = NDArray[np.float64]

_BENT = "memory that does not act in proportion"
_BEND, _BEND_SHARE = 15.0, 0.1  # energy, and share of the cause's gain, that a map may bend more than before
_OWN = 1e-3  # share of a column's energy that must be its own beside the model


@dataclass(frozen=True, slots=True)
class Contest:
    """The best other shape and its lead over the causes, as a difference of the information criterion."""

    name: str
    lead: float


def contest(gains: Gains, causes: Sequence[Refined], rivals: Sequence[Sequence[str]]) -> Contest:
    """Each other shape alone and in the place of each of the causes, against all of them together.

    The criterion is that of the search: twice the log-likelihood less log N for every parameter. The causes
    have their parameters at the optimum, the others on their grid. A cause may stand back for one of its
    `rivals` (ids, for each cause): what matters is whether any causes do as well as the other shape.
    """
    edges = [gains.whiten(c.edges) for c in causes if c.edges is not None]
    white = [gains.whiten(c.columns) for c in causes]
    others = gains.whiten(gains.search.bank.others)
    groups = gains.search.bank.other_groups
    price = float(np.log(gains.size))
    own = max(
        _criterion(gains, edges, causes, white, price),
        *(_instead(gains, edges, causes, white, price, k, ids) for k, ids in enumerate(rivals)),
    )
    local = any(c.candidate.id == "map_too_coarse" for c in causes)
    instead = [g for g in groups if not (local and g.common)]
    found = []
    for count in range(len(causes)):
        for kept in itertools.combinations(range(len(causes)), count):
            some = [causes[k] for k in kept]
            held = _held(gains, edges, some, [white[k] for k in kept])
            base = _criterion(gains, edges, some, [white[k] for k in kept], price)
            best = _strongest(held, gains, others, price, instead)
            found.append(Contest(best.name, base + best.lead - own))
    if local:  # a map that a switch changes imitates a finer map of part of the range, so it has to add to it
        held = _held(gains, edges, causes, white)
        found.append(_strongest(held, gains, others, price, [g for g in groups if g.common]))
    found += [
        _bent(gains, edges, causes, white, k) for k, c in enumerate(causes) if c.candidate.role == "input"
    ]
    return max(found, key=lambda c: c.lead)


def _bent(
    gains: Gains, edges: list[Array], causes: Sequence[Refined], white: Sequence[Array], k: int
) -> Contest:
    """Whether a map of moved inputs needs more of the rate than a factor, more than the map of plain inputs does.

    A late map imitates memories that act other than in proportion by bending over dT/dt. The map of a true lag
    is less bent there than the one that stands in for it.
    """
    records, basis = gains.search.records, gains.search.bank.basis
    rest = [c for i, c in enumerate(causes) if i != k]
    beside = [w for i, w in enumerate(white) if i != k]
    moved = gains.whiten(proportional_map(records, basis, causes[k].candidate))
    plain = gains.whiten(proportional_map(records, basis, None))
    full = _energy(_held(gains, edges, causes, white), gains.target)
    bend = full - _energy(_orthonormal([gains.dropped, *edges, moved, *beside]), gains.target)
    static = _energy(_held(gains, edges, rest, beside), gains.target)
    usual = static - _energy(_orthonormal([gains.dropped, *edges, plain, *beside]), gains.target)
    return Contest(_BENT, bend - usual - max(_BEND, _BEND_SHARE * (full - static)))


def _orthonormal(blocks: Sequence[Array]) -> Array:
    q, r = np.linalg.qr(np.column_stack(blocks))
    size = np.abs(np.diag(r))
    return np.asarray(q[:, size > 1e-9 * size.max()])


def _instead(
    gains: Gains,
    edges: list[Array],
    causes: Sequence[Refined],
    white: list[Array],
    price: float,
    k: int,
    ids: Sequence[str],
) -> float:
    """Criterion with the k-th cause replaced by the best of some that add one column."""
    some = [c for i, c in enumerate(causes) if i != k]
    beside = [w for i, w in enumerate(white) if i != k]
    held = _held(gains, edges, some, beside)
    at = [s.start for c, s in gains.plain if c.id in ids and s.stop - s.start == 1]
    if not at:
        return -np.inf
    columns = gains.whole[:, at]
    rest = columns - held @ (held.T @ columns)
    power = np.einsum("ij,ij->j", rest, rest)
    own = power > _OWN * np.einsum("ij,ij->j", columns, columns)
    energy = np.where(own, (rest.T @ gains.target) ** 2 / np.where(own, power, 1.0), 0.0)
    base = _criterion(gains, edges, some, beside, price)
    return base + float(energy.max()) - price * max(PENALTY[i] for i in ids)


def _held(gains: Gains, edges: list[Array], causes: Sequence[Refined], white: Sequence[Array]) -> Array:
    """Orthonormal columns of a model: the map, plain or of another input, and what the causes add."""
    swapped = any(c.candidate.role == "input" for c in causes)
    return _orthonormal([gains.dropped, *edges, *([] if swapped else [gains.map]), *white])


def _energy(held: Array, y: Array) -> float:
    return float(((held.T @ y) ** 2).sum())


def _criterion(
    gains: Gains, edges: list[Array], causes: Sequence[Refined], white: Sequence[Array], price: float
) -> float:
    """Of a set of causes; one with a common variance of many weights is weighed as such."""
    random = [k for k, c in enumerate(causes) if c.candidate.role == "variance"][-1:]
    fixed = [k for k in range(len(causes)) if k not in random]
    held = _held(gains, edges, [causes[k] for k in fixed], [white[k] for k in fixed])
    total = _energy(held, gains.target) - price * sum(PENALTY[c.candidate.id] for c in causes)
    return total + sum(_common(held, white[k], gains.target) for k in random)


def _common(held: Array, columns: Array, y: Array) -> float:
    """Likelihood ratio of one variance common to the weights of some columns beside a model."""
    rest = columns - held @ (held.T @ columns)
    left, size, _ = np.linalg.svd(rest, full_matrices=False)
    keep = size > _OWN * max(float(np.linalg.norm(columns, axis=0).max()), 1e-300)
    if not keep.any():
        return 0.0
    return float(ratio_of((left[:, keep].T @ y) ** 2, size[keep] ** 2)[0])


def _strongest(held: Array, gains: Gains, others: Array, price: float, groups: Sequence[Other]) -> Contest:
    """The other shape that adds most to a model."""
    before = np.einsum("ij,ij->j", others, others)
    rest = others - held @ (held.T @ others)
    y = gains.target - held @ (held.T @ gains.target)
    a = rest.T @ y
    best = Contest("", -np.inf)
    for other in groups:
        value = _gain(other, rest[:, other.columns], a[other.columns], before[other.columns])
        free = other.parameters + (1 if other.common else other.columns.stop - other.columns.start)
        best = max(best, Contest(other.name, value - free * price), key=lambda c: c.lead)
    return best


def _gain(other: Other, columns: Array, a: Array, before: Array) -> float:
    """Twice the log-likelihood that one shape adds."""
    size, vectors = np.linalg.eigh(columns.T @ columns)
    keep = size > _OWN * float(before.max())
    if not keep.any() or (not other.common and not keep.all()):
        return 0.0
    energy = (a @ vectors[:, keep]) ** 2 / size[keep]
    return float(ratio_of(energy, size[keep])[0]) if other.common else float(energy.sum())
