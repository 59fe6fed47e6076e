"""Other causes that explain the recordings as well as a chosen one in its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .candidates import Candidate
from .gains import Point

__all__ = [
    "EQUIVALENT",
    "LOOKED_AT",
    "Kind",
    "Rival",
    "kind_of",
    "near_of",
    "odds_of",
    "probabilities_of",
    "ranked_rivals",
]

EQUIVALENT = 8.0
"""Difference of the criterion (twice the log-likelihood, priced) within which two explanations count as equal: odds
below e^4, about 50 to 1, name no cause."""

LOOKED_AT = 3.0 * EQUIVALENT
"""Farther behind, a rival has odds below 1 in 700 of the tempered likelihood."""

_TEMPER = 2.0 * float(np.log(9.0)) / EQUIVALENT
"""How much of a difference of the criterion counts in odds: so that one other explanation at the edge of what counts as
equal has 1 in 10. Map, noise colour and grid are known less well than the likelihood takes them to be."""

_SURE = 0.9  # probability from which one cause is told as the explanation
_TOLD = 0.01  # smaller ones are not worth a line

Kind = tuple[str, str]  # cause and channel ("" for none)


@dataclass(frozen=True)
class Rival:
    """Another cause, or channel, in place of a chosen one.

    Attributes:
        distance: How far its criterion is behind, 0 is equal.
        odds: Against the chosen one, where simulation has told them; None: those of the distance.
    """

    id: str
    distance: float
    channel: str | None = None
    odds: float | None = None


def probabilities_of(chosen: str, ranked: Sequence[Rival]) -> dict[str, float]:
    """Of the causes in one place, by id, the chosen one first; those below 1 in 100 are not told."""
    odds = {chosen: 1.0}
    for rival in ranked:
        if rival.id not in odds:  # another channel, or the chosen cause at another place, is no other cause
            odds[rival.id] = odds_of(rival)
    total = sum(odds.values())
    return {id: value / total for id, value in odds.items() if id == chosen or value / total >= _TOLD}


def odds_of(rival: Rival) -> float:
    """Of a rival against the chosen cause."""
    return float(np.exp(-0.5 * _TEMPER * rival.distance)) if rival.odds is None else rival.odds


def near_of(ranked: Sequence[Rival]) -> tuple[Rival, ...]:
    """Those of all rivals, the likeliest first, that explain the recordings as well as the chosen cause.

    These are all within `EQUIVALENT`, and as many more as it takes until they and the chosen one have 0.9.
    """
    odds = np.array([1.0, *map(odds_of, ranked)])
    enough = int(np.searchsorted(np.cumsum(odds) / odds.sum(), _SURE))
    return tuple(r for k, r in enumerate(ranked) if k < enough or r.distance <= EQUIVALENT)


def ranked_rivals(
    singles: list[Point], pairs: list[Point], chosen: tuple[Candidate, ...], size: int
) -> tuple[tuple[Rival, ...], ...]:
    """Other causes in the place of each chosen one, everything else kept in kind: all of them, nearest first."""
    kinds = [kind_of(c) for c in chosen]
    pool = singles if len(chosen) == 1 else pairs
    if len(chosen) > 2:
        return tuple(() for _ in chosen)
    best: dict[tuple[Kind, ...], float] = {}
    for p in pool:
        key = tuple(sorted(kind_of(m) for m in p.members))
        value = p.criterion(size)
        if value > best.get(key, -np.inf):
            best[key] = value
    own = best[tuple(sorted(kinds))]
    out = []
    for k in range(len(kinds)):
        others = kinds[:k] + kinds[k + 1 :]
        near: dict[Kind, float] = {}
        for key, value in best.items():
            rest = list(key)
            if any(o not in rest for o in others):
                continue
            for o in others:
                rest.remove(o)
            if rest != [kinds[k]]:
                near[rest[0]] = max(near.get(rest[0], -np.inf), value)
        ranked = sorted(near.items(), key=lambda item: -item[1])
        out.append(tuple(Rival(id, own - v, channel or None) for (id, channel), v in ranked))
    return tuple(out)


def kind_of(candidate: Candidate) -> Kind:
    """Cause and channel."""
    return candidate.id, candidate.channel or ""
