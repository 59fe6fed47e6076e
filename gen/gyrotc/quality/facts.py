"""Plain facts about one run, computed from its rows: ranges, steps, holds, gaps, noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import PART, BoolArray, FloatArray, steps_are, those
from ..common.metrics import MAD_TO_SIGMA, median, median_of_parts
from ..recordings.records import EarthRate, Rows, Run

_GAP_PERIODS = 1.5  # a step longer than this has room for a missing row
_CELL_S = 60.0  # temperature is averaged over this before its rate is looked at
_CELL_ROWS = 5  # fewer do not average the resolution of a thermometer
_HOLD_C_PER_MIN = 0.1  # slower than this a chamber holds, or settles
# Widths of counters in the processors and FPGAs that read gyros out
_COUNTER_BITS = (8, 12, 16, 18, 20, 24, 32)
_LEAST_HELD = 30  # rates: fewer do not show a rhythm
_HELD = 0.9  # of them held for as long as the others, to a row: their rhythms need not fit
SPIKE_SIGMAS = 7.0  # once in 4e11 normal rows: a clean recording loses none


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
        slopes_c_per_min: Rates of temperature of cells of a minute (at least five rows).
        temperatures_c: Mean temperatures of these cells, same shape.
        rates_dph: Mean rates of these cells, same shape.
        hold_share: Share of these cells that change by less than 0.1 C/min.
        mean_dph: Mean rate.
        largest_dph: Largest magnitude of a rate.
        noise_dph: Scatter from row to row, robust.
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
    slopes_c_per_min: FloatArray
    temperatures_c: FloatArray
    rates_dph: FloatArray
    hold_share: float
    mean_dph: float
    largest_dph: float
    noise_dph: float
    wrapped: tuple[float, int, int] | None
    stuck_s: float
    held_rows: int
    constant: tuple[str, ...]
    earth: EarthRate | None


def facts_of(run: Run, rows: Rows) -> RunFacts:
    """Facts about a run from the rows of its file (as `run.rows()` gives them)."""
    inside = run.in_span(rows.time_s)
    time, temperature = those(rows.time_s, inside), those(rows.temperature_c, inside)
    finite = inside & np.isfinite(rows.rate_dph)
    rate = those(rows.rate_dph, finite)
    late = np.flatnonzero(steps_are(time, lambda step: step > _GAP_PERIODS * run.row_period_s))
    if not inside.all():
        late = late[np.diff(np.flatnonzero(inside))[late] == 1]  # what was excluded is no gap
    missing = int(np.sum(np.round((time[late + 1] - time[late]) / run.row_period_s) - 1.0))
    low_c, high_c, resolution = _levels(temperature)
    measured = those(rows.rate_dph, inside)
    if not np.isfinite(measured).all():
        measured = np.where(np.isfinite(measured), measured, rate.mean() if len(rate) else 0.0)
    cells_t, slopes, cells_rate = _cells(time, temperature, measured, run.row_period_s)
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
        slopes_c_per_min=slopes,
        temperatures_c=cells_t,
        rates_dph=cells_rate,
        hold_share=float(np.mean(np.abs(slopes) < _HOLD_C_PER_MIN)) if len(slopes) else 1.0,
        mean_dph=float(rate.mean()) if len(rate) else 0.0,
        largest_dph=float(max(rate.max(), -rate.min())) if len(rate) else 0.0,
        noise_dph=float(noise),
        wrapped=_wrapped(rows, finite, run.pulse_weight_arcsec),
        stuck_s=longest_stretch(rate)[1] * run.row_period_s,
        held_rows=_held(rate),
        constant=_constant(rows, inside, rate),
        earth=run.earth,
    )


def _levels(temperature: FloatArray) -> tuple[float, float, float]:
    """Lowest and highest of the values, and the least difference of two of them; 0 where there is one."""
    values = temperature[np.r_[True, temperature[1:] != temperature[:-1]]]
    values.sort()
    least = np.inf
    for start in range(0, len(values), PART):
        step = np.diff(values[start : start + PART + 1])
        least = min(least, float(step[step > 0.0].min(initial=np.inf)))
    return float(values[0]), float(values[-1]), least if np.isfinite(least) else 0.0


def changes_in(values: FloatArray) -> NDArray[np.int64]:
    """Rows that differ from the one before, and the first row."""
    return np.flatnonzero(np.r_[True, values[1:] != values[:-1]])


def _robust_sigma(values: FloatArray) -> float:
    """Standard deviation about 0 of differences of neighbours from their median magnitude.

    Their RMS where more than half are 0.
    """
    if len(values) < 2:
        return 0.0

    def magnitudes() -> Iterator[FloatArray]:
        return (np.abs(np.diff(values[at : at + PART + 1])) for at in range(0, len(values) - 1, PART))

    sigma = MAD_TO_SIGMA * median_of_parts(magnitudes)
    return sigma if sigma > 0.0 else float(np.sqrt(np.mean(np.diff(values) ** 2)))


def _cells(
    time: FloatArray, temperature: FloatArray, rate: FloatArray, period_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean temperature of cells, its rate (C/min) by central differences, mean rate; empty for fewer than three."""
    length = max(_CELL_S, _CELL_ROWS * period_s)
    numbers = (np.floor((time[at : at + PART] - time[0]) / length) for at in range(0, len(time), PART))
    last = np.array([-1.0])
    found = []
    for at, number in enumerate(numbers):
        found.append(at * PART + np.flatnonzero(np.diff(number, prepend=last)))
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
        wraps = wraps[rest[wraps] <= SPIKE_SIGMAS * usual + 4.0]
        if len(wraps) and usual < size / 32.0:
            return float(time[use][wraps[0] + 1]), bits, len(wraps)
    return None


def longest_stretch(values: FloatArray) -> tuple[int, int]:
    """First row and number of rows of the longest stretch of one value; a missing one is as no other."""
    first = rows = begun = 0
    for start in range(1, len(values) + 1, PART):
        part = values[start : start + PART]
        ends = start + np.flatnonzero(part != values[start - 1 : start - 1 + len(part)])
        if start + PART > len(values):
            ends = np.r_[ends, len(values)]
        lengths = np.diff(ends, prepend=begun)
        k = int(np.argmax(lengths)) if len(lengths) else 0
        if len(lengths) and lengths[k] > rows:
            first, rows = int(ends[k] - lengths[k]), int(lengths[k])
        begun = int(ends[-1]) if len(ends) else begun
    return first, rows


def _held(rate: FloatArray) -> int:
    """For how many rows each rate is held: a logger that asks oftener than the gyro answers; 1 where none is.

    A coarse rate repeats, too, but never for one number of rows.
    """
    lengths = np.diff(changes_in(rate[:PART]))
    if len(lengths) < _LEAST_HELD:
        return 1
    usual = int(np.median(lengths))
    return usual if usual > 1 and float(np.mean(np.abs(lengths - usual) <= 1)) > _HELD else 1


def _constant(rows: Rows, inside: BoolArray, rate: FloatArray) -> tuple[str, ...]:
    columns = {"temperature": those(rows.temperature_c, inside), "rate": rate}
    columns |= {f"channel {name}": those(values, inside) for name, values in rows.channels.items()}
    return tuple(name for name, values in columns.items() if len(values) and np.ptp(values) == 0.0)
