"""The stages of `gyrotc diagnose` in order: screen, noise, compare, detect, attribute, extend, measure.

Screens come before any test for causes: outliers, variance that is not even, steps of the thermometer. Unforeseen
variance is the main source of false causes. Outliers are left out, never replaced; uneven variance becomes weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, fdtrc, pdtrc

from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from ..common.progress import Progress, silent
from ..common.statistics import TOLERANCE, main_directions, orthonormal
from ..quality.odds import FALSE_ALARMS
from .attribution import Attribution, attribute, overlap
from .blocks import Records, centred_slope
from .candidates import Candidate, columns_of, diagnosable_causes, searched
from .detection import CauseLimit, detection_limits
from .discrepancy import Ensemble, NoiseFinding, ensemble_of, noise_findings
from .joined import Channels
from .marginal_likelihood import MarginalLikelihood
from .noise import NOISE_WORDS, Colour, Declared
from .posterior import EQUIVALENT
from .profile_likelihood import Gains, Point
from .refinement import Refined
from .search import Search, open_search
from .signature_bank import build_bank
from .static_map import LEVELS, fits_exactly, led_map
from .tolerances import MAIN

_FINER_P = 1e-3  # one in a thousand campaigns gets a finer map than it needs, which costs little
_MEMORIES = ("thermal_memory", "hysteresis")  # families of causes that a lag of the sensor may be taken for


@dataclass(frozen=True)
class Analysis:
    """Everything that is known before an extension is made: beside the search's inner products, rows need not fit.

    Attributes:
        records: Training runs.
        static: Block means of the functions of the static map, shape (N, m), orthonormal.
        untestable: Why a cause cannot be tested, by id.
        attribution: What was found.
        noise: Findings of the family `noise`, from screens and from the declaration.
        limits: Detection limits by cause.
        separations: For every cause found, d from which it can be distinguished from each rival.
        ensemble: Measured against simulated residuals.
        colour, scale: The likeliest noise with the causes found taken out, and its factor.
        extended: Measured against simulated residuals when the simulation has causes and noise as found; None
            if nothing was.
    """

    records: Records
    static: FloatArray
    untestable: dict[str, str]
    attribution: Attribution
    noise: tuple[NoiseFinding, ...]
    limits: dict[str, CauseLimit]
    separations: tuple[dict[str, float], ...]
    ensemble: Ensemble
    colour: Colour
    scale: float
    extended: Ensemble | None

    def left_dph(self, *, named: bool) -> FloatArray:
        """What the map leaves, and with the causes beside it if they are `named`, deg/h, shape (N,).

        As large as the noise is of which they have taken a part. Causes without a name are no finding: another length
        of a block finds others, which take a quarter more or less.
        """
        fitted = self.extended if named and self.extended is not None else self.ensemble
        return np.asarray(fitted.residual * np.sqrt(fitted.residual.size / max(fitted.freedom, 1)))


def analyse(records: Records, declared: Declared | None, say: Progress = silent) -> Analysis:
    """Everything from rows to named causes."""
    say("screening")
    screened = screen(records)
    search = search_of(records, declared, screened, say)
    search = replace(search, cautious=bool(noise_findings(search, declared, causes=True)))
    say("searching for causes")
    attribution = attribute(search)
    say("comparing with the simulation")
    after = search.extended(attribution.columns) if attribution.causes else search
    causes = bool(attribution.causes) or attribution.detected
    noise = (*screened.findings, *noise_findings(after, declared, causes=causes))
    return Analysis(
        records=records,
        static=search.bank.map,
        untestable=search.bank.untestable,
        attribution=attribution,
        noise=noise,
        limits=detection_limits(search),
        separations=_separations(search, attribution.causes),
        ensemble=ensemble_of(search, declared),
        colour=after.likeliest.colour,
        scale=after.likeliest.scale,
        extended=_extended(after, attribution, noise, declared),
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


def _separations(search: Search, causes: Sequence[Refined]) -> tuple[dict[str, float], ...]:
    """For every cause, d from which it can be distinguished from each that imitates it."""
    if not causes:
        return ()
    gains, imitators = Gains(search), [id for id in diagnosable_causes() if searched(id).imitates]
    return tuple(overlap(gains, cause, [id for id in imitators if id != cause.candidate.id]) for cause in causes)


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
    for level in range(len(LEVELS)):
        say("computing the signatures of all causes")
        bank = build_bank(records, level, lead_s)
        if checked.sigma is not None:
            bank = bank.weighted(records, checked.sigma)
        colour = declared.colour(records.block_s) if declared else None
        search = open_search(records, bank, y, channels=channels, sigma=checked.sigma, declared=colour)
        if level + 1 == len(LEVELS) or fits_exactly(records, level + 1) or not needs_finer(search):
            break
    return search


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
    """Whether a cause is a shape of the static map, and no memory."""
    return CATALOGUE[candidate.id].family == "static_map"


_MANY = 8  # few stretches of outliers are left out in silence
_P_VARIANCE = 1e-4  # weights for even noise cost little, yet a finding is reported: rarer than the 1 % of causes
_RATIO = 1.25  # of standard deviations, above which uneven variance matters
_SIGMAS = (0.1, 10.0)  # factors of a standard deviation: beyond them the functions extrapolate
_KNOTS = 4  # hats over the temperature: the variance is a slow function of it


@dataclass(frozen=True)
class Screened:
    """What the screens found and what is done about it.

    Attributes:
        sigma: Factor of the noise of every block, median 1, shape (N,); None: even.
        findings: Causes of the family `noise` found here.
    """

    sigma: FloatArray | None
    findings: tuple[NoiseFinding, ...]


def screen(records: Records) -> Screened:
    """Runs all screens."""
    found = [rows for run in records.runs for rows in run.outliers]
    findings: list[tuple[str, float, dict[str, float]]] = []
    if len(found) >= _MANY:
        by_chance = float(pdtrc(len(found) - 1, FALSE_ALARMS * len(records.runs)))
        share = sum(found) / sum(run.read for run in records.runs)
        findings.append(("outliers", by_chance, {"count": float(sum(found)), "share": share}))
    sigma, p_variance, ratio = _variance(records)
    if sigma is not None:
        findings.append(("noise_variance", p_variance, {"ratio": ratio}))
    step = _temperature_step(records)
    if step is not None:
        findings.append(("temperature_quantisation", 0.0, {"step_c": step}))
    return Screened(sigma, tuple(NoiseFinding(id, p, values, NOISE_WORDS[id]) for id, p, values in findings))


def _variance(records: Records) -> tuple[FloatArray | None, float, float]:
    """Does the quick part of the noise depend on |dT/dt|, T or the time since power-on?

    The log of the mean squared difference of neighbouring rows in a block (of neighbouring blocks where a
    block is one row) is regressed on smooth functions of the three (Breusch and Pagan's idea, robust).

    Returns:
        Factor of every block's standard deviation or None, p-value, ratio of largest to smallest (95 % range).
    """
    value, at = _quick_power(records)
    design = _variance_design(records)
    usable_rows = value > 0.0
    logs, x = np.log(value[usable_rows]), design[at[usable_rows]]
    if logs.size < 4 * x.shape[1]:
        return None, 1.0, 1.0
    q = orthonormal((x - x.mean(axis=0))[:, 1:])
    rank = max(q.shape[1], 1)
    centred = logs - logs.mean()
    weights = q.T @ centred
    left = float(((centred - q @ weights) ** 2).sum())
    freedom = logs.size - 1 - q.shape[1]
    f = float((weights**2).sum()) / rank / (left / freedom)
    p = float(fdtrc(rank, freedom, f))
    beta, *_ = np.linalg.lstsq(x, logs, rcond=TOLERANCE)
    sigma = np.exp(np.clip(0.5 * (design @ beta - np.median(design @ beta)), *np.log(_SIGMAS)))
    low, high = np.quantile(sigma, [0.025, 0.975])
    ratio = float(high / low)
    if p > _P_VARIANCE or ratio < _RATIO:
        return None, p, ratio
    return sigma, p, ratio


def _quick_power(records: Records) -> tuple[FloatArray, NDArray[np.int64]]:
    """Mean squared difference of neighbouring usable rows of a block, and the block, where there are such rows."""
    power, index = [], []
    for k, (run, span) in enumerate(zip(records.runs, records.spans(), strict=True)):
        usable = run.usable
        pair = usable[1:] & usable[:-1]
        square = np.where(pair, np.diff(np.where(usable, run.rate_dph, 0.0)) ** 2, 0.0)
        number = records.index[k][1:]
        size = int(records.index[k][-1]) + 1
        total = np.bincount(number, weights=square, minlength=size)
        count = np.bincount(number, weights=pair, minlength=size)
        kept = records.kept[k]
        ok = count[kept] > 0
        power.append(total[kept][ok] / count[kept][ok])
        index.append(np.arange(span.start, span.stop)[ok])
    return np.concatenate(power), np.concatenate(index)


def _variance_design(records: Records) -> FloatArray:
    """Constant, |dT/dt|, its square, hats over T, and a fading with time since power-on, shape (N, k)."""
    t = records.columns(lambda h: h.temperature_c)
    r = np.abs(records.columns(centred_slope))
    r = r / max(float(r.max()), 1e-9)
    columns = [np.ones_like(t), r, r**2]
    span = float(np.ptp(t))
    if span > 2.0:
        nodes = np.linspace(t.min(), t.max(), _KNOTS)
        width = nodes[1] - nodes[0]
        columns += [np.maximum(0.0, 1.0 - np.abs(t - n) / width) for n in nodes[1:]]
    if all(run.history.on_s is not None for run in records.runs):
        on = records.average([np.asarray(run.history.on_s) for run in records.runs])
        columns.append(np.exp(-np.maximum(on, 0.0) / 1800.0))
    return np.column_stack(columns)


def _temperature_step(records: Records) -> float | None:
    """Step of the temperature record, C, where it is so coarse that the record stands still between steps."""
    steps = []
    for run in records.runs:
        t = run.history.temperature_c
        change = np.abs(np.diff(t))
        moved = change[change > 1e-9]
        if moved.size < 20:
            continue
        unit = float(np.quantile(moved, 0.02))
        even = np.abs(moved / unit - np.round(moved / unit)) < 0.02
        still = float(np.mean(change <= 1e-9))
        if unit >= 0.05 and even.mean() > 0.95 and still > 0.5:
            steps.append(unit)
    return float(np.median(steps)) if len(steps) * 2 > len(records.runs) else None
