"""Runs with a reversed sign, exchanged axes or another gain.

Sign and axes of whole runs are those of the checks of recordings (`orientation`, `recorded`). A run as a whole has
another gain where its mean rate over temperature is that of the other runs with a factor, where these agree with one
another, and where no memory of the temperature explains the run as well (`evidence_beside_memories`): in a unit with
hysteresis one branch is the curve of the others with a factor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.statistics import cell_means
from ..recordings.records import Curve, Dataset, Run, joined_runs
from .events import Event, events_of, evidence_beside_memories
from .facts import RunFacts, facts_of
from .orientation import orientation_findings
from .recorded import sign_findings

_Means = tuple[FloatArray, FloatArray, FloatArray]

_LEAST_OTHERS = 2  # of two runs nobody knows which one differs; the others need two others each
_BLOCK_S = 100.0  # of the means: the noise of a row is no yardstick, and a chamber's cycle is longer
_LEAST_BLOCKS = 12  # on either side, as many as places for the gain of a whole run
_LEAST_CHANGE = 0.1  # of a gain: smaller ones are what terms and temperatures of runs do to a slope
_EVIDENCE = 10.0  # twice the logarithm of the odds against a memory: very strong
_PLACE_C = 1.0  # what counts as the same temperature, as for curves of runs


def found_events(dataset: Dataset) -> list[Event]:
    """Events of the training runs, those of whole runs first; of such a run nothing else is said."""
    whole = replace(dataset, runs=joined_runs(dataset.runs))
    reversed_files = reversed_runs(dataset)
    files = {event.file for event in reversed_files}
    return [*reversed_files, *(event for event in events_of(whole, files) if event.file not in files)]


def _means(run: Run) -> _Means:
    """Time, temperature and rate of a run as means over `_BLOCK_S`."""
    rows = run.rows()
    good = run.in_span(rows.time_s) & np.isfinite(rows.rate_dph) & np.isfinite(rows.temperature_c)
    time = rows.time_s[good]
    if len(time) == 0:
        return (np.zeros(0),) * 3
    t, x, y = cell_means(_BLOCK_S, time, rows.temperature_c[good], rows.rate_dph[good])
    return t, x, y


def _usual(others: Sequence[_Means]) -> tuple[FloatArray, FloatArray]:
    """Temperatures and the mean of the other runs' rates there, each without its own mean where two of them have it."""
    curves = []
    for _, x, y in others:
        place, index = np.unique(np.round(x / _PLACE_C), return_inverse=True)
        curves.append(dict(zip(place.tolist(), np.bincount(index, y) / np.bincount(index), strict=True)))
    shared = sorted(t for t in {t for c in curves for t in c} if sum(t in c for c in curves) >= _LEAST_OTHERS)
    if not shared:
        return np.zeros(0), np.zeros(0)
    levels = [np.mean([c[t] for t in shared if t in c] or [0.0]) for c in curves]
    usual = [np.mean([c[t] - m for c, m in zip(curves, levels, strict=True) if t in c]) for t in shared]
    return _PLACE_C * np.array(shared), np.array(usual)


def another_gain_throughout(runs: Sequence[Run], number: int) -> bool:
    """Whether a factor on the other runs' curve explains a run better than that curve with any memory."""
    means = [_means(run) for run in runs]
    usual = _usual([m for k, m in enumerate(means) if k != number])
    if len(usual[0]) < _LEAST_BLOCKS:
        return True
    curve, used, side = _beside(means[number], usual)
    t, x, y = means[number]
    return evidence_beside_memories((t, x, y - curve), used, side, side[:, :0]) > _EVIDENCE


def _beside(
    own: _Means, usual: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """The others' curve at a run's temperatures, where they have one, and columns level, curve, rate."""
    t, x, _ = own
    curve = np.interp(x, *usual)
    return (
        curve,
        (x >= usual[0][0]) & (x <= usual[0][-1]),
        np.column_stack([np.ones_like(t), curve, np.gradient(x, t)]),
    )


_LEAST_PLACES = 12  # temperatures that a run shares with the others: a factor is one parameter of their curve
_CLEAR_FACTOR = 5.0  # times the largest departure from 1 of the other runs' own factors
_LEAST_SWING = 5.0  # of the curve, in terms of what the runs scatter about one another
_LEFT = 0.25  # of what the run departs by as it stands: the most that the factor may leave,
_ALIKE = (
    1.5  # unless it is no more than so many times the scatter: a run's own and that of the mean of two others
)


_UNITS = (1e3, 180.0 / np.pi, 3600.0)  # between units of a rate that are taken for one another
_OF_UNIT = (
    1.15  # ratio to such a factor: its neighbours lie 17 times away, and noise differs little between runs
)
_NOISE_ALIKE = 1.1  # ratio of the noises of the other runs, largest to smallest, for the noise to be evidence


def reversed_runs(dataset: Dataset) -> list[Event]:
    """One event at most for each training run; the whole run is left out."""
    training = [run for run in dataset.runs if run.role == "train"]
    found: dict[str, tuple[str, str, tuple[float, float, float]]] = {}
    files = [run.file for run in training]
    facts = [facts_of(run, run.rows()) for run in training]
    louder = [_noise_ratio(facts, k) for k in range(len(facts))]
    curves = [curve for curve in dataset.curves if curve.file in files]
    for file, factor, low, high in _gains(curves, dataset.axis, dict(zip(files, louder, strict=True))):
        if not another_gain_throughout(training, files.index(file)):
            continue
        text = (
            f"The rates of {file} are those of the other runs times {factor:.3g} (95 % {low:.3g} ... {high:.3g}): its "
            "scale was another one. Mend it, or take the run out of dataset.toml."
        )
        found[file] = ("gain_changed", text, (factor, low, high))
    for file, ratio in zip(files, louder, strict=True):
        unit = next((f for u in _UNITS for f in (u, 1.0 / u) if 1.0 / _OF_UNIT < ratio / f < _OF_UNIT), None)
        if unit is not None:
            text = (
                f"The noise of {file} is that of the other runs times {ratio:.3g}: its rates have another unit (a "
                f"factor of {unit:.6g}). State it, or take the run out of dataset.toml."
            )
            found[file] = ("unit_changed", text, (unit, unit, unit))
    for finding in (*sign_findings(facts), *orientation_findings(dataset)):
        file = str(finding["evidence"]["file"])
        if file in files:
            found[file] = (str(finding["id"]), str(finding["text"]), (-1.0, -1.0, -1.0))
    return [_run_event(dataset, file, *one) for file, one in found.items()]


def _noise_ratio(facts: Sequence[RunFacts], number: int) -> float:
    """Noise of a run's rows over that of the others; 1 where two others at least do not agree on theirs."""
    own = facts[number]
    others = [
        f.noise_dph
        for k, f in enumerate(facts)
        if k != number and abs(f.row_period_s / own.row_period_s - 1.0) < 0.01 and f.noise_dph > 0.0
    ]
    if len(others) < _LEAST_OTHERS or max(others) > _NOISE_ALIKE * min(others):
        return 1.0
    return own.noise_dph / float(np.median(others))


def _run_event(dataset: Dataset, file: str, id: str, text: str, factor: tuple[float, float, float]) -> Event:
    training = [run for run in dataset.runs if run.role == "train"]
    number = next(k for k, run in enumerate(training) if run.file == file)
    time = training[number].rows().time_s
    first, last = float(time[0]), float(time[-1]) + training[number].row_period_s
    return Event(id, number, file, (first, first, first), factor, "times", text, (first, last), True)


def _gains(
    curves: Sequence[Curve], axis: str | None, louder: Mapping[str, float]
) -> Iterator[tuple[str, float, float, float]]:
    """Files with another gain: factor and its 95 % limits.

    Args:
        louder: Of each file the noise over that of the others. A scale changes both: where the noise says the same
            factor, the curve need not be clear of what the other runs' own factors are.
    """
    if len(curves) <= _LEAST_OTHERS:
        return
    series = [_series(curve, axis) for curve in curves]
    for k, curve in enumerate(curves):
        own = _factor(series[k], [s for j, s in enumerate(series) if j != k])
        if own is None or abs(own[0] - 1.0) < _LEAST_CHANGE or own[0] <= 0.0:
            continue
        if (
            abs(louder[curve.file] - 1.0) > _LEAST_CHANGE
            and abs(own[0] / louder[curve.file] - 1.0) < _LEAST_CHANGE
        ):
            yield curve.file, own[0], own[0] - own[1], own[0] + own[1]
            continue
        among = []
        for i in range(len(curves)):
            if i != k:
                one = _factor(series[i], [s for j, s in enumerate(series) if j not in (i, k)])
                among += [] if one is None else [abs(one[0] - 1.0)]
        if len(among) >= _LEAST_OTHERS and abs(own[0] - 1.0) > _CLEAR_FACTOR * max(among):
            yield curve.file, own[0], own[0] - own[1], own[0] + own[1]


def _series(curve: Curve, axis: str | None) -> dict[float, float]:
    """Mean rate of the chosen axis at each temperature."""
    column = curve.axes.index(axis) if axis in curve.axes else 0
    return dict(zip(curve.temperature_c.tolist(), curve.rates_dph[:, column].tolist(), strict=True))


def _factor(own: dict[float, float], others: Sequence[dict[float, float]]) -> tuple[float, float] | None:
    """The factor on the others' mean curve that makes this one, beside a constant, and half its 95 % interval.

    None where the runs share too few temperatures, the curve hardly swings, or no factor makes it this one.
    """
    usual, scatter = _usual_curve(others)
    common = sorted(own.keys() & usual.keys())
    if len(common) < _LEAST_PLACES:
        return None
    x, y = np.array([usual[t] for t in common]), np.array([own[t] for t in common])
    x, y = x - x.mean(), y - y.mean()
    power = float(x @ x)
    if power < _LEAST_SWING**2 * len(x) * max(scatter, 1e-300) ** 2:
        return None
    factor = float(x @ y) / power
    left, stated = float(np.mean((y - factor * x) ** 2)), float(np.mean((y - x) ** 2))
    if abs(factor - 1.0) >= _LEAST_CHANGE and left > max(_LEFT**2 * stated, (_ALIKE * scatter) ** 2):
        return None
    error = float(np.sqrt(left / power * len(x) / (len(x) - 2)))
    return factor, 2.0 * error


def _usual_curve(others: Sequence[dict[float, float]]) -> tuple[dict[float, float], float]:
    """The mean curve where at least two runs have it, each without its own mean there, and their scatter."""
    shared = [t for t in {t for o in others for t in o} if sum(t in o for o in others) >= _LEAST_OTHERS]
    values = [[o[t] for o in others if t in o] for t in shared]
    if not values:
        return {}, 0.0
    scatter = float(np.sqrt(np.mean([np.var(v, ddof=1) for v in values])))
    return {t: float(np.mean(v)) for t, v in zip(shared, values, strict=True)}, scatter
