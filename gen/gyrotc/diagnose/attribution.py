"""Attribution: which causes, alone or in pairs, how sure, and is anything left?

Stepwise with a look at all pairs: a first cause is taken when the search finds anything at all, a clear pair in its
place, and beside a cause that is constant in each run what the search finds within the runs. What the chosen causes
leave is compared with the whole dictionary (lack of fit).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from ..results.diagnosed import NOTHING, UNNAMED
from .candidates import Candidate, price_of, searched
from .detection import Found, detect
from .joined import Held
from .marginal_likelihood import MarginalLikelihood
from .posterior import Posterior, Rival, odds_of
from .profile_likelihood import Gains, Point, best_of, clear_pair, makes_sense
from .refinement import Refined, cancelling, model_columns, refine, sized
from .rivals import calibrated, kinds_of, ranked_rivals
from .search import Search
from .unexplained import Contest, Misfit, contest, explained, misfit
from .wide_memory import WideMemory, outlasts, rate_independent

# Level of the whole search, and of what causes leave: chance alone exceeds it in one of a hundred campaigns
# (docs/diagnosis.md).
LEVEL = 0.01
# A pair or three causes are taken for the whole explanation if what they leave has at least this p-value.
_WELL = 0.08
# If they explain at least this share of the structure, the lower p-value is enough, as no formula is exact.
_MOST = 0.95
_NEARLY = 1e-5


@dataclass(frozen=True)
class Attribution:
    """Result of the search: the named causes with their posterior.

    Attributes:
        first: The search before any cause is taken, best first.
        detected: Whether it found anything that is likelier than nothing.
        causes: The chosen causes, strongest first.
        p_values: The p-value of each cause, adjusted for the whole search.
        posteriors: For each, the probabilities of everything in its place; none of a single cycle.
        gain: Twice the log-likelihood ratio of all causes together.
        left: What all causes leave.
        last: The search after the last cause.
        other: The best shape that no cause has, and its lead over the causes.
        refuted: Whether the causes make left-out history worse (`shipping`), so that none is named.
        wide: Hysteresis of any form, by which `left` is judged where one play leaves something; else None.
    """

    first: list[Found]
    detected: bool
    causes: tuple[Refined, ...]
    p_values: tuple[float, ...]
    posteriors: tuple[Posterior, ...]
    gain: float
    left: Misfit
    last: list[Found]
    other: Contest
    wide: WideMemory | None = None
    refuted: bool = False

    def without_causes(self) -> Attribution:
        """Return the result with nothing named."""
        return replace(self, causes=(), p_values=(), posteriors=(), wide=None)

    @property
    def columns(self) -> FloatArray:
        """All columns that stand in the model when the causes are named, shape (N, k)."""
        return _columns(self.causes, self.wide)


@dataclass(frozen=True)
class _Stage:
    """A set of causes with everything that follows from it.

    Attributes:
        within_runs: Whether the search found one of them only beside another that is constant in each run.
    """

    chosen: tuple[Candidate, ...]
    refined: tuple[Refined, ...]
    found: list[Found]
    gain: float
    left: Misfit
    wide: WideMemory | None = None
    within_runs: bool = False

    @property
    def remains(self) -> bool:
        return self.left.p_value < LEVEL or self.found[0].p_value <= LEVEL

    @property
    def well(self) -> bool:
        """True if the causes leave so little that a set of them is taken for the whole explanation."""
        return self.left.p_value >= _WELL or (self.left.p_value >= _NEARLY and self.left.share >= _MOST)


def attribute(search: Search) -> Attribution:
    """Run the search to its end."""
    first = detect(search, "map and beside")
    nothing = Attribution(first, False, (), (), (), 0.0, Misfit(1.0, 1.0, 1.0), first, Contest("", -np.inf))
    if first[0].p_value > LEVEL:
        return nothing
    gains = Gains(search)
    singles = list(gains.single())
    if CATALOGUE[best_of(singles, gains.size).members[0].id].family == "static_map":
        singles += gains.waves()
    weigher = MarginalLikelihood(gains)
    single = _single(gains, singles, weigher)
    stage = _stage(search, gains, single.members)
    if stage is None:
        return replace(nothing, detected=True)
    pairs: list[Point] = []
    if stage.remains:
        pairs = [p for p in gains.pairs() if makes_sense(p)]
        pair = clear_pair(singles, weigher.preferred(pairs), gains.size)
        within = _within_runs(stage, pairs, gains.size) if pair is None else None
        if pair is not None:
            stage = _beside(search, gains, stage, pair)
        elif within is not None:
            two = replace(_beside(search, gains, stage, within), within_runs=True)
            both = _concluded(search, weigher, singles, pairs, two, nothing)
            if all(posterior.is_named for posterior in both.posteriors):  # else the first keeps its name
                return both
    return _concluded(search, weigher, singles, pairs, stage, nothing)


def _concluded(
    search: Search,
    weigher: MarginalLikelihood,
    singles: list[Point],
    pairs: list[Point],
    stage: _Stage,
    nothing: Attribution,
) -> Attribution:
    """Return the posteriors of a set of causes; `nothing` where a single one is less likely than chance."""
    gains = weigher.gains
    stage = _widened(search, gains, stage)
    order = _by_strength(singles, stage.chosen)
    stage = replace(
        stage,
        chosen=tuple(stage.chosen[k] for k in order),
        refined=tuple(stage.refined[k] for k in order),
    )
    ahead = _ahead(gains, stage, singles)
    places = [_place(search, weigher, singles, pairs, stage, k) for k in range(len(stage.chosen))]
    near = [
        Posterior(stage.chosen[k].id, _ranked(weigher, place, stage.chosen, k, ahead)) for k, place in enumerate(places)
    ]
    other = _contest(gains, stage, near)
    posteriors = []
    for k, (place, likely) in enumerate(zip(places, near, strict=True)):
        without = Rival(UNNAMED, -other.lead), Rival(NOTHING, place.over_nothing + _more(stage.chosen[k], ahead))
        if len(places) == 1 and Posterior(likely.id, without).is_chance:
            return nothing
        simulated = calibrated(gains, place.pool, stage.chosen, k, likely.rivals)
        posteriors.append(Posterior(likely.id, (*simulated, *without)))
    return Attribution(
        first=nothing.first,
        detected=True,
        causes=stage.refined,
        p_values=tuple(_p_value(nothing.first, r.candidate) for r in stage.refined),
        posteriors=tuple(posteriors),
        gain=stage.gain,
        left=stage.left,
        last=stage.found,
        other=other,
        wide=stage.wide,
    )


def _single(gains: Gains, singles: list[Point], weigher: MarginalLikelihood) -> Point:
    """The best single cause; whether a memory fades is asked with hypotheses that are equally wide."""
    best = weigher.preferred(singles)
    if CATALOGUE[best.members[0].id].family != "thermal_memory":
        return best
    near = ranked_rivals(singles, best.members, 0, gains.size)
    behind = [r.distance for r in weigher.judged(singles, best.members, 0, near) if searched(r.id).loops]
    rival = max(best.criterion(gains.size), weigher.criterion(best.members, np.zeros(gains.size, dtype=bool)))
    if not behind or not outlasts(gains, behind[0], rival):
        return best
    return best_of([p for p in singles if searched(p.members[0].id).loops], gains.size)


@dataclass(frozen=True)
class _Place:
    """The place of one of the chosen causes.

    Attributes:
        pool: All models in which something stands in it beside the other causes.
        over_nothing: By how much the criterion of the chosen cause is better than that of nothing in its place.
    """

    pool: list[Point]
    over_nothing: float


def _place(
    search: Search, weigher: MarginalLikelihood, singles: list[Point], pairs: list[Point], stage: _Stage, k: int
) -> _Place:
    """The place of the k-th cause.

    Beside two others, or one in whose runs it was found, the search begins anew with these in every model: the noise
    within runs is known only then.
    """
    gains, chosen = weigher.gains, stage.chosen
    size, others = gains.size, (*chosen[:k], *chosen[k + 1 :])
    if not others:
        best = max((p for p in singles if kinds_of(p.members) == kinds_of(chosen)), key=lambda p: p.criterion(size))
        return _Place(singles, weigher.over_nothing(singles, best))
    if len(others) == 1 and not (stage.within_runs and _is_between_runs(others[0])):
        pool, without = pairs, max(p.criterion(size) for p in singles if kinds_of(p.members) == kinds_of(others))
    else:
        beside = Gains(_with(search, (*stage.refined[:k], *stage.refined[k + 1 :]))[0])
        pool = [Point((*others, *point.members), point.gain) for point in beside.single()]
        without = -sum(map(price_of, others)) * float(np.log(size))
    own = max(p.criterion(size) for p in pool if kinds_of(p.members) == kinds_of(chosen))
    return _Place(pool, own - without)


def _ranked(
    weigher: MarginalLikelihood, place: _Place, chosen: tuple[Candidate, ...], k: int, ahead: float
) -> tuple[Rival, ...]:
    """Other causes in the place of the k-th, nearest first.

    Args:
        ahead: By how much hysteresis in the form that it was found in is ahead of the play that stands for it.
    """
    near = ranked_rivals(place.pool, chosen, k, weigher.gains.size)
    judged = weigher.judged(place.pool, chosen, k, near)
    return tuple(_behind(rival, _more(chosen[k], ahead)) for rival in judged)


def _more(candidate: Candidate, ahead: float) -> float:
    return ahead if searched(candidate.id).loops else 0.0


def _behind(rival: Rival, more: float) -> Rival:
    """A rival that is not ahead, and farther behind by some criterion."""
    moved = replace(rival, distance=max(rival.distance, 0.0) + more, odds=None)
    return moved if rival.odds is None else replace(moved, odds=odds_of(moved))


def _ahead(gains: Gains, stage: _Stage, singles: list[Point]) -> float:
    if stage.wide is None or len(stage.chosen) > 1:
        return 0.0
    play = best_of([p for p in singles if p.members == stage.chosen], gains.size)
    return max(stage.wide.criterion(gains.size) - play.criterion(gains.size), 0.0)


def _contest(gains: Gains, stage: _Stage, near: Sequence[Posterior]) -> Contest:
    """The best shape that no cause has, against the causes or any other one that does as well in their place."""
    others = [[r.id for r in place.remaining if r.id != place.id] for place in near]
    return contest(gains, stage.refined, others, stage.wide)


def _stage(search: Search, gains: Gains, chosen: tuple[Candidate, ...]) -> _Stage | None:
    """Judge a set of causes; None if causes and map have a column for every block: nothing can be said of them."""
    refined = refine(search, gains, chosen)
    columns = gains.map.shape[1] + gains.beside.shape[1] + model_columns(refined).shape[1]
    if columns >= search.y.size:
        return None
    current, held = _with(search, refined)
    gain = explained(current, current.likeliest, held)
    return _Stage(chosen, refined, detect(current, held), gain, misfit(current, held, refined))


def _widened(search: Search, gains: Gains, stage: _Stage) -> _Stage:
    """Judge what a play leaves beside hysteresis of any form, if the recordings speak for such a memory.

    The family is one name for every memory with loops that do not depend on the rate; a table's play is but one.
    """
    loops = [searched(c.id).loops for c in stage.chosen]
    if (
        stage.wide is not None
        or stage.left.worst >= _WELL
        or not any(loops)
        or any(c.role == "input" for c in stage.chosen)
    ):
        return stage
    beside = [c.columns for c, loop in zip(stage.refined, loops, strict=True) if not loop]
    wide = rate_independent(gains, beside)
    if wide is None:
        return stage
    current, held = _with(search, stage.refined, wide)
    left = misfit(current, held, stage.refined, chance=wide.columns.shape[1])
    return replace(stage, found=detect(current, held), left=left, wide=wide)


def _within_runs(stage: _Stage, pairs: Sequence[Point], size: int) -> Point | None:
    """Return the best pair of a cause that is constant in each run and the one that the search finds within runs.

    The first has no form within a run, so what is found there is not its imperfection, and the level of the search is
    enough.
    """
    (first,) = stage.chosen
    found = next((f.candidate for f in stage.found if f.p_value <= LEVEL and f.candidate.role == "columns"), None)
    if found is None or not _is_between_runs(first) or _is_between_runs(found):
        return None
    both = [p for p in pairs if kinds_of(p.members) == kinds_of((first, found))]
    return best_of(both, size) if both else None


def _is_between_runs(candidate: Candidate) -> bool:
    return CATALOGUE[candidate.id].family == "between_runs"


def _beside(search: Search, gains: Gains, one: _Stage, pair: Point) -> _Stage:
    """Add a second cause to a first, unless hysteresis of another form does as well as both."""
    widened = _widened(search, gains, one)
    if widened.wide is not None and widened.wide.criterion(gains.size) >= pair.criterion(gains.size):
        return widened
    return _deeper(search, gains, one, pair.members)


def _deeper(search: Search, gains: Gains, one: _Stage, pair: tuple[Candidate, ...]) -> _Stage:
    """The pair, or three causes, where these leave nothing; else the single cause with its remainder."""
    two = _stage(search, gains, pair)
    if two is None or cancelling(two.refined):
        return one
    third = _third(two.found, pair) if two.remains else None
    if third is not None:
        three = _stage(search, gains, (*pair, third))
        well = three is not None and three.left.p_value >= _WELL > two.left.p_value
        if three is not None and well and _plausible(gains, three.refined):
            return three
    return two if two.well else one


def _plausible(gains: Gains, causes: tuple[Refined, ...]) -> bool:
    """Test whether no cause is larger than accepted: the third one comes from the search, which asks for no size."""
    return all(gains.limit.allows(c.contribution) for c in causes if sized(c.candidate)) and not cancelling(causes)


def choose(search: Search, count: int) -> tuple[Refined, ...]:
    """The best one or two causes without asking whether there is any: for runs left out of a choice made."""
    gains = Gains(search)
    points = list(gains.single())
    weigher = MarginalLikelihood(gains)
    best = weigher.preferred(points)
    if count > 1:
        pairs = [p for p in gains.pairs() if makes_sense(p)]
        pair = weigher.preferred(pairs)
        best = pair if pair.criterion(gains.size) > best.criterion(gains.size) else best
    chosen = sorted(best.members, key=lambda m: -max((p.gain for p in points if p.members[0] == m), default=0.0))
    return refine(search, gains, tuple(chosen)) if best.criterion(gains.size) > 0.0 else ()


def _third(found: list[Found], chosen: tuple[Candidate, ...]) -> Candidate | None:
    top = found[0]
    present = {c.id for c in chosen}
    if top.p_value > LEVEL or top.candidate.role == "structure" or top.candidate.id in present:
        return None
    if top.candidate.role == "input":
        return None
    return top.candidate


def _with(search: Search, causes: tuple[Refined, ...], wide: WideMemory | None = None) -> tuple[Search, Held]:
    """The search with the causes' columns and tangents as part of every model, and what a model then holds."""
    current = search.extended(_columns(causes, wide))
    swapped = any(c.candidate.role == "input" for c in causes)  # the replaced map stands beside the plain one
    return current, "beside" if swapped else "map and beside"


def _columns(causes: tuple[Refined, ...], wide: WideMemory | None) -> FloatArray:
    return model_columns(causes) if wide is None else np.column_stack([model_columns(causes), wide.columns])


def _by_strength(singles: list[Point], chosen: tuple[Candidate, ...]) -> list[int]:
    alone = [max((p.gain for p in singles if p.members[0].id == c.id), default=0.0) for c in chosen]
    return sorted(range(len(chosen)), key=lambda k: -alone[k])


def _p_value(found: list[Found], cause: Candidate) -> float:
    same = (f.p_value for f in found if (f.candidate.id, f.candidate.channel) == (cause.id, cause.channel))
    return min(same, default=1.0)
