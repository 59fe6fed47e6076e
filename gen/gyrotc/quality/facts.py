"""Plain facts about one run, computed from its rows: ranges, steps, jumps, holds, gaps, noise."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ..common.arrays import BoolArray, FloatArray
from ..common.metrics import MAD_TO_SIGMA, median, median_of_parts, middle_of_five, quantile_of_parts
from ..common.statistics import cell_means
from ..recordings.records import EarthRate, Rows, Run

_GAP_PERIODS = 1.5  # a step longer than this has room for a missing row
_CELL_S = 60.0  # temperature is averaged over this before its rate is looked at
_CELL_ROWS = 5  # fewer do not average the resolution of a thermometer
_HOLD_C_PER_MIN = 0.1  # slower than this a chamber holds, or settles
_JUMP_SIGMAS = 10.0  # no normal deviation reaches it
_WAVERING = 0.9  # of departures: more are no jumps
_WAVERING_SIGMAS = NormalDist().inv_cdf(0.5 + _WAVERING / 2.0)
_JUMP_C_PER_MIN = 10.0  # beyond the change around it; a sensor in a housing does not follow air faster
_LEAST_CELLS = 60  # of a run: fewer do not show what is unusual in it
_ELSEWHERE_S = 900.0  # from a place: beyond it the temperature has forgotten it
_AS_NOWHERE = 2.0  # times what the temperature does anywhere else in the run
_DISPLACED_SIGMAS = 6.0  # of the same: once in 5e8 places
_LEAST_C = 0.3  # class B thermometers may differ by so much (IEC 60751)
_BESIDE_CELLS = 6  # on either side of such a place, which a parabola follows
_RATHER = 4.0  # ratio of squares: a jump has to leave half of what a corner leaves
_EVEN = 1.2  # of seven cells in a row: longer ones hold a gap
_HOLD_S = 10.0  # longest time for which a slow thermometer is thought to hold its value
_MAX_JUMPS = 20  # that are listed: enough to see a pattern
_OUTLIER_SIGMAS = 8.0  # a normal row lies beyond it once in 8e14
_OUTLIER_ROWS = 10  # a longer departure is a piece of record, no outlier
# Widths of counters in the processors and FPGAs that read gyros out
_COUNTER_BITS = (8, 12, 16, 18, 20, 24, 32)
_LEAST_HELD = 30  # rates: fewer do not show a rhythm
_HELD = 0.9  # of them held for as long as the others, to a row: their rhythms need not fit
_PART = 2**16  # rows that are looked at together


@dataclass(frozen=True, slots=True)
class Jump:
    """A change of temperature between two rows that its surroundings do not explain."""

    time_s: float
    from_c: float
    to_c: float
    lasting: bool = False


@dataclass(frozen=True, slots=True)
class Outlier:
    """The largest of the outliers of a run: its first row and by how much it departs from the row before."""

    time_s: float
    rate_dph: float
    departure_dph: float


@dataclass(frozen=True, slots=True)
class RunFacts:
    """Facts about the rows of one run; temperatures in C, rates in deg/h, times in s on the file's clock.

    Attributes:
        file: Its file.
        from_s: Start of its span, None for the whole file.
        role: What it is for.
        environment: Free text of the description.
        sha256: Of the file.
        started: Whether the start of the recording is stated.
        rows: Number of its rows.
        first_s: Time of its first row.
        last_s: Time of its last row.
        row_period_s: Median row period of the file.
        gaps: Number of steps longer than 1.5 row periods.
        missing_rows: Rows that these gaps would have held.
        temperature_c: Lowest and highest temperature.
        temperature_step_c: Smallest difference between two temperatures that occur; 0 if there is one only.
        jumps: Jumps of temperature, the first ones.
        slopes_c_per_min: Rates of temperature of cells of a minute (at least five rows).
        temperatures_c: Mean temperatures of these cells, same shape.
        rates_dph: Mean rates of these cells, same shape.
        hold_share: Share of these cells that change by less than 0.1 C/min.
        mean_dph: Mean rate.
        largest_dph: Largest magnitude of a rate.
        noise_dph: Scatter from row to row, robust.
        outliers: Rows whose rate departs from those before and after by more than 8 times that, to the same side; up to
            ten in a row.
        outlier: The largest of them.
        wrapped: Where a counter of pulses passed its end: time of the first place, bits of the counter, places.
        stuck_s: Longest stretch of one identical rate.
        held_rows: For how many rows each rate is held; 1: every row has its own.
        constant: Columns that hold one value only.
        earth: Earth's rate that was taken off, None where there was nothing to take off.
    """

    file: str
    from_s: float | None
    role: str
    environment: str
    sha256: str
    started: bool
    rows: int
    first_s: float
    last_s: float
    row_period_s: float
    gaps: int
    missing_rows: int
    temperature_c: tuple[float, float]
    temperature_step_c: float
    jumps: tuple[Jump, ...]
    slopes_c_per_min: FloatArray
    temperatures_c: FloatArray
    rates_dph: FloatArray
    hold_share: float
    mean_dph: float
    largest_dph: float
    noise_dph: float
    outliers: int
    outlier: Outlier | None
    wrapped: tuple[float, int, int] | None
    stuck_s: float
    held_rows: int
    constant: tuple[str, ...]
    earth: EarthRate | None


def facts_of(run: Run, rows: Rows) -> RunFacts:
    """Facts about a run from the rows of its file (as `run.rows()` gives them)."""
    inside = run.in_span(rows.time_s)
    time, temperature = _those(rows.time_s, inside), _those(rows.temperature_c, inside)
    finite = inside & np.isfinite(rows.rate_dph)
    rate = _those(rows.rate_dph, finite)
    late = np.flatnonzero(_steps_are(time, lambda step: step > _GAP_PERIODS * run.row_period_s))
    if not inside.all():
        late = late[np.diff(np.flatnonzero(inside))[late] == 1]  # what was excluded is no gap
    missing = int(np.sum(np.round((time[late + 1] - time[late]) / run.row_period_s) - 1.0))
    low_c, high_c, resolution = _levels(temperature)
    measured = _those(rows.rate_dph, inside)
    if not np.isfinite(measured).all():
        measured = np.where(np.isfinite(measured), measured, rate.mean() if len(rate) else 0.0)
    cells_t, slopes, cells_rate = _cells(time, temperature, measured, run.row_period_s)
    count, outlier = _outliers(_those(rows.time_s, finite), rate)
    noise = _robust_sigma(rate) / np.sqrt(2.0)
    return RunFacts(
        file=run.file,
        from_s=run.from_s,
        role=run.role,
        environment=run.environment,
        sha256=run.sha256,
        started=run.started is not None,
        rows=len(time),
        first_s=float(time[0]),
        last_s=float(time[-1]),
        row_period_s=run.row_period_s,
        gaps=len(late),
        missing_rows=missing,
        temperature_c=(low_c, high_c),
        temperature_step_c=resolution,
        jumps=_jumps(time, temperature, resolution) or displaced(time, temperature, resolution),
        slopes_c_per_min=slopes,
        temperatures_c=cells_t,
        rates_dph=cells_rate,
        hold_share=float(np.mean(np.abs(slopes) < _HOLD_C_PER_MIN)) if len(slopes) else 1.0,
        mean_dph=float(rate.mean()) if len(rate) else 0.0,
        largest_dph=float(max(rate.max(), -rate.min())) if len(rate) else 0.0,
        noise_dph=float(noise),
        outliers=count,
        outlier=outlier,
        wrapped=_wrapped(rows, finite, run.pulse_weight_arcsec),
        stuck_s=_longest_stretch(rate) * run.row_period_s,
        held_rows=_held(rate),
        constant=_constant(rows, inside, rate),
        earth=run.earth,
    )


def _those(values: FloatArray, chosen: BoolArray) -> FloatArray:
    """The chosen values; the same array where that is all of them."""
    return values if chosen.all() else values[chosen]


def _steps_are(values: FloatArray, found: Callable[[FloatArray], BoolArray]) -> BoolArray:
    """What is found of the differences of neighbours, shape (n - 1,); part by part, as all of them fill memory."""
    parts = (np.diff(values[at : at + _PART + 1]) for at in range(0, len(values) - 1, _PART))
    return np.concatenate([np.zeros(0, dtype=bool), *map(found, parts)])


def _levels(temperature: FloatArray) -> tuple[float, float, float]:
    """Lowest and highest of the values, and the least difference of two of them; 0 where there is one."""
    values = temperature[np.r_[True, temperature[1:] != temperature[:-1]]]
    values.sort()
    least = np.inf
    for start in range(0, len(values), _PART):
        step = np.diff(values[start : start + _PART + 1])
        least = min(least, float(step[step > 0.0].min(initial=np.inf)))
    return float(values[0]), float(values[-1]), least if np.isfinite(least) else 0.0


def _changes(values: FloatArray) -> NDArray[np.int64]:
    """Rows that differ from the one before, and the first row."""
    return np.flatnonzero(np.r_[True, values[1:] != values[:-1]])


def _robust_sigma(values: FloatArray) -> float:
    """Standard deviation about 0 of differences of neighbours from their median magnitude.

    Their RMS where more than half are 0.
    """
    if len(values) < 2:
        return 0.0

    def magnitudes() -> Iterator[FloatArray]:
        return (np.abs(np.diff(values[at : at + _PART + 1])) for at in range(0, len(values) - 1, _PART))

    sigma = MAD_TO_SIGMA * median_of_parts(magnitudes)
    return sigma if sigma > 0.0 else float(np.sqrt(np.mean(np.diff(values) ** 2)))


def _cells(
    time: FloatArray, temperature: FloatArray, rate: FloatArray, period_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean temperature of cells, its rate (C/min) by central differences, mean rate; empty for fewer than three."""
    length = max(_CELL_S, _CELL_ROWS * period_s)
    numbers = (np.floor((time[at : at + _PART] - time[0]) / length) for at in range(0, len(time), _PART))
    last = np.array([-1.0])
    found = []
    for at, number in enumerate(numbers):
        found.append(at * _PART + np.flatnonzero(np.diff(number, prepend=last)))
        last = number[-1:]
    starts = np.concatenate(found)
    count = np.diff(np.r_[starts, len(time)])
    full = count * period_s >= 0.5 * length
    mean_t = (np.add.reduceat(temperature, starts) / count)[full]
    mean_s = (np.add.reduceat(time, starts) / count)[full]
    if len(mean_t) < 3:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    mean_rate = (np.add.reduceat(rate, starts) / count)[full]
    return mean_t, np.gradient(mean_t, mean_s) * 60.0, mean_rate


def _jumps(time: FloatArray, temperature: FloatArray, resolution: float) -> tuple[Jump, ...]:
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
    wide = [
        (at * _PART + np.flatnonzero(part > limit), part[part > limit])
        for at, part in enumerate(departures())
    ]
    found, departure = (np.concatenate(column) for column in zip(*wide, strict=True))
    changes = _changes(temperature)
    last = changes[np.searchsorted(changes, found, side="right") - 1]
    taken = np.maximum(time[found + 1] - time[found], np.minimum(time[found + 1] - time[last], _HOLD_S))
    jumps = found[departure > _JUMP_C_PER_MIN / 60.0 * taken]
    return tuple(
        Jump(float(time[k + 1]), float(temperature[k]), float(temperature[k + 1])) for k in jumps[:_MAX_JUMPS]
    )


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
    at = k + 3
    near = np.abs(np.arange(len(t)) - at) <= _BESIDE_CELLS
    if not _jumps_rather_than_bends((t[near] - t[at]) / _CELL_S, x[near]):
        return ()
    return (Jump(float(t[at]), float(x[at - 1]), float(x[at + 1]), lasting=True),)


def _jumps_rather_than_bends(u: FloatArray, x: FloatArray) -> bool:
    """Whether temperatures around u = 0 jump there, and go on as they like, far rather than they turn a corner.

    The cell of the jump and the next, in which a thermometer still settles, are left out.
    """
    used = (u < -0.5) | (u > 1.5)
    u, x = u[used], x[used]

    def left(*columns: FloatArray) -> float:
        all_ = np.column_stack([np.ones_like(u), u, u * u, *columns])
        rest = x - all_ @ np.linalg.lstsq(all_, x, rcond=None)[0]
        return float(rest @ rest)

    def corner_at(at: float) -> FloatArray:
        since = u - at  # a mean over the cell that holds the corner rounds it
        return np.where(np.abs(since) < 0.5, 0.5 * (since + 0.5) ** 2, np.maximum(since, 0.0))

    corner = min(left(corner_at(at)) for at in np.arange(-3.0, 4.0, 0.02).tolist())
    return corner > _RATHER * left(np.asarray(u > 0.0, dtype=np.float64), np.maximum(u, 0.0))


def _departures(values: FloatArray) -> Iterator[FloatArray]:
    """How far each difference of neighbours is from the median of the two before, itself, and the two after; in parts.

    At both ends they are mirrored.
    """
    for start in range(0, len(values) - 1, _PART):
        step = np.diff(values[max(start - 2, 0) : start + _PART + 3])
        before, after = min(start, 2), max(min(len(values) - 1 - start - _PART, 2), 0)
        around = np.r_[step[2:0:-1][: 2 - before], step, step[-2 : -4 + after : -1][: 2 - after]]
        windows = sliding_window_view(around, 5)
        yield np.abs(step[before : len(step) - after] - middle_of_five(*windows.T))


def _outliers(time: FloatArray, rate: FloatArray) -> tuple[int, Outlier | None]:
    """Rows between two steps of opposite sign, each beyond 8 times the noise, and the largest of them.

    At the ends of the record the two next rows stand for the missing neighbour. Where most rows repeat the one before,
    the noise is that of those that do not.
    """
    if len(rate) < 3:
        return 0, None

    def moved() -> Iterator[FloatArray]:
        return (np.abs(part[part != 0.0]) for part in _to_and_from(rate))

    scale = median_of_parts(moved) if any(map(len, moved())) else np.inf
    limit = _OUTLIER_SIGMAS * MAD_TO_SIGMA * scale / np.sqrt(2.0)
    wide = [
        (k * _PART + (at := np.flatnonzero(np.abs(part) > limit)), part[at])
        for k, part in enumerate(_to_and_from(rate))
    ]
    large, step = (np.concatenate(column) for column in zip(*wide, strict=True))
    first, last = large[:-1], large[1:]
    pair = (np.sign(step[:-1]) != np.sign(step[1:])) & (last - first <= _OUTLIER_ROWS)
    pair[1:] &= ~_follows(pair)[1:]
    first, last, step = first[pair], last[pair], step[:-1][pair]
    if len(first) == 0:
        return 0, None
    most = np.argmax(np.abs(step))
    k = first[most]
    return int(np.sum(last - first)), Outlier(float(time[k]), float(rate[k]), float(step[most]))


def _to_and_from(rate: FloatArray) -> Iterator[FloatArray]:
    """Steps to every row and from the last one, shape (n + 1,), part by part; at the ends from and to the third row."""
    first, last = rate[0] - rate[2], rate[-3] - rate[-1]
    for at in range(0, len(rate) + 1, _PART):
        step = np.diff(rate[max(at - 1, 0) : at + _PART])
        yield np.r_[[first] if at == 0 else [], step, [last] if at + _PART > len(rate) else []]


def _follows(pair: BoolArray) -> BoolArray:
    """Pairs that share their first step with the pair before: every other one of a chain."""
    chain = np.zeros(len(pair), dtype=bool)
    for k in np.flatnonzero(pair):
        chain[k] = k > 0 and pair[k - 1] and not chain[k - 1]
    return chain


def _wrapped(rows: Rows, finite: BoolArray, weight_arcsec: float | None) -> tuple[float, int, int] | None:
    """Places where counted pulses step by a whole range of a counter (2^8 ... 2^32) and hardly by anything else."""
    if weight_arcsec is None or len(rows) < 4:
        return None
    counts = np.rint(rows.rate_dph[1:] * np.diff(rows.time_s) / weight_arcsec)
    use, time = finite[1:], rows.time_s[1:]
    step = np.diff(counts[use])
    for bits in _COUNTER_BITS:
        size = 2.0**bits
        if len(step) == 0 or np.abs(step).max() > 1.5 * size:
            continue
        rest = np.abs(step - size * np.rint(step / size))
        wraps = np.flatnonzero((np.abs(step) > 0.5 * size) & (rest < size / 8.0))
        usual = MAD_TO_SIGMA * median(rest)
        wraps = wraps[rest[wraps] <= _OUTLIER_SIGMAS * usual + 4.0]
        if len(wraps) and usual < size / 32.0:
            return float(time[use][wraps[0] + 1]), bits, len(wraps)
    return None


def _longest_stretch(values: FloatArray) -> int:
    """Number of rows in the longest stretch of one identical value."""
    if len(values) == 0:
        return 0
    longest = begun = 0
    for start in range(1, len(values), _PART):
        part = values[start : start + _PART]
        at = np.r_[begun, start + np.flatnonzero(part != values[start - 1 : start - 1 + len(part)])]
        longest, begun = max(longest, int(np.diff(at).max(initial=0))), int(at[-1])
    return max(longest, len(values) - begun)


def _held(rate: FloatArray) -> int:
    """For how many rows each rate is held: a logger that asks oftener than the gyro answers; 1 where none is.

    A coarse rate repeats, too, but never for one number of rows.
    """
    lengths = np.diff(_changes(rate[:_PART]))
    if len(lengths) < _LEAST_HELD:
        return 1
    usual = int(np.median(lengths))
    return usual if usual > 1 and float(np.mean(np.abs(lengths - usual) <= 1)) > _HELD else 1


def _constant(rows: Rows, inside: BoolArray, rate: FloatArray) -> tuple[str, ...]:
    columns = {"temperature": _those(rows.temperature_c, inside), "rate": rate}
    columns |= {f"channel {name}": _those(values, inside) for name, values in rows.channels.items()}
    return tuple(name for name, values in columns.items() if len(values) and np.ptp(values) == 0.0)
