"""Find temperature sensors that are not in a run what they are in the others.

In every run a thermometer follows the gyro's own: u − T = offset + share (T − mean) − lag dT/dt. What the other runs
agree on is compared with the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..common.arrays import FloatArray
from ..common.metrics import Averages, median
from ..recordings.records import Dataset, Mark, Rows, Run
from ..recordings.units import channel_kind
from ..results.base import Finding
from .findings import finding
from .odds import MIN_JUMP_C

_LEAST_RUNS = 3  # of two runs nobody knows which one is odd
_CELL_S = 60.0  # of a mean: below it the lags of thermometers themselves show
_SETTLED_S = 3600.0  # self-heating has set in by then; a third of a shorter run
_LEAST_RANGE_C = 5.0  # over less neither share nor lag of a run is known
_SIGMAS = 5.0  # of what the other runs differ by among themselves
_LEAST_S = 60.0  # a cell
_LATE_SIGMAS = 6.0  # of a run among dozens
_LEAST_LATE_S = 10.0  # a block: the front end gives temperature and rate no finer
_LEAST_CELLS = 60  # of a run: fewer do not show three numbers well


@dataclass(frozen=True)
class _Followed:
    """One run: means, and what it says alone; lag None where its temperature hardly changes."""

    run: Run
    own_c: FloatArray
    rate: FloatArray  # C/s
    difference_c: FloatArray
    lag_s: float | None


def thermometer_findings(dataset: Dataset) -> Iterator[Finding]:
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


def _odd_ones(name: str, runs: list[_Followed]) -> Iterator[Finding]:
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
        if abs(shift) > max(_SIGMAS * usual, MIN_JUMP_C):
            reported.append(f"shows {abs(shift):.2g} C {'more' if shift > 0.0 else 'less'}")
        rest = np.delete(lags, k)
        rest = rest[np.isfinite(rest)]
        if np.isfinite(lags[k]) and len(rest) >= _LEAST_RUNS - 1:
            late = float(lags[k] - np.median(rest))
            if abs(late) > max(_SIGMAS * float(rest.std()), _LEAST_S):
                reported.append(f"answers {abs(late):.0f} s {'later' if late > 0.0 else 'sooner'}")
        if reported:
            what = " and ".join(reported)
            text = (
                f"In {one.run.file} the thermometer {name} {what} beside the gyro's own than in the other runs: its "
                "contact is lost or was moved, or it is another one. Look at it, and leave the run out where it was so."
            )
            yield finding(
                "thermometer_changed",
                text,
                one.run,
                marks=(Mark(one.run.file),),
                channel=name,
                shift_c=shift,
                usual_c=usual,
                lag_s=one.lag_s,
            )


def late_findings(runs: Sequence[tuple[Run, Averages]]) -> Iterator[Finding]:
    """Runs whose residual goes with the change of their correction: T was recorded later, or earlier, than in others.

    A correction at T(t - late) instead of T(t) leaves late times its change. What all runs have in common is no fault
    of one of them, and the model may hold it.
    """
    lags = []
    for run, a in runs:
        if len(a.time_s) >= _LEAST_CELLS:
            lag = lag_of(np.gradient(a.before_dph - a.after_dph, a.time_s), a.after_dph)
            lags += [] if lag is None else [(run, *lag)]
    if len(lags) < 2:
        return
    usual = median(np.array([lag for _, lag, _ in lags]))
    for run, lag_s, sigma in lags:
        late = lag_s - usual
        if abs(late) > max(_LATE_SIGMAS * sigma, _LEAST_LATE_S, run.row_period_s):
            word = "later" if late > 0.0 else "earlier"
            text = (
                f"The temperature of {run.file} was recorded {abs(late):.3g} s {word} against the rate than in the "
                f"other runs (1 sigma {sigma:.2g} s): its clock, its wiring, or the pairing of its files."
            )
            yield finding("temperature_late", text, run, late_s=late, sigma_s=sigma)


def lag_of(change: FloatArray, left: FloatArray) -> tuple[float, float] | None:
    """Return the lag by which a residual follows a change that came late, s, with its 1 sigma.

    None where nothing changes. What is left may be correlated, so products of neighbours count (Newey and West 1987).
    """
    change, left = change - change.mean(), left - left.mean()
    power = float(change @ change)
    if power == 0.0:
        return None
    lag = float(change @ left) / power
    left = left - lag * change
    product = left * change
    depth = int(np.ceil(len(left) ** 0.25)) + 1
    total = float(product @ product)
    for k in range(1, depth):
        total += 2.0 * (1.0 - k / depth) * float(product[k:] @ product[:-k])
    return lag, float(np.sqrt(max(total, float(left @ left) / len(left) * power))) / power
