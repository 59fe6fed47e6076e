"""Thermometers that jump, are stuck, or are not in a run what they are in the others.

In every run a thermometer follows the gyro's own: u − T = offset + share (T − mean) − lag dT/dt. What the other runs
agree on is held against the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..common.arrays import PART, FloatArray, those
from ..common.metrics import MAD_TO_SIGMA, Averages, median, median_of_parts, middle_of_five, quantile_of_parts
from ..common.statistics import cell_means
from ..recordings.records import Dataset, Mark, Rows, Run
from ..recordings.units import channel_kind
from ..results.base import Finding
from .findings import RunFacts, changes_in, finding, mark_of

_LEAST_RUNS = 3  # of two runs nobody knows which one is odd
_CELL_S = 60.0  # of a mean: below it the lags of thermometers themselves show
_SETTLED_S = 3600.0  # self-heating has set in by then; a third of a shorter run
_LEAST_RANGE_C = 5.0  # over less neither share nor lag of a run is known
_SIGMAS = 5.0  # of what the other runs differ by among themselves
_LEAST_S = 60.0  # a cell
_LATE_SIGMAS = 6.0  # of a run among dozens
_LEAST_LATE_S = 10.0  # a block: the front end gives temperature and rate no finer


_STUCK_S = 60.0  # a thermometer that stands still for longer; readings come faster
_STUCK_ROWS = 10  # where half of the rows differ from the one before, as many alike come once in a thousand
_OFTEN = 0.5  # of the rows differ from the one before: else repeating is what the thermometer does
_LONGER = 4.0  # than what else repeats in the run; holds of one programme, in which a converter waits, differ by less
_MOST = 5  # stuck stretches of a run at most; a thermometer with more repeats often by nature
_ONE_STEP = 1.5  # steps of the converter: a temperature that is held between two of them goes on by one
_REPEATED = 3  # rows alike: averages of different readings seldom are
_LEAST_STEP_C = 1e-6  # of a converter: less is rounding
_RELEASE = 3.0  # times the steps that rows make on ramps: the temperature went on meanwhile
_ON_RAMPS = 0.95  # quantile of the steps

_JUMP_SIGMAS = 10.0  # no normal deviation reaches it
_WAVERING = 0.9  # of departures: more are no jumps
_WAVERING_SIGMAS = NormalDist().inv_cdf(0.5 + _WAVERING / 2.0)
_JUMP_C_PER_MIN = 10.0  # beyond the change around it; a sensor in a housing does not follow air faster
_LEAST_CELLS = 60  # of a run: fewer do not show what is unusual in it, nor three numbers well
_ELSEWHERE_S = 900.0  # from a place: beyond it the temperature has forgotten it
_AS_NOWHERE = 2.0  # times what the temperature does anywhere else in the run
_DISPLACED_SIGMAS = 6.0  # of the same: once in 5e8 places
_LEAST_C = 0.3  # class B thermometers may differ by so much (IEC 60751)
_BESIDE_CELLS = 6  # on either side of such a place, which a parabola follows
_RATHER = 4.0  # ratio of squares: a jump has to leave half of what a corner leaves
_EVEN = 1.2  # of seven cells in a row: longer ones hold a gap
_HOLD_S = 10.0  # longest time for which a slow thermometer is thought to hold its value
_MAX_JUMPS = 20  # that are listed: enough to see a pattern


@dataclass(frozen=True, slots=True)
class Jump:
    """A change of temperature between two rows that its surroundings do not explain."""

    time_s: float
    from_c: float
    to_c: float
    lasting: bool = False


_AROUND_S = 120.0  # about a place at which a thermometer moves as nowhere else: two cells of a minute


def temperature_findings_of(run: Run, rows: Rows, f: RunFacts) -> Iterator[Finding]:
    """Jumps of a run's temperature, and stretches in which it stands still.

    What a rate does is not judged where its temperature is not known: behind a jump that stays, and where it is stuck.
    """
    inside = run.in_span(rows.time_s)
    time, temperature = those(rows.time_s, inside), those(rows.temperature_c, inside)
    stretches = stuck_stretches(temperature, run.row_period_s)
    spans = [(float(time[k]), float(time[k + n - 1]) + run.row_period_s) for k, n in stretches]
    jumps = jumps_of(time, temperature, f.temperature_step_c)
    if any(jump.lasting for jump in jumps):  # it settles, so it did not stand still before: it was held
        spans = [span for span in spans if abs(span[1] - jumps[0].time_s) > _AROUND_S]
    else:  # one that was stuck shows at once what the temperature did meanwhile
        jumps = tuple(j for j in jumps if all(abs(j.time_s - end) > run.row_period_s for _, end in spans))
    if jumps:
        first = jumps[0]
        size, at = first.to_c - first.from_c, first.time_s
        text = (
            f"The temperature of {run.file} jumps from {first.from_c:.6g} to {first.to_c:.6g} C at {at:.6g} s, faster "
            f"than any thermal mass ({len(jumps)} places)."
        )
        limits, out = (at, at, at), list[tuple[float, float]]()
        if first.lasting:
            limits = at, at - _AROUND_S, at + _AROUND_S
            out = [(at - _AROUND_S, float(time[-1]) + run.row_period_s)]
            text = (
                f"The temperature of {run.file} moves from {first.from_c:.2f} to {first.to_c:.2f} C about {at:g} s, as "
                "nowhere else in the run: the thermometer shifted or lost contact. Leave out what lies behind."
            )
        yield finding(
            "jump_in_temperature",
            text,
            run,
            marks=[Mark(run.file, None, (j.time_s, j.time_s)) for j in jumps],
            time_s=limits,
            size=((size, size, size), "C"),
            leave_out=out,
        )
    if spans:
        start, end = max(spans, key=lambda span: span[1] - span[0])
        text = (
            f"The temperature of {run.file} stands still to the last digit for {end - start:g} s from {start:g} s on, "
            f"where it otherwise changes from row to row ({len(spans)} places): the thermometer was stuck, or its "
            "record."
        )
        yield finding(
            "stuck_temperature",
            text,
            run,
            marks=[mark_of(run.file, rows, *span) for span in spans],
            time_s=(start, start - 2.0 * run.row_period_s, start),  # the row before may be a mean that holds it
            size=((end - start,) * 3, "s"),
            leave_out=spans,
        )


def jumps_of(time: FloatArray, temperature: FloatArray, resolution: float) -> tuple[Jump, ...]:
    """Jumps from one row to the next, the first ones, else the one place at which it moves as nowhere else."""
    return _sudden(time, temperature, resolution) or displaced(time, temperature, resolution)


def _sudden(time: FloatArray, temperature: FloatArray, resolution: float) -> tuple[Jump, ...]:
    """Steps that stand out from the steps around them, by noise, by resolution and by rate.

    A thermometer that is slower than the rows holds its value; its step has had that time to grow.
    """
    if len(temperature) < 7:
        return ()

    def departures() -> Iterator[FloatArray]:
        return _departures(temperature)

    noise = MAD_TO_SIGMA * median_of_parts(departures)
    if noise == 0.0:  # a coarse thermometer stays where it is most times; its larger steps tell how it wavers
        noise = quantile_of_parts(departures, _WAVERING) / _WAVERING_SIGMAS
    limit = _JUMP_SIGMAS * noise + 2.0 * resolution
    wide = [(at * PART + np.flatnonzero(part > limit), part[part > limit]) for at, part in enumerate(departures())]
    found, departure = (np.concatenate(column) for column in zip(*wide, strict=True))
    changes = changes_in(temperature)
    last = changes[np.searchsorted(changes, found, side="right") - 1]
    taken = np.maximum(time[found + 1] - time[found], np.minimum(time[found + 1] - time[last], _HOLD_S))
    jumps = found[departure > _JUMP_C_PER_MIN / 60.0 * taken]
    return tuple(Jump(float(time[k + 1]), float(temperature[k]), float(temperature[k + 1])) for k in jumps[:_MAX_JUMPS])


def displaced(time: FloatArray, temperature: FloatArray, resolution: float) -> tuple[Jump, ...]:
    """The one place of a run, if any, at which the temperature moves as nowhere else within two minutes.

    What it moves by over two cells is compared with the cells around. A block of glass bends alike at every corner of a
    programme; a thermometer that comes off, or shifts, does so once.
    """
    t, x = cell_means(_CELL_S, time, temperature)
    if len(t) < _LEAST_CELLS:
        return ()
    inner, outer = x[4:-2] - x[2:-4], 0.5 * (x[2:-4] - x[:-6] + x[6:] - x[4:-2])
    even = t[6:] - t[:-6] < 6.0 * _EVEN * median(np.diff(t))
    beside = np.where(even, inner - outer, 0.0)
    size = np.abs(beside)
    k = int(np.argmax(size))
    elsewhere = np.abs(t[3:-3] - t[k + 3]) > _ELSEWHERE_S
    if not elsewhere.any():
        return ()
    least = _AS_NOWHERE * float(size[elsewhere].max())
    noise = MAD_TO_SIGMA * median(size[elsewhere])
    if size[k] < max(least, _DISPLACED_SIGMAS * noise, 2.0 * resolution, _LEAST_C):
        return ()
    for at in (k + 3, k + 2):  # a thermometer that settles in a minute moves most behind the cell in which it came off
        near = np.abs(np.arange(len(t)) - at) <= _BESIDE_CELLS
        if _jumps_rather_than_bends((t[near] - t[at]) / _CELL_S, x[near]):
            return (Jump(float(t[at]), float(x[at - 1]), float(x[at + 1]), lasting=True),)
    return ()


def _jumps_rather_than_bends(u: FloatArray, x: FloatArray) -> bool:
    """Whether temperatures around u = 0 jump there, and go on as they like, far rather than they turn a corner.

    The cell of the jump and the next, in which a thermometer still settles, are left out. Where both sides meet within
    them there is a corner, however little it leaves.
    """
    used = (u < -0.5) | (u > 1.5)
    u, x = u[used], x[used]

    def left(*columns: FloatArray) -> tuple[float, FloatArray]:
        all_ = np.column_stack([np.ones_like(u), u, u * u, *columns])
        found = np.linalg.lstsq(all_, x, rcond=None)[0]
        rest = x - all_ @ found
        return float(rest @ rest), np.asarray(found)

    jumps, (*_, size, turn) = left(np.asarray(u > 0.0, dtype=np.float64), np.maximum(u, 0.0))
    if min(-0.5 * turn, 1.5 * turn) <= -size <= max(-0.5 * turn, 1.5 * turn):
        return False

    def corner_at(at: float) -> FloatArray:
        since = u - at  # a mean over the cell that holds the corner rounds it
        return np.where(np.abs(since) < 0.5, 0.5 * (since + 0.5) ** 2, np.maximum(since, 0.0))

    return min(left(corner_at(at))[0] for at in np.arange(-3.0, 4.0, 0.02).tolist()) > _RATHER * jumps


def _departures(values: FloatArray) -> Iterator[FloatArray]:
    """How far each difference of neighbours is from the median of the two before, itself, and the two after; in parts.

    At both ends they are mirrored.
    """
    for start in range(0, len(values) - 1, PART):
        step = np.diff(values[max(start - 2, 0) : start + PART + 3])
        before, after = min(start, 2), max(min(len(values) - 1 - start - PART, 2), 0)
        around = np.r_[step[2:0:-1][: 2 - before], step, step[-2 : -4 + after : -1][: 2 - after]]
        windows = sliding_window_view(around, 5)
        yield np.abs(step[before : len(step) - after] - middle_of_five(*windows.T))


def stuck_stretches(temperature: FloatArray, period_s: float) -> list[tuple[int, int]]:
    """First row and number of rows of the stretches in which a thermometer was stuck.

    A coarse converter, or a logger that averages one, repeats a reading for as long as a chamber holds. So a stretch
    counts only where it is far longer than all others of a run that seldom repeats and ends with more than one step of
    the converter, or where it ends with a step that no ramp of the run makes from row to row. The step of a converter
    whose readings were averaged lies between the values that repeat: there all readings were one.
    """
    starts = np.flatnonzero(np.r_[True, temperature[1:] != temperature[:-1]])
    lengths = np.diff(np.r_[starts, len(temperature)])
    long = np.flatnonzero((lengths >= _STUCK_ROWS) & (lengths * period_s > _STUCK_S))
    if len(starts) < 2 or len(long) == 0:
        return []
    longest = np.sort(np.r_[lengths[long], np.delete(lengths, long).max(initial=1)])[::-1].astype(np.float64)
    difference = np.flatnonzero(longest[:-1] >= _LONGER * longest[1:])
    difference = difference[difference < _MOST]
    rare = len(difference) > 0 and len(starts) >= _OFTEN * (len(temperature) - longest[: difference[-1] + 1].sum())
    least = longest[difference[-1]] if rare else np.inf
    steps = np.abs(np.diff(temperature[starts]))
    release = _RELEASE * float(np.quantile(steps, _ON_RAMPS))
    moved = np.r_[steps, np.inf]  # behind each stretch
    apart = np.diff(np.unique(temperature[starts[lengths >= _REPEATED]]))
    apart = apart[apart > _LEAST_STEP_C]
    one_step = _ONE_STEP * float(apart.min() if len(apart) else steps.min())
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
        if abs(shift) > max(_SIGMAS * usual, _LEAST_C):
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
    """By how much what was left, beside a constant, follows from a change that came late, s, with its 1 sigma.

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
