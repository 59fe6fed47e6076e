"""Odds of explanations: of every cause in the place of a named one, of an effect without a name, and of chance.

The criterion of an explanation is twice its log-likelihood less log N for every parameter. A difference of criteria
counts less than the likelihood says (`_TEMPER`), for map, noise colour and grid are known less well than it assumes.
Odds are those of the table of prior odds times those of the criterion; `rivals` corrects them by simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..results.diagnosed import NOTHING, SURE, UNNAMED

PRIOR_ODDS = {UNNAMED: 3.0, NOTHING: 3.0}
"""Odds before the recordings speak, against one cause of the catalogue, which has 1: an effect that is in no catalogue
and plain chance are each more common than any one cause. An entry of its own changes no other one."""

EQUIVALENT = 8.0
"""Difference of the criterion at which a rival of equal prior odds leaves the better explanation `SURE`."""

_TEMPER = 2.0 * float(np.log(SURE / (1.0 - SURE))) / EQUIVALENT

LOOKED_AT = 3.0 * EQUIVALENT
"""Farther behind, a rival has odds below 1 in 700."""

_SURELY = 300.0  # logarithm of odds beyond which more is no surer


@dataclass(frozen=True)
class Rival:
    """An alternative to a named cause: another cause, another channel, `UNNAMED` or `NOTHING`.

    Attributes:
        id: Cause, `UNNAMED` or `NOTHING`.
        distance: How far its criterion is behind, 0 is equal.
        channel: Of a cause that reads one.
        odds: Against the named cause, where simulation has given them; None: those of prior and distance.
    """

    id: str
    distance: float
    channel: str | None = None
    odds: float | None = None


def odds_of(rival: Rival) -> float:
    """Return the odds of a rival against the named cause."""
    if rival.odds is not None:
        return rival.odds
    return PRIOR_ODDS.get(rival.id, 1.0) * float(np.exp(min(-0.5 * _TEMPER * rival.distance, _SURELY)))


def probabilities_of(named: str, rivals: Sequence[Rival]) -> dict[str, float]:
    """Return the probability of everything in one place, by id, the named cause first.

    Another channel, or the named cause at another place, is no other cause: of each id the first rival counts.
    """
    odds = {named: 1.0}
    for rival in rivals:
        if rival.id not in odds:
            odds[rival.id] = odds_of(rival)
    total = sum(odds.values())
    return {id: value / total for id, value in odds.items()}


def remaining(rivals: Sequence[Rival]) -> tuple[Rival, ...]:
    """Return what remains possible besides the named cause, the likeliest first; nothing where that is `SURE`.

    These are as many as it takes until they and the named cause together are `SURE`.
    """
    ranked = sorted(rivals, key=odds_of, reverse=True)
    odds = np.cumsum([1.0, *map(odds_of, ranked)])
    return tuple(ranked[: int(np.searchsorted(odds / odds[-1], SURE))])
