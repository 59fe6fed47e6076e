"""Return what the pictures of a diagnosis show (`series.json`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from ..common.metrics import HALF_HOUR_S, Averages
from ..common.statistics import running_mean
from ..results.diagnosed import (
    DiagnosisSeries,
    ParameterLikelihood,
    RunSeries,
    ScoredRun,
    SearchScores,
    SeriesValues,
)
from .attribution import LEVEL, Attribution
from .blocks import Records, centred_slope
from .candidates import diagnosable_causes
from .detection import Found
from .diagnosis import Diagnosis
from .refinement import Refined

__all__ = ["series_of"]

_TYPICAL_LIMIT = 10.0  # -ln p of 1 % for the whole search where nothing reaches it
_SHOWN = -40.0  # of 2 log likelihood below its top: ten times the fall at 95 %, more would flatten it
_FAR_BELOW = -1e6  # of a parameter that cannot be; JSON has no infinity


def series_of(found: Diagnosis) -> DiagnosisSeries | None:
    """Return the data of the pictures of a diagnosis, in six digits; None if nothing could be decided."""
    analysis, extension = found.analysis, found.extension
    if analysis is None or extension is None:
        return None
    causes = analysis.attribution.causes[: len(found.result.physical)]
    records = analysis.records
    if found.cycle is not None:
        residual = found.cycle.residual
        named = found.cycle.explained if found.cycle.chosen is not None else None
        low = high = np.zeros(0)
    else:
        residual = analysis.ensemble.residual
        named = _beyond_the_map(analysis.static, causes) if causes else None
        low, high = _band(records, analysis.ensemble.simulated)
    scored = zip(extension.before, extension.after, strict=True) if any(extension.steps) else ()
    return DiagnosisSeries(
        gyrotc_version=__version__,
        block_s=records.block_s,
        average_s=found.result.average_s,
        runs=tuple(_run(records, number, residual, low, high, named) for number in range(len(records.runs))),
        scored=tuple(_scored(before, after) for before, after in scored if before.time_s.size),
        likelihoods=tuple(_likelihood(cause) for cause in causes),
        scores=_scores(analysis.attribution, named=bool(causes)),
    )


def _values(numbers: NDArray[np.floating[Any]]) -> SeriesValues:
    return tuple(float(f"{x:.6g}") for x in numbers.tolist())


def _run(
    records: Records,
    number: int,
    residual: FloatArray,
    low: FloatArray,
    high: FloatArray,
    named: FloatArray | None,
) -> RunSeries:
    run = records.runs[number]
    span, history = records.spans()[number], run.history

    def mean(rows: FloatArray) -> SeriesValues:
        return _values(records.average_run(number, rows))

    return RunSeries(
        name=run.name,
        file=run.file,
        environment=run.environment,
        first_s=float(history.time_s[0]),
        hours=_values((records.kept[number] + 0.5) * records.block_s / 3600.0),
        temperature_c=mean(history.temperature_c),
        slope_c_per_min=mean(centred_slope(history)),
        rate_dph=mean(run.rate_dph),
        residual_dph=_values(residual[span]),
        simulated_low_dph=_values(low[span]),
        simulated_high_dph=_values(high[span]),
        named_dph=None if named is None else _values(named[span]),
        on_h=None if history.on_s is None else mean(np.asarray(history.on_s) / 3600.0),
        day=history.day,
    )


def _band(records: Records, simulated: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Middle 95 % of half-hour means of simulated residuals, shape (N, members), at every block, shapes (N,)."""
    width = max(round(HALF_HOUR_S / records.block_s), 1)
    ends = [np.quantile(running_mean(simulated[s], width), [0.025, 0.975], axis=1) for s in records.spans()]
    low, high = np.concatenate(ends, axis=1)
    return low, high


def _beyond_the_map(static: FloatArray, causes: Sequence[Refined]) -> FloatArray:
    """Return the part of the causes that no map holds, as the map's residual shows it, deg/h, shape (N,)."""
    total = np.sum([c.contribution for c in causes], axis=0)
    return np.asarray(total - static @ (static.T @ total))


def _scored(before: Averages, after: Averages) -> ScoredRun:
    hours = (before.time_s - before.time_s[0]) / 3600.0
    return ScoredRun(hours=_values(hours), before_dph=_values(before.after_dph), after_dph=_values(after.after_dph))


def _likelihood(cause: Refined) -> ParameterLikelihood | None:
    """The profile near its top, with one point beyond to either side."""
    if cause.profile is None:
        return None
    x, gain = cause.profile
    near = np.flatnonzero(gain - gain.max() >= _SHOWN)
    some = slice(max(int(near[0]) - 1, 0), int(near[-1]) + 2)
    name = next(n for n in cause.parameters if n in cause.candidate.values)
    interval = cause.parameters[name]
    return ParameterLikelihood(
        cause=CATALOGUE[cause.candidate.id].words.name,
        parameter=name,
        values=_values(x[some]),
        gain=_values(np.maximum(gain[some] - gain.max(), _FAR_BELOW)),
        low=interval.low,
        high=interval.high,
    )


def _scores(attribution: Attribution, *, named: bool) -> SearchScores:
    significant = [f.log_p for f in attribution.first if f.p_value <= LEVEL]
    missed = [f.log_p for f in attribution.first if f.p_value > LEVEL]
    limit = 0.5 * (min(significant) + max(missed)) if significant and missed else _TYPICAL_LIMIT
    return SearchScores(
        alone=_best_scores(attribution.first),
        beside=_best_scores(attribution.last) if named else None,
        limit=float(limit),
    )


def _best_scores(found: Sequence[Found]) -> dict[str, float]:
    """Largest -ln p of each cause, in the order of the catalogue."""
    out: dict[str, float] = {}
    for f in found:
        if np.isfinite(f.log_p):
            out[f.candidate.id] = max(out.get(f.candidate.id, 0.0), float(f"{f.log_p:.6g}"))
    return {id: out[id] for id in diagnosable_causes() if id in out}
