"""Measured residuals and noise, compared with what the simulation and the declaration say.

The plain simulation is the static map fitted to the runs plus the declared noise (white noise of the
estimated level where nothing is declared), on the recorded temperatures. Measured and simulated rates go
through the same fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import chdtr, chdtrc

from ..common.arrays import BoolArray, FloatArray
from ..common.metrics import HALF_HOUR_S
from ..common.statistics import TOLERANCE, orthonormal
from ..results.diagnosed import ComparedStatistic
from .blocks import Records, centred_slope
from .detection import project
from .noise import NOISE_COLOURS, Declared, Whitener
from .scores import p_values, score
from .search import Search, View

_LEVEL_P = 1e-3  # one in a thousand campaigns with noise as declared is reported to have another level
_LEVEL_RATIO = 0.06  # a level that differs by less is as declared
_HIDDEN_P = 0.003  # a third of the 1 % of the search: level and colour are tested beside it
_SEED = 1  # any: it fixes the draws, so that a diagnosis repeats to the last digit


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
    colour = declared.colour(search.records.block_s) if declared else NOISE_COLOURS[0]
    view = search.view_of(colour)
    freedom = search.freedom
    found: list[NoiseFinding] = []
    best = search.likeliest
    if declared is not None:
        ratio = view.scale
        p = p_value_of_energy(ratio**2 * freedom, freedom)
        if p < _LEVEL_P and abs(np.log(ratio)) > _LEVEL_RATIO:
            text = f"the noise is {ratio:.2f} times the declared level"
            found.append(NoiseFinding("noise_level", p, {"ratio": ratio}, text))
    if search.contradicts(view):
        p = float(chdtrc(2, 2.0 * (best.log_likelihood - view.log_likelihood)))
        found.append(NoiseFinding("noise_colour", p, _described(search), "noise of another colour than declared"))
    if not found and declared is not None and not causes:
        found += _hidden(search, view)
    return found


def p_value_of_energy(energy: float, freedom: int) -> float:
    """Return the two-sided p-value of a sum of squares of as many standard normal numbers."""
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
    p = p_values(score(projection, columns, projection.a).joined().max(), projection, columns, _SEED)
    if p > _HIDDEN_P:
        return []
    text = "slow changes that the declared noise does not explain and no cause repeats"
    return [NoiseFinding("noise_colour", float(p), _described(search), text)]


OfResiduals = Callable[[FloatArray], FloatArray]

_MEMBERS = 499  # p-values in steps of 0.004: a rank of the measured campaign among 500
_MOVING = 0.1  # C/min, above which a block counts as heating or cooling
_CELL_C = 8.0  # C: a dozen cells over the range of a product
_FEWEST = 3  # blocks of either direction in a cell, for a mean
_DATES = 3  # days: two give a line in any case


@dataclass(frozen=True)
class Ensemble:
    """Residuals of the measured and of the simulated campaigns.

    Attributes:
        residual: Measured rate less the map, deg/h, shape (N,).
        freedom: Its degrees of freedom.
        simulated: The same of every simulated campaign, shape (N, members).
        discrepancies: All statistics, rarest first.
    """

    residual: FloatArray
    freedom: int
    simulated: FloatArray
    discrepancies: tuple[ComparedStatistic, ...]


def ensemble_of(
    search: Search,
    declared: Declared | None,
    *,
    beside: FloatArray | None = None,
    estimated: bool = False,
) -> Ensemble:
    """Draw the ensemble and compare.

    Args:
        search: The data.
        declared: Noise of the plain simulation; None: white, of the estimated level.
        beside: Columns that the extended simulation has beside the map, shape (N, k).
        estimated: Whether the simulated noise is that which the search estimates (the declared one is refuted).
    """
    records = search.records
    if estimated:
        colour, scale = search.likeliest.colour, search.likeliest.scale
    elif declared is not None:
        colour, scale = declared.colour(records.block_s), 1.0
    else:
        colour, scale = NOISE_COLOURS[0], search.view_of(NOISE_COLOURS[0]).scale
    whiten = Whitener(colour, records.kept, records.block_s, search.sigma)
    normal = np.random.default_rng(_SEED).standard_normal((records.size, _MEMBERS))
    noise = scale * whiten.colour(normal)
    both = np.column_stack([search.y, noise])
    model = orthonormal(search.bank.map, search.joined.beside, *([] if beside is None else [beside]))
    both -= model @ (model.T @ both)
    measured, simulated = both[:, 0], both[:, 1:]
    rounding = TOLERANCE * float(np.sqrt((both**2).mean()))
    found = []
    for name, statistic in _statistics(search).items():
        values = statistic(both)
        if np.all(np.isfinite(values)):
            found.append(compared_statistic(name, float(values[0]), values[1:], rounding))
    found.sort(key=lambda d: d.p_value)
    return Ensemble(measured, records.size - model.shape[1], simulated[:, :100], tuple(found))


def compared_statistic(name: str, measured: float, simulated: FloatArray, rounding: float) -> ComparedStatistic:
    """The rank of the measured value; where the model takes a statistic away wholly, none is rare."""
    n = simulated.size
    above = float(np.count_nonzero(simulated >= measured))
    below = float(np.count_nonzero(simulated <= measured))
    p = min(1.0, 2.0 * (min(above, below) + 1.0) / (n + 1.0))
    if max(abs(measured), float(np.abs(simulated).max())) <= rounding:
        p = 1.0
    low, high = np.quantile(simulated, [0.025, 0.975])
    return ComparedStatistic(
        statistic=name,
        measured=measured,
        simulated_mean=float(simulated.mean()),
        simulated_low=float(low),
        simulated_high=float(high),
        p_value=p,
    )


def _statistics(search: Search) -> dict[str, OfResiduals]:
    """Statistics of residuals, shape (N, members), by name: each gives one number for each member."""
    records = search.records
    spans = records.spans()
    slow = max(round(HALF_HOUR_S / records.block_s), 2)
    found: dict[str, OfResiduals] = {
        "residual_rms_dph": _rms,
        "residual_autocorrelation": partial(_autocorrelation, spans=spans),
        "half_hour_means_rms_dph": partial(_rms_of_means, spans=spans, width=slow),
        "run_means_rms_dph": partial(_rms_of_runs, spans=spans),
        "heating_cooling_loop_dph": partial(_loop, branches=_branches(records)),
        "first_half_hour_dph": partial(_first_mean, spans=spans, width=slow),
        "kurtosis": _kurtosis,
    }
    days = [r.history.day for r in records.runs]
    known = np.array([float(d) for d in days if d is not None])
    if len(known) == len(days) and len(set(known.tolist())) >= _DATES:
        date = (known - known.mean()) / known.std()
        found["trend_with_date_dph"] = partial(_trend, spans=spans, date=date)
    return found


def _rms(e: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt((e**2).mean(axis=0)))


def _unknown(e: FloatArray) -> FloatArray:
    """A statistic that these runs do not have."""
    return np.full(e.shape[1], np.nan)


def _autocorrelation(e: FloatArray, spans: Sequence[slice]) -> FloatArray:
    """Return the correlation of neighbouring blocks."""
    top = sum((e[s][1:] * e[s][:-1]).sum(axis=0) for s in spans)
    return np.asarray(top / (e**2).sum(axis=0))


def _rms_of_means(e: FloatArray, spans: Sequence[slice], width: int) -> FloatArray:
    """RMS of means over `width` blocks."""
    parts = [_grouped(e[s], width) for s in spans if s.stop - s.start >= width]
    return _rms(np.concatenate(parts)) if parts else _unknown(e)


def _rms_of_runs(e: FloatArray, spans: Sequence[slice]) -> FloatArray:
    """RMS of the means of runs."""
    return _rms(np.array([e[s].mean(axis=0) for s in spans])) if len(spans) > 1 else _unknown(e)


def _loop(e: FloatArray, branches: Sequence[tuple[BoolArray, BoolArray]]) -> FloatArray:
    """RMS over temperature of the mean difference between heating and cooling."""
    gaps = [e[up].mean(axis=0) - e[down].mean(axis=0) for up, down in branches]
    return _rms(np.array(gaps)) if gaps else _unknown(e)


def _branches(records: Records) -> list[tuple[BoolArray, BoolArray]]:
    """Blocks that heat and that cool, shape (N,) each, for every cell of temperature that has enough of both."""
    slope = records.columns(centred_slope)
    temperature = records.columns(lambda h: h.temperature_c)
    cells = np.floor(temperature / _CELL_C).astype(np.int64)
    pairs = [((slope > _MOVING) & (cells == c), (slope < -_MOVING) & (cells == c)) for c in np.unique(cells)]
    return [(up, down) for up, down in pairs if min(up.sum(), down.sum()) >= _FEWEST]


def _first_mean(e: FloatArray, spans: Sequence[slice], width: int) -> FloatArray:
    """Mean over the runs of the mean of their first `width` blocks."""
    return np.asarray(np.mean([e[s][:width].mean(axis=0) for s in spans], axis=0))


def _kurtosis(e: FloatArray) -> FloatArray:
    """Fourth moment over the square of the second, about 0."""
    square = e * e
    return np.asarray((square * square).mean(axis=0) / square.mean(axis=0) ** 2)


def _trend(e: FloatArray, spans: Sequence[slice], date: FloatArray) -> FloatArray:
    """Slope of the means of runs in standardised dates."""
    return np.asarray(np.mean([x * e[s].mean(axis=0) for x, s in zip(date, spans, strict=True)], axis=0))


def _grouped(e: FloatArray, width: int) -> FloatArray:
    n = e.shape[0] // width
    return np.asarray(e[: n * width].reshape(n, width, -1).mean(axis=1))
