"""Attribution: which causes, how sure, and is anything left?

Stepwise with a look at all pairs: a first cause is taken when the search finds anything at all, further
ones while the search finds something beside them. What the chosen causes leave is held against the whole
dictionary (lack of fit).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...terms import CATALOGUE
from ..detect.search import Found, Search
from ..signatures.candidates import Candidate, searched
from .contest import Contest, contest
from .gains import Gains, Point
from .misfit import misfit
from .refine import Refined, refine, taken

__all__ = ["Attribution", "Rival", "attribute", "choose"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]
_Kind = tuple[str, str]  # cause and channel ("" for none)

_LEVEL = 0.01
_EQUIVALENT = 8.0  # difference of the criterion within which two explanations count as equal
_PAIR = 10.0  # what a pair must gain over the best single cause
_MEMBER = 15.0  # what each of a pair must gain beside the other
_SMALLEST = 0.03  # ... and of the pair's gain: what is less may be the imperfection of the other
_WELL = 0.08  # p-value of what is left that a pair must reach,
_NEARLY, _MOST = 1e-5, 0.95  # or this one with this share of the structure
_LEADING = 0.35  # share of a pair's gain that its best single cause must have
_MISFIT = 0.01


@dataclass(frozen=True)
class Rival:
    """Another cause, or channel, in place of a chosen one: its criterion's distance, 0 is equal."""

    id: str
    distance: float
    channel: str | None = None


@dataclass(frozen=True)
class Attribution:
    """What was found.

    Attributes:
        first: The search before any cause is taken, best first.
        causes: The chosen causes, strongest first.
        p_values: Of each, adjusted for the whole search.
        rivals: For each, other causes in its place, nearest first.
        gain: Twice the log-likelihood ratio of all causes together.
        misfit_p: p-value of what is left against the dictionary.
        share: Share of the detectable structure that the causes explain.
        last: The search after the last cause.
        other: The best shape that no cause has, and its lead over the causes.
    """

    first: list[Found]
    causes: tuple[Refined, ...]
    p_values: tuple[float, ...]
    rivals: tuple[tuple[Rival, ...], ...]
    gain: float
    misfit_p: float
    share: float
    last: list[Found]
    other: Contest

    @property
    def detected(self) -> bool:
        return bool(self.first) and self.first[0].p_value <= _LEVEL


@dataclass(frozen=True)
class _Stage:
    """A set of causes with everything that follows from it."""

    chosen: tuple[Candidate, ...]
    refined: tuple[Refined, ...]
    found: list[Found]
    gain: float
    misfit_p: float
    share: float

    @property
    def remains(self) -> bool:
        return self.misfit_p < _MISFIT or self.found[0].p_value <= _LEVEL

    @property
    def well(self) -> bool:
        """Whether next to nothing is left."""
        return self.misfit_p >= _WELL or (self.misfit_p >= _NEARLY and self.share >= _MOST)


def attribute(search: Search) -> Attribution:
    """Runs the search to its end."""
    first = search.detect(search.base)
    if first[0].p_value > _LEVEL:
        return Attribution(first, (), (), (), 0.0, 1.0, 1.0, first, Contest("", -np.inf))
    gains = Gains(search)
    singles = list(gains.single())
    stage = _stage(search, gains, _best(singles, gains.size).members)
    pairs: list[Point] = []
    if stage.remains:
        pairs = [p for p in gains.pairs() if _allowed(p)]
        pair = _pair(singles, pairs, gains.size)
        if pair is not None:
            stage = _deeper(search, gains, stage, pair.members)
    order = _by_strength(singles, stage.chosen)
    refined = tuple(stage.refined[k] for k in order)
    rivals = _rivals(singles, pairs, tuple(stage.chosen[k] for k in order), gains.size)
    return Attribution(
        first=first,
        causes=refined,
        p_values=tuple(_p_value(first, r.candidate) for r in refined),
        rivals=rivals,
        gain=stage.gain,
        misfit_p=stage.misfit_p,
        share=stage.share,
        last=stage.found,
        other=contest(
            gains,
            refined,
            [[r.id for r in near if r.id != c.candidate.id] for c, near in zip(refined, rivals, strict=True)],
        ),
    )


def _stage(search: Search, gains: Gains, chosen: tuple[Candidate, ...]) -> _Stage:
    refined = refine(search, gains, chosen)
    current, out = _with(search, refined)
    gain = _total(current, out)
    misfit_p, share = misfit(current, out, refined, gain)
    return _Stage(chosen, refined, current.detect(out), gain, misfit_p, share)


def _deeper(search: Search, gains: Gains, one: _Stage, pair: tuple[Candidate, ...]) -> _Stage:
    """The pair, or three causes, where these leave nothing; else the single cause with its remainder."""
    two = _stage(search, gains, pair)
    third = _third(two.found, pair) if two.remains else None
    if third is not None:
        three = _stage(search, gains, (*pair, third))
        if three.misfit_p >= _WELL > two.misfit_p:
            return three
    return two if two.well else one


def choose(search: Search, count: int) -> tuple[Refined, ...]:
    """The best one or two causes without asking whether there is any: for runs left out of a choice made."""
    gains = Gains(search)
    points = list(gains.single())
    best = _best(points, gains.size)
    if count > 1:
        pairs = [p for p in gains.pairs() if _allowed(p)]
        pair = _best(pairs, gains.size)
        best = pair if pair.criterion(gains.size) > best.criterion(gains.size) else best
    chosen = sorted(
        best.members, key=lambda m: -max((p.gain for p in points if p.members[0] == m), default=0.0)
    )
    return refine(search, gains, tuple(chosen)) if best.criterion(gains.size) > 0.0 else ()


def _allowed(point: Point) -> bool:
    """Pairs that make sense: one shape of the map; two of a kind only where that may be, and far apart."""
    a, b = point.members
    if a.id != b.id:
        return not all(CATALOGUE[m.id].family == "static_map" for m in point.members)
    if not searched(a.id).twice or a.channel != b.channel:
        return a.channel != b.channel
    x, y = (next(iter(m.values.values())) for m in (a, b))
    return bool(abs(np.log(x / y)) > 0.7)


def _best(points: list[Point], size: int) -> Point:
    return max(points, key=lambda p: p.criterion(size))


def _pair(singles: list[Point], pairs: list[Point], size: int) -> Point | None:
    """The best pair if it is clearly better than the best single cause and needs both its members."""
    best = _best(pairs, size)
    alone = {id: max(p.gain for p in singles if p.members[0].id == id) for id in {m.id for m in best.members}}
    if best.criterion(size) < _best(singles, size).criterion(size) + _PAIR:
        return None
    least = max(_MEMBER, _SMALLEST * best.gain)
    if any(best.gain - gain < least for gain in alone.values()):
        return None
    leading = max(p.gain for p in singles)
    return best if leading >= _LEADING * best.gain else None


def _third(found: list[Found], chosen: tuple[Candidate, ...]) -> Candidate | None:
    top = found[0]
    taken = {c.id for c in chosen}
    if top.p_value > _LEVEL or top.candidate.role == "structure" or top.candidate.id in taken:
        return None
    if top.candidate.role == "input":
        return None
    return top.candidate


def _with(search: Search, causes: tuple[Refined, ...]) -> tuple[Search, Index]:
    """The search with the causes' columns and tangents as part of every model."""
    current = search.extended(taken(causes))
    out = current.base
    if any(c.candidate.role == "input" for c in causes):
        out = out[search.n_map :]  # the replaced map stands among the added columns
    return current, out


def _total(current: Search, out: Index) -> float:
    """Energy that the causes explain beyond the map, at the likeliest colour, over the noise."""
    view = current.likeliest
    before = current.project(view, np.arange(current.n_map))
    after = current.project(view, out)
    return max((before.rest - after.rest) / view.scale**2, 0.0)


def _by_strength(singles: list[Point], chosen: tuple[Candidate, ...]) -> list[int]:
    alone = [max((p.gain for p in singles if p.members[0].id == c.id), default=0.0) for c in chosen]
    return sorted(range(len(chosen)), key=lambda k: -alone[k])


def _p_value(found: list[Found], cause: Candidate) -> float:
    same = (f.p_value for f in found if (f.candidate.id, f.candidate.channel) == (cause.id, cause.channel))
    return min(same, default=1.0)


def _rivals(
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
            tuple(
                Rival(id, own - v, channel or None) for (id, channel), v in ranked if own - v <= _EQUIVALENT
            )
        )
    return tuple(out)


def _kind(candidate: Candidate) -> _Kind:
    return candidate.id, candidate.channel or ""
