"""The stages of `gyrotc diagnose` in order: screen, noise, compare, detect, attribute, extend, measure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from ..causes import CATALOGUE
from ..common.arrays import Progress
from ..common.statistics import main_directions, orthonormal
from .attribution import Attribution, attribute, overlap
from .blocks import Records
from .candidates import Candidate, columns_of, diagnosed, searched
from .detection import CauseLimit, detection_limits
from .discrepancy import Ensemble, NoiseFinding, ensemble_of, noise_findings
from .gains import Gains
from .joined import Channels
from .noise import NOISE_WORDS, Declared
from .screens import Screened, cleaned, screen
from .search import Search, open_search
from .signature_bank import bank_of

_FINER_P = 1e-3  # one in a thousand campaigns gets a finer map than it needs, which costs little
_MAIN = (
    0.05  # share of the strongest direction (of a function) below which memories (the finer map) say nothing
)
_STILL = 1e-9  # change of a channel, of its size, that is rounding
_HIGHEST_LEVEL = 1  # finer maps than this are named, not taken in silence


@dataclass(frozen=True)
class Analysis:
    """Everything that is known before an extension is made.

    Attributes:
        records: Training runs.
        screened: What the screens found.
        search: The search of the data, before any cause.
        attribution: What was found.
        noise: Findings of the family `noise`, from screens and from the declaration.
        limits: Detection limits by cause.
        separations: For every cause found, d from which it can be distinguished from each rival.
        ensemble: Measured against simulated residuals.
        after: The search with the causes found taken out.
        extended: Measured against simulated residuals when the simulation has causes and noise as found; None
            if nothing was.
    """

    records: Records
    screened: Screened
    search: Search
    attribution: Attribution
    noise: tuple[NoiseFinding, ...]
    limits: dict[str, CauseLimit]
    separations: tuple[dict[str, float], ...]
    ensemble: Ensemble
    after: Search
    extended: Ensemble | None


def analyse(records: Records, declared: Declared | None, say: Progress = lambda _: None) -> Analysis:
    """Everything from rows to named causes."""
    say("screening")
    screened = screen(records)
    search = search_of(records, declared, screened, say)
    search = replace(search, cautious=bool(noise_findings(search, declared, causes=True)))
    say("searching for causes")
    attribution = attribute(search)
    say("comparing with the simulation")
    after = _after(search, attribution)
    noise = [
        NoiseFinding(name, p, values, NOISE_WORDS[name]) for name, p, values in screened.findings
    ] + noise_findings(after, declared, causes=bool(attribution.causes) or attribution.detected)
    gains = Gains(search) if attribution.causes else None
    separations = tuple(
        overlap(gains, cause, _imitators(cause.candidate.id)) if gains is not None else {}
        for cause in attribution.causes
    )
    return Analysis(
        records,
        screened,
        search,
        attribution,
        tuple(noise),
        detection_limits(search),
        separations,
        ensemble_of(search, declared),
        after,
        _extended(after, attribution, noise, declared),
    )


def _extended(
    after: Search, attribution: Attribution, noise: Sequence[NoiseFinding], declared: Declared | None
) -> Ensemble | None:
    """Measured against simulated residuals when the simulation has what was found."""
    refuted = any(n.id in ("noise_level", "noise_colour") for n in noise)
    if not attribution.causes and not refuted:
        return None
    beside = attribution.columns if attribution.causes else None
    return ensemble_of(after, declared, beside=beside, estimated=refuted)


def _imitators(cause: str) -> list[str]:
    return [id for id in diagnosed() if searched(id).imitates and id != cause]


def search_of(
    records: Records,
    declared: Declared | None = None,
    screened: Screened | None = None,
    say: Progress = lambda _: None,
) -> Search:
    """The search with the coarsest map that the data do not reject."""
    checked = screen(records) if screened is None else screened
    y, empty = cleaned(records, checked)
    left_out = np.eye(records.size)[:, empty] if empty.size else None
    channels = _channels(records)
    for level in range(_HIGHEST_LEVEL + 1):
        bank = bank_of(records, level, say)
        if checked.sigma is not None:
            bank = bank.weighted(records, checked.sigma)
        colour = declared.colour(records.block_s) if declared else None
        search = open_search(
            records, bank, y, channels=channels, beside=left_out, sigma=checked.sigma, declared=colour
        )
        if level == _HIGHEST_LEVEL or not needs_finer(search):
            break
    return search


def _channels(records: Records) -> Channels | None:
    """Columns of the auxiliary channels that vary."""
    names = sorted(set.intersection(*(set(r.channels) for r in records.runs)))
    columns, candidates = [], []
    for name in names:
        column = records.average([r.channels[name] for r in records.runs])
        if np.ptp(column) > _STILL * (1.0 + np.abs(column).max()):
            for cause in (id for id, term in diagnosed().items() if term.needs.channel):
                columns.append(column - column.mean())
                candidates.append(Candidate(cause, {}, "columns", name))
    return (np.column_stack(columns), candidates) if columns else None


def needs_finer(search: Search) -> bool:
    """Whether the next finer map explains what neither this one nor any memory does."""
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
    held = orthonormal(gains.map_q, main_directions(memory, _MAIN))
    rest = finer - held @ (held.T @ finer)
    q, r = np.linalg.qr(rest)
    own = np.abs(np.diag(r)) > _MAIN * np.linalg.norm(finer, axis=0)
    if not own.any():
        return False
    y = gains.whiten(search.y) / gains.scale
    energy = float(((q[:, own].T @ (y - held @ (held.T @ y))) ** 2).sum())
    return float(chdtrc(int(own.sum()), energy)) < _FINER_P


def _of_map(candidate: Candidate) -> bool:
    """Whether a cause is a shape of the static map, and no memory."""
    return CATALOGUE[candidate.id].family == "static_map"


def _after(search: Search, attribution: Attribution) -> Search:
    """The search with the causes found taken out."""
    return search.extended(attribution.columns) if attribution.causes else search
