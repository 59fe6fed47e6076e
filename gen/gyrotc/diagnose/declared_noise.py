"""Is the noise what was declared? Level, colour, and anything that only the declared noise makes visible."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtr, chdtrc

from .colours import COLOURS, Declared
from .project import project
from .scores import draw_null, score
from .search import Search
from .views import View

__all__ = ["NoiseFinding", "noise_findings"]

_LEVEL_P = 1e-3  # one in a thousand campaigns with noise as declared is told to have another level
_LEVEL_RATIO = 0.06  # a level that differs by less is as declared
_HIDDEN_P = 0.003  # a third of the 1 % of the search: level and colour are tested beside it
_SEED = 20140917  # any: it fixes the draws, so that a diagnosis repeats to the last digit


@dataclass(frozen=True)
class NoiseFinding:
    """A cause of the family `noise`: id, p-value, parameters, and what was seen."""

    id: str
    p_value: float
    parameters: dict[str, float]
    text: str


def noise_findings(search: Search, declared: Declared | None, *, causes: bool) -> list[NoiseFinding]:
    """Level and colour against the declaration; with nothing declared, white noise of the estimated level.

    Args:
        search: With every cause found taken out.
        declared: Noise as the data set declares it.
        causes: Whether causes were found; if so, what the declared noise makes visible is theirs.
    """
    colour = declared.colour(search.records.block_s) if declared else COLOURS[0]
    view = search.view_of(colour)
    freedom = search.freedom
    found: list[NoiseFinding] = []
    best = search.likeliest
    if declared is not None:
        ratio = view.scale
        p = _two_sided(ratio**2 * freedom, freedom)
        if p < _LEVEL_P and abs(np.log(ratio)) > _LEVEL_RATIO:
            text = f"the noise is {ratio:.2f} times the declared level"
            found.append(NoiseFinding("noise_level", p, {"ratio": ratio}, text))
    if search.contradicts(view):
        p = float(chdtrc(2, 2.0 * (best.log_likelihood - view.log_likelihood)))
        found.append(
            NoiseFinding("noise_colour", p, _described(search), "noise of another colour than declared")
        )
    if not found and declared is not None and not causes:
        found += _hidden(search, view)
    return found


def _two_sided(energy: float, freedom: int) -> float:
    return float(min(1.0, 2.0 * min(chdtrc(freedom, energy), chdtr(freedom, energy))))


def _described(search: Search) -> dict[str, float]:
    """The likeliest colour: share of the variance of block means that is not white, and its correlation time."""
    colour = search.likeliest.colour
    return {
        "slow_dph": float(search.likeliest.scale * np.sqrt(colour.slow + colour.walk)),
        "tau_s": float(colour.tau_s),
    }


def _hidden(search: Search, view: View) -> list[NoiseFinding]:
    """Structure that stands out of the declared noise but not of the noise that the data may have."""
    projection = project(search, replace(view, scale=1.0), "map and beside")
    columns = search.joined.columns
    own = float(score(projection, columns, projection.a).joined().max())
    null = np.sort(draw_null(projection, columns, _SEED))
    p = (null.size - np.searchsorted(null, own) + 1.0) / (null.size + 1.0)
    if p > _HIDDEN_P:
        return []
    text = "slow changes that the declared noise does not explain and no cause repeats"
    return [NoiseFinding("noise_colour", float(p), _described(search), text)]
