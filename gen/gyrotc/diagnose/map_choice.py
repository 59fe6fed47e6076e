"""Choose the static map of a search: the coarsest that the data do not reject, ahead of a sensor that lags."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc

from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from ..common.progress import Progress, silent
from ..common.statistics import TOLERANCE, main_directions, orthonormal
from .blocks import Records
from .candidates import Candidate, columns_of, diagnosable_causes
from .joined import Channels
from .marginal_likelihood import MarginalLikelihood
from .noise import Declared
from .posterior import EQUIVALENT
from .profile_likelihood import Gains, Point
from .screens import Screened, screen
from .search import Search, open_search
from .signature_bank import build_bank
from .static_map import LEVELS, fits_exactly, led_map
from .tolerances import MAIN

_FINER_P = 1e-3  # one in a thousand campaigns gets a finer map than it needs, which costs little
_MEMORIES = ("thermal_memory", "hysteresis")  # families of causes that a lag of the sensor may be taken for
# Leads of the static map that are tried, s: in steps that a map hardly tells apart, as long as sensors lag.
_LEADS_S = (60.0, 100.0, 160.0, 230.0, 300.0, 380.0, 480.0, 600.0, 800.0, 1000.0)


def search_of(
    records: Records,
    declared: Declared | None = None,
    screened: Screened | None = None,
    say: Progress = silent,
) -> Search:
    """The search with the coarsest map that the data do not reject, of the temperature ahead of a sensor that lags."""
    checked = screen(records) if screened is None else screened
    search = _with_map(records, declared, checked, say, lead_s=0.0)
    lead_s = needed_lead_s(search)
    return _with_map(records, declared, checked, say, lead_s=lead_s) if lead_s else search


def _with_map(
    records: Records, declared: Declared | None, checked: Screened, say: Progress, *, lead_s: float
) -> Search:
    y = records.target()
    channels = _channels(records)
    colour = declared.colour(records.block_s) if declared else None
    for level in range(len(LEVELS)):
        say("computing the signatures of all causes")
        bank = build_bank(records, level, lead_s, checked.sigma)
        search = open_search(records, bank, y, channels=channels, sigma=checked.sigma, declared=colour)
        if level + 1 == len(LEVELS) or fits_exactly(records, level + 1) or not needs_finer(search):
            break
    return search


def _channels(records: Records) -> Channels | None:
    """Columns of the auxiliary channels that vary."""
    names = sorted(set.intersection(*(set(r.channels) for r in records.runs)))
    columns, candidates = [], []
    for name in names:
        column = records.average([r.channels[name] for r in records.runs])
        if np.ptp(column) > TOLERANCE * (1.0 + np.abs(column).max()):
            for cause in (id for id, term in diagnosable_causes().items() if term.needs.channel):
                columns.append(column - column.mean())
                candidates.append(Candidate(cause, {}, "columns", name))
    return (np.column_stack(columns), candidates) if columns else None


def needed_lead_s(search: Search) -> float:
    """Return by how much the map has to be ahead of the sensor; 0 where it need not be.

    A sensor that lags by tau makes of f(T) the function f(T_s + tau dT_s/dt), which is static, but far from what few
    Gaussians of T_s and dT_s/dt can be where ramps are quick. A map of T_s + tau dT_s/dt is taken where it is better
    than the plain one and no memory of the temperature is clearly better, a record that is late among them: every
    sensor lags, and then nothing is to be named.
    """
    gains = Gains(search)
    maps = {lead_s: gains.whiten(led_map(search.records, search.bank.basis, lead_s)) for lead_s in _LEADS_S}
    rest = {lead_s: _rest(gains, led) for lead_s, led in maps.items()}
    best = min(_LEADS_S, key=lambda lead_s: rest[lead_s])
    if _rest(gains, gains.map) - rest[best] < EQUIVALENT:
        return 0.0
    memories: dict[str, Point] = {}
    for point in gains.single():
        id = point.members[0].id
        if CATALOGUE[id].family in _MEMORIES and (id not in memories or point.gain > memories[id].gain):
            memories[id] = point
    over_plain, over_memories = MarginalLikelihood(gains).static_leads([*memories.values()], maps[best])
    return best if over_plain >= EQUIVALENT and over_memories >= -EQUIVALENT else 0.0


def _rest(gains: Gains, functions: FloatArray) -> float:
    """Energy that a static map leaves, over the noise."""
    held = orthonormal(gains.beside, functions)
    return float(((gains.target - held @ (held.T @ gains.target)) ** 2).sum())


def needs_finer(search: Search) -> bool:
    """Test whether the next finer map explains what neither this one nor any memory does."""
    gains = Gains(search)
    finer = gains.whiten(search.bank.finer)
    added = [p for p in gains.added() if p.members[0].role == "columns"]
    of_map = [p for p in added if _of_map(p.members[0])]
    waves = []
    if of_map:
        best = max(of_map, key=lambda p: p.gain).members[0]
        waves.append(gains.whiten(columns_of(search.records, best.id, best.values)))
    memory = np.column_stack(
        [gains.plain_columns(s) for c, s in gains.plain if not _of_map(c)]
        + [gains.plain_columns(s) for c, s in gains.random if not _of_map(c)]
        + waves
    )
    held = orthonormal(gains.map_q, main_directions(memory, MAIN))
    rest = finer - held @ (held.T @ finer)
    q, r = np.linalg.qr(rest)
    own = np.abs(np.diag(r)) > MAIN * np.linalg.norm(finer, axis=0)
    if not own.any():
        return False
    y = gains.whiten(search.y) / gains.scale
    energy = float(((q[:, own].T @ (y - held @ (held.T @ y))) ** 2).sum())
    return float(chdtrc(int(own.sum()), energy)) < _FINER_P


def _of_map(candidate: Candidate) -> bool:
    """Test whether a cause is a shape of the static map, and no memory."""
    return CATALOGUE[candidate.id].family == "static_map"
