"""Odds of explanations: of every cause in the place of a named one, of an effect without a name, and of chance.

The criterion of an explanation is twice its log-likelihood less log N for every parameter. A difference of criteria
counts less than the likelihood says (`_TEMPER`), for map, noise colour and grid are known less well than it assumes.
Odds are those of the table of prior odds times those of the criterion; `rivals` corrects them by simulation. Everything
that is decided about a cause is read from its `Posterior`: name, explanation, what is shipped, and the words.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..causes import CATALOGUE
from ..results.diagnosed import LIKELIER_THAN_ALL_ELSE, NOTHING, SURE, UNNAMED

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


@dataclass(frozen=True)
class Posterior:
    """Probabilities of everything that may stand in the place of one cause that the search chose.

    All that is decided about the cause is read here: its name, whether it is the explanation, what is shipped, and what
    is said of it.

    Attributes:
        id: The chosen cause.
        rivals: Everything else in its place: other causes, the nearest first, then something unnamed and nothing.
    """

    id: str
    rivals: tuple[Rival, ...]

    @property
    def probabilities(self) -> dict[str, float]:
        """Probability of everything in the place, by id, the chosen cause first.

        Another channel, or the cause itself at another place, is no other cause: of each id the first rival counts.
        """
        odds = {self.id: 1.0}
        for rival in self.rivals:
            if rival.id not in odds:
                odds[rival.id] = odds_of(rival)
        total = sum(odds.values())
        return {id: value / total for id, value in odds.items()}

    @property
    def probability(self) -> float:
        """Probability of the chosen cause."""
        return self.probabilities[self.id]

    @property
    def remaining(self) -> tuple[Rival, ...]:
        """What remains possible besides the chosen cause, the likeliest first; nothing where that is `SURE`.

        These are as many as it takes until they and the chosen cause together are `SURE`.
        """
        ranked = sorted(self.rivals, key=odds_of, reverse=True)
        odds = np.cumsum([1.0, *map(odds_of, ranked)])
        return tuple(ranked[: int(np.searchsorted(odds / odds[-1], SURE))])

    @property
    def is_named(self) -> bool:
        """True if the cause is likelier than something unnamed, and its family likelier than all else together."""
        share = self.probabilities
        family = CATALOGUE[self.id].family
        of_family = sum(p for id, p in share.items() if id in CATALOGUE and CATALOGUE[id].family == family)
        return share[self.id] > share.get(UNNAMED, 0.0) and of_family > LIKELIER_THAN_ALL_ELSE

    @property
    def is_chance(self) -> bool:
        """True if the hypothesis `NOTHING` is likelier than the chosen cause and than something unnamed."""
        share = self.probabilities
        return share.get(NOTHING, 0.0) > max(share[self.id], share.get(UNNAMED, 0.0))
