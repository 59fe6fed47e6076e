"""Which of all single causes and pairs is best, and when a pair is needed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..causes import CATALOGUE
from .candidates import searched
from .gains import Point

__all__ = ["APART", "best_of", "clear_pair", "makes_sense"]

_PAIR = 10.0  # what a pair must gain over the best single cause
_MEMBER = 15.0  # what each of a pair must gain beside the other
_SMALLEST = 0.03  # ... and of the pair's gain: what is less may be the imperfection of the other
_LEADING = 0.35  # share of a pair's gain that its best single cause must have
APART = 0.7
"""Difference of the logarithms of the parameters of two states of one kind: a factor of two. Nearer ones are one
state with another parameter."""


def makes_sense(point: Point) -> bool:
    """Pairs that make sense: one shape of the map; two of a kind only where that may be, and far apart."""
    a, b = point.members
    if a.id != b.id:
        return not all(CATALOGUE[m.id].family == "static_map" for m in point.members)
    if not searched(a.id).twice or a.channel != b.channel:
        return a.channel != b.channel
    x, y = (next(iter(m.values.values())) for m in (a, b))
    return bool(abs(np.log(x / y)) > APART)


def best_of(points: Sequence[Point], size: int) -> Point:
    return max(points, key=lambda p: p.criterion(size))


def clear_pair(singles: list[Point], best: Point, size: int) -> Point | None:
    """The best pair if it is clearly better than the best single cause and needs both its members."""
    alone = {id: max(p.gain for p in singles if p.members[0].id == id) for id in {m.id for m in best.members}}
    if best.criterion(size) < best_of(singles, size).criterion(size) + _PAIR:
        return None
    least = max(_MEMBER, _SMALLEST * best.gain)
    if any(best.gain - gain < least for gain in alone.values()):
        return None
    leading = max(p.gain for p in singles)
    return best if leading >= _LEADING * best.gain else None
