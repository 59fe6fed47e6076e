"""Runs with a reversed sign, exchanged axes or another gain, as a whole or from a time on.

Sign and axes of whole runs are those of the checks of recordings (`orientation`, `recorded`). A run as a whole has
another gain where its mean rate over temperature is that of the other runs with a factor, where these agree with one
another, and where no memory of the temperature explains the run as well (`evidence_beside_memories`): in a unit with
hysteresis one branch is the curve of the others with a factor.

For a change within a run a level, a factor on the other runs' mean curve and one on dT/dt are fitted on either side of
every time. A change is reported where the factors differ by far more than their errors, stretched by what the other
runs show among themselves, and where it explains the run better than any memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.statistics import CHI2_95_ONE, cell_means
from ..recordings.records import Curve, Dataset, Run, joined_runs
from .events import Event, events_of, evidence_beside_memories
from .facts import facts_of
from .orientation import orientation_findings
from .recorded import sign_findings

__all__ = ["another_gain_throughout", "found_events", "gain_changes", "turned_runs"]

_Means = tuple[FloatArray, FloatArray, FloatArray]

_LEAST_OTHERS = 2  # of two runs nobody knows which one differs; the others need two others each
_BLOCK_S = 100.0  # of the means: the noise of a row is no yardstick, and a chamber's cycle is longer
_LEAST_BLOCKS = 12  # on either side, as many as places for the gain of a whole run
_LEAST_CHANGE = 0.1  # of a gain: smaller ones are what terms and temperatures of runs do to a slope
_CLEAR = 2.5  # times its 95 % interval, stretched as far as the other runs' own best changes lie from 1
_SWING = (
    2.0  # of the curve on either side, in terms of what two factors leave: a factor of 1.1 is a fifth of it
)
_MOST_ALIKE = (
    0.95  # correlation of neighbours that is counted: beyond it a side has hardly two independent means
)
_EVIDENCE = 10.0  # twice the logarithm of the odds against a memory: very strong
_PLACE_C = 1.0  # what counts as the same temperature, as for curves of runs


@dataclass(frozen=True, slots=True)
class _Change:
    """The best place of a change.

    Attributes:
        factor: Gain behind over gain before; `error`: half of its 95 % interval.
        time_s: Value and limits, s.
        swings: Whether the curve shows a gain on either side.
    """

    factor: float
    error: float
    time_s: tuple[float, float, float]
    swings: bool

    def beyond(self, stretch: float) -> bool:
        """Whether it is clear when its error is so many times larger."""
        far = abs(self.factor - 1.0)
        return self.swings and far > max(_LEAST_CHANGE, _CLEAR * stretch * self.error)


def found_events(dataset: Dataset) -> list[Event]:
    """Events of the training runs, those of whole runs first; a step where a gain changes is that change."""
    whole = replace(dataset, runs=joined_runs(dataset.runs))
    turned = turned_runs(dataset)
    gains = [e for e in gain_changes(whole) if e.file not in {t.file for t in turned}]

    def of_gain(event: Event) -> bool:
        times = [gain.time_s for gain in gains if gain.file == event.file]
        return event.id in ("step", "ramp") and any(
            a <= event.time_s[2] and event.time_s[1] <= b for _, a, b in times
        )

    return [*turned, *gains, *(e for e in events_of(whole) if not of_gain(e))]


def gain_changes(dataset: Dataset) -> list[Event]:
    """At most one for each training run: the shorter side is left out."""
    runs = [run for run in dataset.runs if run.role == "train"]
    means = [_means(run) for run in runs]
    return [_event(k, runs[k], change, means[k][0]) for k, change in _clear_changes(means)]


def _clear_changes(means: Sequence[_Means]) -> Iterator[tuple[int, _Change]]:
    """Numbers of the runs whose gain changes, with the change."""
    if len(means) <= _LEAST_OTHERS + 1:
        return
    for k, own in enumerate(means):
        others = [m for j, m in enumerate(means) if j != k]
        change = _change(own, _usual(others))
        if change is None or not change.beyond(1.0):
            continue
        among = [_change(m, _usual([o for o in others if o is not m])) for m in others]
        stretch = max([1.0, *(abs(c.factor - 1.0) / c.error for c in among if c is not None)])
        if change.beyond(stretch) and _beside_memories(own, _usual(others), change.time_s[0]) > _EVIDENCE:
            yield k, replace(change, error=change.error * stretch)


def _event(number: int, run: Run, change: _Change, time_s: FloatArray) -> Event:
    first, last = float(time_s[0]), float(time_s[-1]) + _BLOCK_S
    at, low, high = change.time_s
    out = (first - 0.5 * _BLOCK_S, high) if at - first < last - at else (low, last)
    factor = (change.factor, change.factor - change.error, change.factor + change.error)
    text = (
        f"From {at:g} s on the rate of {run.file} over temperature is {change.factor:.3g} times what it was before "
        f"(95 % {factor[1]:.3g} ... {factor[2]:.3g}): its scale changed. Leave out "
        f"{out[0] / 3600.0:.2f}-{out[1] / 3600.0:.2f} h, or mend it."
    )
    return Event("gain_changed", number, run.file, change.time_s, factor, "times", text, out)


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


def _beside_memories(own: _Means, usual: tuple[FloatArray, FloatArray], at_s: float) -> float:
    """Evidence for other levels, factors and rates from a time on, against memories of the run with a slow drift."""
    curve, used, side = _beside(own, usual)
    behind = (own[0] >= at_s)[:, None]
    u = (own[0] - own[0][0]) / float(np.ptp(own[0]))
    known = np.column_stack([curve, u, u**2])
    return evidence_beside_memories(own, used, np.hstack([side * ~behind, side * behind]), known)


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


def _change(own: _Means, usual: tuple[FloatArray, FloatArray]) -> _Change | None:
    """None where the run or the curve is too short, or swings too little on one side of every time."""
    if len(usual[0]) < _LEAST_BLOCKS:
        return None
    inside = (own[1] >= usual[0][0]) & (own[1] <= usual[0][-1])
    t, x, y = (v[inside] for v in own)
    if len(t) < 2 * _LEAST_BLOCKS:
        return None
    f = np.interp(x, *usual)
    tried = list(_splits(t, f, np.gradient(x, t), y))
    if not tried:
        return None
    best = min(tried, key=lambda s: s[1])
    at, left, before, behind, swing = best
    rms = float(np.sqrt(left / len(t)))
    factor = behind[0] / before[0] if before[0] else float("inf")
    error = (
        2.0 * abs(factor) * float(np.hypot(before[1] / before[0], behind[1] / behind[0])) if factor else 0.0
    )
    likely = [s[0] for s in tried if s[1] <= left * (1.0 + CHI2_95_ONE / max(len(t) - 5, 1))]
    times = float(t[at]), float(t[max(min(likely) - 1, 0)]), float(t[min(max(likely) + 1, len(t) - 1)])
    return _Change(factor, max(error, 1e-300), times, factor > 0.0 and swing > _SWING * rms)


def _splits(
    t: FloatArray, f: FloatArray, r: FloatArray, y: FloatArray
) -> Iterator[tuple[int, float, tuple[float, ...], tuple[float, ...], float]]:
    """Every place: squares that are left, factor with its error on both sides, the smaller swing of the curve."""
    for at in range(_LEAST_BLOCKS, len(t) - _LEAST_BLOCKS + 1):
        before, behind = _line(f[:at], r[:at], y[:at]), _line(f[at:], r[at:], y[at:])
        if before is not None and behind is not None:
            swing = min(float(np.std(f[:at])), float(np.std(f[at:])))
            yield at, before[2] + behind[2], before, behind, swing


def _line(f: FloatArray, r: FloatArray, y: FloatArray) -> tuple[float, float, float] | None:
    """Factor of y on f beside a level and the temperature's rate r, its standard error, the squares that are left.

    None where f is constant. The error counts the correlation of neighbouring residuals, as of a first-order process.
    """
    f, r, y = f - f.mean(), r - r.mean(), y - y.mean()
    still = float(r @ r) <= 0.0
    f, y = (f, y) if still else (f - r * float(r @ f) / float(r @ r), y - r * float(r @ y) / float(r @ r))
    power = float(f @ f)
    if power <= 0.0 or len(f) < 4:
        return None
    factor = float(f @ y) / power
    rest = y - factor * f
    left = float(rest @ rest)
    alike = min(max(float(rest[1:] @ rest[:-1]) / max(left, 1e-300), 0.0), _MOST_ALIKE)
    error = np.sqrt(left / (len(f) - 3) / power * (1.0 + alike) / (1.0 - alike))
    return factor, float(error), left


_LEAST_PLACES = 12  # temperatures that a run shares with the others: a factor is one parameter of their curve
_CLEAR_FACTOR = 5.0  # times the largest departure from 1 of the other runs' own factors
_LEAST_SWING = 5.0  # of the curve, in terms of what the runs scatter about one another
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
    return [_run_event(dataset, file, *one) for file, one in found.items()]


def _run_event(dataset: Dataset, file: str, id: str, text: str, factor: tuple[float, float, float]) -> Event:
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
