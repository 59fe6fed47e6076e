"""Other causes that explain the recordings as well as a chosen one in its place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..signatures.candidates import Candidate
from .gains import Point

__all__ = ["EQUIVALENT", "Rival", "rivals_of"]

EQUIVALENT = 8.0
"""Difference of the criterion (twice the log-likelihood, priced) within which two explanations count as equal: odds
below e^4, about 50 to 1, name no cause."""

_Kind = tuple[str, str]  # cause and channel ("" for none)


@dataclass(frozen=True)
class Rival:
    """Another cause, or channel, in place of a chosen one: its criterion's distance, 0 is equal."""

    id: str
    distance: float
    channel: str | None = None


def rivals_of(
    singles: list[Point], pairs: list[Point], chosen: tuple[Candidate, ...], size: int
) -> tuple[tuple[Rival, ...], ...]:
    """Other causes in the place of each chosen one, everything else kept in kind."""
    kinds = [_kind(c) for c in chosen]
    pool = singles if len(chosen) == 1 else pairs
    if len(chosen) > 2:
        return tuple(() for _ in chosen)
    best: dict[tuple[_Kind, ...], float] = {}
    for p in pool:
        key = tuple(sorted(_kind(m) for m in p.members))
        value = p.criterion(size)
        if value > best.get(key, -np.inf):
            best[key] = value
    own = best[tuple(sorted(kinds))]
    out = []
    for k in range(len(kinds)):
        others = kinds[:k] + kinds[k + 1 :]
        near: dict[_Kind, float] = {}
        for key, value in best.items():
            rest = list(key)
            if any(o not in rest for o in others):
                continue
            for o in others:
                rest.remove(o)
            if rest != [kinds[k]]:
                near[rest[0]] = max(near.get(rest[0], -np.inf), value)
        ranked = sorted(near.items(), key=lambda item: -item[1])
        out.append(
            tuple(Rival(id, own - v, channel or None) for (id, channel), v in ranked if own - v <= EQUIVALENT)
        )
    return tuple(out)


def _kind(candidate: Candidate) -> _Kind:
    return candidate.id, candidate.channel or ""
