"""Thermometers that were stuck, and further ones that are not in a run what they are in the others.

In every run a thermometer follows the gyro's own: u − T = offset + share (T − mean) − lag dT/dt. What the other runs
agree on is held against the run.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..common.arrays import FloatArray
from ..recordings.records import Dataset, Rows, Run
from ..recordings.units import channel_kind

_LEAST_RUNS = 3  # of two runs nobody knows which one is odd
_CELL_S = 60.0  # of a mean: below it the lags of thermometers themselves show
_SETTLED_S = 3600.0  # self-heating has set in by then; a third of a shorter run
_LEAST_CELLS = 20  # for three numbers
_LEAST_RANGE_C = 5.0  # over less neither share nor lag of a run is known
_SIGMAS = 5.0  # of what the other runs differ by among themselves
_LEAST_C = 0.3  # class B thermometers may differ by so much (IEC 60751)
_LEAST_S = 60.0  # a cell


_STUCK_S = 60.0  # a thermometer that stands still for longer; readings come faster
_STUCK_ROWS = 10  # where half of the rows differ from the one before, as many alike come once in a thousand
_OFTEN = 0.5  # of the rows differ from the one before: else repeating is what the thermometer does
_LONGER = 4.0  # than what else repeats in the run; holds of one programme, in which a converter waits, differ by less
_MOST = 5  # stuck stretches of a run at most; a thermometer with more repeats often by nature
_ONE_STEP = 1.5  # steps of the converter: a temperature that is held between two of them goes on by one
_RELEASE = 3.0  # times the steps that rows make on ramps: the temperature went on meanwhile
_ON_RAMPS = 0.95  # quantile of the steps


def stuck_stretches(time: FloatArray, temperature: FloatArray, period_s: float) -> list[tuple[int, int]]:
    """First row and number of rows of the stretches in which a thermometer was stuck.

    A coarse converter, or a logger that averages one, repeats a reading for as long as a chamber holds. So a stretch
    counts only where it is far longer than all others of a run that seldom repeats and ends with more than one step of
    the converter, or where it ends with a step that no ramp of the run makes from row to row.
    """
    starts = np.flatnonzero(np.r_[True, temperature[1:] != temperature[:-1]])
    lengths = np.diff(np.r_[starts, len(temperature)])
    long = np.flatnonzero((lengths >= _STUCK_ROWS) & (lengths * period_s > _STUCK_S))
    if len(starts) < 2 or len(long) == 0:
        return []
    longest = np.sort(np.r_[lengths[long], np.delete(lengths, long).max(initial=1)])[::-1].astype(np.float64)
    difference = np.flatnonzero(longest[:-1] >= _LONGER * longest[1:])
    difference = difference[difference < _MOST]
    rare = len(difference) > 0 and len(starts) >= _OFTEN * (
        len(temperature) - longest[: difference[-1] + 1].sum()
    )
    least = longest[difference[-1]] if rare else np.inf
    steps = np.abs(np.diff(temperature[starts]))
    release = _RELEASE * float(np.quantile(steps, _ON_RAMPS))
    moved = np.r_[steps, np.inf]  # behind each stretch
    one_step = _ONE_STEP * float(steps.min())
    return [
        (int(starts[k]), int(lengths[k]))
        for k in long
        if (lengths[k] >= least and moved[k] > one_step) or (k < len(steps) and steps[k] > release)
    ]


@dataclass(frozen=True)
class _Followed:
    """One run: means, and what it says alone; lag None where its temperature hardly changes."""

    run: Run
    own_c: FloatArray
    rate: FloatArray  # C/s
    difference_c: FloatArray
    lag_s: float | None


def thermometer_findings(dataset: Dataset) -> Iterator[dict[str, Any]]:
    """A finding for each thermometer and run that are outliers; none of fewer than three runs."""
    names = [n for n in dataset.channels if channel_kind(n, dataset.units) == "temperature"]
    if not names or len(dataset.runs) < _LEAST_RUNS:
        return
    followed: dict[str, list[_Followed]] = {name: [] for name in names}
    for run in dataset.runs:
        rows = run.rows()
        for name in names:
            one = _followed(run, rows, name)
            if one is not None:
                followed[name].append(one)
    for name, runs in followed.items():
        if len(runs) >= _LEAST_RUNS:
            yield from _odd_ones(name, runs)


def _followed(run: Run, rows: Rows, name: str) -> _Followed | None:
    inside = run.in_span(rows.time_s) & np.isfinite(rows.channels[name]) & np.isfinite(rows.temperature_c)
    time = rows.time_s[inside]
    if time.size == 0:
        return None
    cell = np.floor((time - time[0]) / _CELL_S).astype(np.int64)
    kept, index = np.unique(cell, return_inverse=True)
    count = np.bincount(index)
    own = np.bincount(index, rows.temperature_c[inside]) / count
    other = np.bincount(index, rows.channels[name][inside]) / count
    settled = kept * _CELL_S >= min(_SETTLED_S, (time[-1] - time[0]) / 3.0)
    if settled.sum() < _LEAST_CELLS:
        return None
    rate = np.gradient(own, kept * _CELL_S)[settled]
    own, difference = own[settled], (other - own)[settled]
    lag = -float(_fit(own, rate, difference)[2]) if np.ptp(own) >= _LEAST_RANGE_C else None
    return _Followed(run, own, rate, difference, lag)


def _columns(own: FloatArray, rate: FloatArray, center: float) -> FloatArray:
    return np.stack([np.ones(len(own)), own - center, rate], axis=1)


def _fit(own: FloatArray, rate: FloatArray, difference: FloatArray) -> FloatArray:
    """Offset at the mean temperature, share, and less the lag."""
    return np.asarray(np.linalg.lstsq(_columns(own, rate, float(own.mean())), difference, rcond=None)[0])


def _odd_ones(name: str, runs: list[_Followed]) -> Iterator[dict[str, Any]]:
    lags = np.array([np.nan if one.lag_s is None else one.lag_s for one in runs])
    for k, one in enumerate(runs):
        others = [other for j, other in enumerate(runs) if j != k]
        own, rate, difference = (
            np.concatenate([getattr(o, part) for o in others]) for part in ("own_c", "rate", "difference_c")
        )
        center = float(own.mean())
        found = np.linalg.lstsq(_columns(own, rate, center), difference, rcond=None)[0]

        def mean_left(o: _Followed, found: FloatArray = found, center: float = center) -> float:
            return float(np.mean(o.difference_c - _columns(o.own_c, o.rate, center) @ found))

        shift = mean_left(one)
        usual = float(np.sqrt(np.mean([mean_left(o) ** 2 for o in others])))
        reported = []
        if abs(shift) > max(_SIGMAS * usual, _LEAST_C):
            reported.append(f"shows {abs(shift):.2g} C {'more' if shift > 0.0 else 'less'}")
        rest = np.delete(lags, k)
        rest = rest[np.isfinite(rest)]
        if np.isfinite(lags[k]) and len(rest) >= _LEAST_RUNS - 1:
            late = float(lags[k] - np.median(rest))
            if abs(late) > max(_SIGMAS * float(rest.std()), _LEAST_S):
                reported.append(f"answers {abs(late):.0f} s {'later' if late > 0.0 else 'sooner'}")
        if reported:
            yield _finding(name, one, " and ".join(reported), shift, usual)


def _finding(name: str, one: _Followed, what: str, shift: float, usual: float) -> dict[str, Any]:
    return {
        "id": "thermometer_changed",
        "text": f"In {one.run.file} the thermometer {name} {what} beside the gyro's own than in the other runs: its "
        "contact is lost or was moved, or it is another one. Look at it, and leave the run out where it was so.",
        "evidence": {
            "file": one.run.file,
            "from_s": one.run.from_s,
            "channel": name,
            "shift_c": shift,
            "usual_c": usual,
            "lag_s": one.lag_s,
        },
    }
