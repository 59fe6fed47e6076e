"""Runs that are another gyro's as a whole: a reversed sign, exchanged axes, another gain; told before any cause.

Sign and axes are those of the checks of recordings (`judge.orientation`, `judge.recorded`). A gain is found where the
mean rate over temperature is that of the other runs with a factor, where these agree with one another, and where no
memory of the temperature explains the run as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..recordings.records import Curve, Dataset
from .events import Event
from .facts import facts_of
from .orientation import orientation_findings
from .recorded import sign_findings
from .turned_within import another_gain_throughout

__all__ = ["turned_runs"]


_LEAST_OTHERS = 2  # of two runs nobody knows which one differs
_LEAST_PLACES = 12  # temperatures that a run shares with the others: a factor is one parameter of their curve
_LEAST_CHANGE = 0.1  # of a gain: smaller ones are what terms and temperatures of runs do to a slope
_CLEAR = 5.0  # times the largest departure from 1 of the other runs' own factors
_SWING = 5.0  # of the curve, in terms of what the runs scatter about one another
_LEFT = 0.25  # of what the run departs by as it stands: the most that the factor may leave,
_ALIKE = (
    1.5  # unless it is no more than so many times the scatter: a run's own and that of the mean of two others
)


def turned_runs(dataset: Dataset) -> list[Event]:
    """One event at most for each training run; the whole run is left out."""
    training = [run for run in dataset.runs if run.role == "train"]
    found: dict[str, tuple[str, str, tuple[float, float, float]]] = {}
    files = {run.file for run in training}
    curves = [curve for curve in dataset.curves if curve.file in files]
    for file, factor, low, high in _gains(curves, dataset.axis):
        if not another_gain_throughout(training, [run.file for run in training].index(file)):
            continue
        text = (
            f"The rates of {file} are those of the other runs times {factor:.3g} (95 % {low:.3g} ... {high:.3g}): its "
            "scale was another one. Mend it, or take the run out of dataset.toml."
        )
        found[file] = ("gain_changed", text, (factor, low, high))
    facts = [facts_of(run, run.rows()) for run in training]
    for finding in (*sign_findings(facts), *orientation_findings(dataset)):
        file = str(finding["evidence"]["file"])
        if file in files:
            found[file] = (str(finding["id"]), str(finding["text"]), (-1.0, -1.0, -1.0))
    return [_event(dataset, file, *one) for file, one in found.items()]


def _event(dataset: Dataset, file: str, id: str, text: str, factor: tuple[float, float, float]) -> Event:
    training = [run for run in dataset.runs if run.role == "train"]
    number = next(k for k, run in enumerate(training) if run.file == file)
    time = training[number].rows().time_s
    first, last = float(time[0]), float(time[-1]) + training[number].row_period_s
    return Event(id, number, file, (first, first, first), factor, "times", text, (first, last), True)


def _gains(curves: Sequence[Curve], axis: str | None) -> Iterator[tuple[str, float, float, float]]:
    """Files with another gain: factor and its 95 % limits."""
    if len(curves) <= _LEAST_OTHERS:
        return
    series = [_series(curve, axis) for curve in curves]
    for k, curve in enumerate(curves):
        own = _factor(series[k], [s for j, s in enumerate(series) if j != k])
        if own is None or abs(own[0] - 1.0) < _LEAST_CHANGE or own[0] <= 0.0:
            continue
        among = []
        for i in range(len(curves)):
            if i != k:
                one = _factor(series[i], [s for j, s in enumerate(series) if j not in (i, k)])
                among += [] if one is None else [abs(one[0] - 1.0)]
        if len(among) >= _LEAST_OTHERS and abs(own[0] - 1.0) > _CLEAR * max(among):
            yield curve.file, own[0], own[0] - own[1], own[0] + own[1]


def _series(curve: Curve, axis: str | None) -> dict[float, float]:
    """Mean rate of the chosen axis at each temperature."""
    column = curve.axes.index(axis) if axis in curve.axes else 0
    return dict(zip(curve.temperature_c.tolist(), curve.rates_dph[:, column].tolist(), strict=True))


def _factor(own: dict[float, float], others: Sequence[dict[float, float]]) -> tuple[float, float] | None:
    """The factor on the others' mean curve that makes this one, beside a constant, and half its 95 % interval.

    None where the runs share too few temperatures, the curve hardly swings, or no factor makes it this one.
    """
    usual, scatter = _usual(others)
    common = sorted(own.keys() & usual.keys())
    if len(common) < _LEAST_PLACES:
        return None
    x, y = np.array([usual[t] for t in common]), np.array([own[t] for t in common])
    x, y = x - x.mean(), y - y.mean()
    power = float(x @ x)
    if power < _SWING**2 * len(x) * max(scatter, 1e-300) ** 2:
        return None
    factor = float(x @ y) / power
    left, stated = float(np.mean((y - factor * x) ** 2)), float(np.mean((y - x) ** 2))
    if abs(factor - 1.0) >= _LEAST_CHANGE and left > max(_LEFT**2 * stated, (_ALIKE * scatter) ** 2):
        return None
    error = float(np.sqrt(left / power * len(x) / (len(x) - 2)))
    return factor, 2.0 * error


def _usual(others: Sequence[dict[float, float]]) -> tuple[dict[float, float], float]:
    """The mean curve where at least two runs have it, each without its own mean there, and their scatter."""
    shared = [t for t in {t for o in others for t in o} if sum(t in o for o in others) >= _LEAST_OTHERS]
    values = [[o[t] for o in others if t in o] for t in shared]
    if not values:
        return {}, 0.0
    scatter = float(np.sqrt(np.mean([np.var(v, ddof=1) for v in values])))
    return {t: float(np.mean(v)) for t, v in zip(shared, values, strict=True)}, scatter
