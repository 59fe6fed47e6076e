"""Find optional parts of named causes: overtones of a ripple, and a strength of hysteresis that depends on temperature.

They are tested with any smooth map projected out (`train.detrending`) and are kept if BIC supports them. They have no
part in naming the cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..causes.base import MOST_OVERTONES, Cause, CauseValues, History
from ..common.arrays import FloatArray
from ..common.statistics import TOLERANCE, orthonormal
from ..train.channels import MOST_TERMS
from ..train.data import MIN_HALF_RANGE_C_PER_MIN, TrainingData, cleaned_samples, scaling_of
from ..train.detrending import INDEPENDENT_S, DetrendedBins, detrend, smooth_basis
from .candidates import searched
from .played import Effect, Played, chosen_samples, sample_masks, samples_beside, terms_of

# Widths that are tried, over that of the loop of one strength: in steps of 8 %.
_WIDTH_FACTORS = np.geomspace(0.6, 1.0 / 0.6, 15)


def completed(
    runs: Sequence[Played],
    effects: Sequence[Effect],
    power_on: NDArray[np.int64],
    kept: Sequence[NDArray[np.bool_]] | None = None,
) -> list[Effect]:
    """The effects, with the strength over T of loops and the overtones of a ripple that the samples show.

    Each is found beside the other effects and the intercepts of power-ons, on the samples `kept` (default: all).

    Args:
        power_on: Number of the power-on of each run.

    Raises:
        TrainingFailed: The model of map and noise cannot be solved.
    """
    out = list(effects)
    for k, effect in enumerate(out):
        if effect.term.over_temperature is not None and len(runs) > 1:
            out[k] = _over_temperature(_Loops(runs, [e for e in out if e is not effect], power_on, kept), effect)
    for k, effect in enumerate(out):
        if effect.term.overtone is None:
            continue
        data = cleaned_samples(samples_beside(runs, [e for e in out if e is not effect], power_on, kept))
        found = overtones_of(data, effect.term, effect.values)
        room = max(MOST_TERMS - len([e for e in terms_of(out) if e.term.table is not None]), 0)
        out[k] = replace(effect, overtones=tuple(Effect(effect.id, v) for v in found[:room]))
    return out


def overtones_of(data: TrainingData, term: Cause, values: CauseValues) -> tuple[dict[str, float], ...]:
    """Parameters of each overtone that the samples ask for; none of a cause that has none.

    Args:
        data: Cleaned samples without what other causes add.
        term: The cause.
        values: Its parameters.

    Raises:
        TrainingFailed: The process, which gives the noise, cannot be solved.
    """
    bins = None if term.overtone is None else detrend(data, scaling_of(data))
    if bins is None or term.overtone is None or term.amplitudes is None:
        return ()
    able = [dict(term.overtone(values, number)) for number in range(2, MOST_OVERTONES + 2)]
    columns = [_columns(bins, term, values)]
    taken: list[dict[str, float]] = []
    for own in able:
        more = _columns(bins, term, own)
        if _energy(bins, [*columns, more]) - _energy(bins, columns) > bins.bic_penalty(more.shape[1]):
            columns.append(more)
            taken.append(own)
    weights = np.asarray(np.linalg.lstsq(np.column_stack(columns), bins.residual, rcond=TOLERANCE)[0], dtype=np.float64)
    found, at = [], columns[0].shape[1]
    for own, column in zip(taken, columns[1:], strict=True):
        found.append({**own, **term.amplitudes(weights[at : at + column.shape[1]])})
        at += column.shape[1]
    return tuple(found)


def _columns(bins: DetrendedBins, term: Cause, values: CauseValues) -> FloatArray:
    assert term.features is not None
    time_s = np.arange(bins.temperature_c.size, dtype=np.float64)
    history = History(time_s=time_s, temperature_c=bins.temperature_c)
    return bins.detrended(term.features(history, values) * bins.sqrt_weight[:, None])


def _energy(bins: DetrendedBins, columns: list[FloatArray]) -> float:
    q = np.linalg.qr(np.column_stack(columns))[0]
    return float(((q.T @ bins.residual) ** 2).sum())


class _Loops:
    """Loops beside other effects, any smooth map and any intercepts of power-ons, as means of samples over 100 s.

    Attributes:
        y: What the map leaves of the bias, shape (n,).
        middle_c: Of the range of temperature.
    """

    def __init__(
        self,
        runs: Sequence[Played],
        others: Sequence[Effect],
        power_on: NDArray[np.int64],
        kept: Sequence[NDArray[np.bool_]] | None,
    ) -> None:
        data = chosen_samples(runs, others, kept)
        self._played = [(run, run.in_force[m]) for run, m in zip(runs, sample_masks(runs, others, kept), strict=True)]
        mean = (data.time_s / INDEPENDENT_S).astype(np.int64)
        number = data.run * (1 + int(mean.max())) + mean
        _, self._index = np.unique(number, return_inverse=True)
        self._of_sample = data.weight
        weight = np.bincount(self._index, data.weight)
        self._share, self._root = 1.0 / weight, np.sqrt(weight / np.median(weight))
        t, rate = self._means(data.temperature_c), self._means(data.slope_c_per_min)
        span = (float(t.min()), float(t.max()))
        self.middle_c = 0.5 * sum(span)
        fastest = max(float(np.abs(rate).max()), MIN_HALF_RANGE_C_PER_MIN)
        of_map = smooth_basis(t, rate / fastest, span, self._root)
        of_power_on = power_on[data.run][:, None] == np.unique(power_on[data.run])
        intercepts = [self._means(own.astype(np.float64)) * self._root for own in of_power_on.T]
        self._smooth = orthonormal(of_map, *(own[:, None] for own in intercepts))
        self.y = self._rest(data.bias_dph - data.bias_dph.mean())  # see `smooth_basis`

    def columns(self, loop: Effect) -> FloatArray:
        """Return the loop less the map, and the loop times the temperature from the middle on, shape (n, 2)."""
        added = np.concatenate([run.outcome(loop).added[at] for run, at in self._played])
        away = np.concatenate([run.course.temperature[at] - self.middle_c for run, at in self._played])
        return np.column_stack([self._rest(added), self._rest(added * away)])

    def _means(self, x: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(self._index, self._of_sample * x) * self._share)

    def _rest(self, x: FloatArray) -> FloatArray:
        column = self._means(x) * self._root
        return np.asarray(column - self._smooth @ (self._smooth.T @ column))


def _over_temperature(loops: _Loops, effect: Effect) -> Effect:
    """The effect with a strength that goes with temperature, where BIC asks for that; else as it is.

    The parameter that it is searched over is found anew with it.
    """
    over, over_temperature = searched(effect.id).over, effect.term.over_temperature
    assert over is not None and over_temperature is not None
    able = [{**effect.values, over: float(value)} for value in effect.values[over] * _WIDTH_FACTORS]
    columns = [loops.columns(Effect(effect.id, dict(over_temperature(own, 1.0, 0.0, 0.0)))) for own in able]
    constant = min(_left(column[:, :1], loops.y) for column in columns)
    left = [_left(column, loops.y) for column in columns]
    best, n = int(np.argmin(left)), loops.y.size
    if n * np.log(constant / left[best]) <= np.log(n):
        return effect
    strength, growth = np.linalg.lstsq(columns[best], loops.y, rcond=TOLERANCE)[0].tolist()
    return replace(effect, values=dict(over_temperature(able[best], strength, growth, loops.middle_c)))


def _left(columns: FloatArray, y: FloatArray) -> float:
    """Sum of squares that columns leave of y."""
    return float(np.square(y - columns @ np.linalg.lstsq(columns, y, rcond=TOLERANCE)[0]).sum())
