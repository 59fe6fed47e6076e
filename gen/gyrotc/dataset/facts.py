"""Plain facts about one run, computed from its rows: ranges, steps, jumps, holds, gaps, noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from .records import EarthRate, Floats, Rows, Run

__all__ = ["Jump", "RunFacts", "facts_of"]

_GAP_PERIODS = 1.5
_CELL_S = 60.0  # temperature is averaged over this before its rate is looked at
_CELL_ROWS = 5
_HOLD_C_PER_MIN = 0.1
_JUMP_SIGMAS = 10.0
_JUMP_C_PER_MIN = 10.0  # beyond the change around it; a sensor in a housing does not follow air faster
_HOLD_S = 10.0  # longest time for which a slow thermometer is thought to hold its value
_MAX_JUMPS = 20
_OUTLIER_SIGMAS = 8.0
_MAD_TO_SIGMA = 1.4826
_PART = 2**16  # rows that are looked at together

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Jump:
    """A change of temperature between two rows that its surroundings do not explain."""

    time_s: float
    from_c: float
    to_c: float


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
        hold_share: Share of these cells that change by less than 0.1 C/min.
        mean_dph: Mean rate.
        largest_dph: Largest magnitude of a rate.
        noise_dph: Scatter from row to row, robust.
        outliers: Rows whose rate departs from both neighbours by more than 8 times that.
        stuck_s: Longest stretch of one identical rate.
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
    slopes_c_per_min: Floats
    temperatures_c: Floats
    hold_share: float
    mean_dph: float
    largest_dph: float
    noise_dph: float
    outliers: int
    stuck_s: float
    constant: tuple[str, ...]
    earth: EarthRate | None


def facts_of(run: Run, rows: Rows) -> RunFacts:
    """Facts about a run from the rows of its file (as `run.rows()` gives them)."""
    inside = run.in_span(rows.time_s)
    time, temperature = _those(rows.time_s, inside), _those(rows.temperature_c, inside)
    rate = _those(rows.rate_dph, inside & np.isfinite(rows.rate_dph))
    step = np.diff(time)
    gaps = step > _GAP_PERIODS * run.row_period_s
    levels = np.unique(temperature[_changes(temperature)])
    resolution = float(np.diff(levels).min()) if len(levels) > 1 else 0.0
    cells_t, slopes = _cells(time, temperature, run.row_period_s)
    noise = _robust_sigma(np.diff(rate)) / np.sqrt(2.0)
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
        gaps=int(gaps.sum()),
        missing_rows=int(np.sum(np.round(step[gaps] / run.row_period_s) - 1.0)),
        temperature_c=(float(levels[0]), float(levels[-1])),
        temperature_step_c=resolution,
        jumps=_jumps(time, temperature, resolution),
        slopes_c_per_min=slopes,
        temperatures_c=cells_t,
        hold_share=float(np.mean(np.abs(slopes) < _HOLD_C_PER_MIN)) if len(slopes) else 1.0,
        mean_dph=float(rate.mean()) if len(rate) else 0.0,
        largest_dph=float(max(rate.max(), -rate.min())) if len(rate) else 0.0,
        noise_dph=float(noise),
        outliers=_outliers(rate, float(noise)),
        stuck_s=_longest_stretch(rate) * run.row_period_s,
        constant=_constant(rows, inside, rate),
        earth=run.earth,
    )


def _those(values: Floats, chosen: Mask) -> Floats:
    """The chosen values; the same array where that is all of them."""
    return values if chosen.all() else values[chosen]


def _changes(values: Floats) -> NDArray[np.int64]:
    """Rows that differ from the one before, and the first row."""
    return np.flatnonzero(np.r_[True, values[1:] != values[:-1]])


def _robust_sigma(values: Floats) -> float:
    """Standard deviation about 0 from the median magnitude, or the RMS where more than half are 0.

    `values` are lost: they make room for the magnitudes.
    """
    if len(values) == 0:
        return 0.0
    sigma = _MAD_TO_SIGMA * float(np.median(np.abs(values, out=values), overwrite_input=True))
    return sigma if sigma > 0.0 else float(np.sqrt(np.mean(values**2)))


def _cells(time: Floats, temperature: Floats, period_s: float) -> tuple[Floats, Floats]:
    """Mean temperature of cells and its rate (C/min) by central differences; empty for fewer than three cells."""
    length = max(_CELL_S, _CELL_ROWS * period_s)
    number = (time - time[0]) / length
    starts = _changes(np.floor(number, out=number))
    count = np.diff(np.r_[starts, len(time)])
    full = count * period_s >= 0.5 * length
    mean_t = (np.add.reduceat(temperature, starts) / count)[full]
    mean_s = (np.add.reduceat(time, starts) / count)[full]
    if len(mean_t) < 3:
        return np.zeros(0), np.zeros(0)
    return mean_t, np.gradient(mean_t, mean_s) * 60.0


def _jumps(time: Floats, temperature: Floats, resolution: float) -> tuple[Jump, ...]:
    """Steps that stand out from the steps around them, by noise, by resolution and by rate.

    A thermometer that is slower than the rows holds its value; its step has had that time to grow.
    """
    if len(temperature) < 7:
        return ()
    departure = _departures(np.diff(temperature))
    noise = _MAD_TO_SIGMA * float(np.median(departure))
    found = np.flatnonzero(departure > _JUMP_SIGMAS * noise + 2.0 * resolution)
    changes = _changes(temperature)
    last = changes[np.searchsorted(changes, found, side="right") - 1]
    taken = np.maximum(time[found + 1] - time[found], np.minimum(time[found + 1] - time[last], _HOLD_S))
    jumps = found[departure[found] > _JUMP_C_PER_MIN / 60.0 * taken]
    return tuple(
        Jump(float(time[k + 1]), float(temperature[k]), float(temperature[k + 1])) for k in jumps[:_MAX_JUMPS]
    )


def _departures(step: Floats) -> Floats:
    """Magnitudes of the differences from the median of the two before, the value itself, and the two after."""
    padded = np.pad(step, 2, mode="reflect")
    result = np.empty_like(step)
    for start in range(0, len(step), _PART):
        around = sliding_window_view(padded[start : start + _PART + 4], 5)
        part = slice(start, start + len(around))
        result[part] = np.abs(step[part] - np.partition(around, 2, axis=1)[:, 2])
    return result


def _outliers(rate: Floats, noise: float) -> int:
    """Rows that depart from both neighbours to the same side (at the ends: from the two next rows)."""
    if len(rate) < 3 or noise == 0.0:
        return 0
    limit = _OUTLIER_SIGMAS * noise
    step = np.diff(np.r_[rate[2], rate, rate[-3]])
    up, down = step > limit, step < -limit
    return int(np.count_nonzero((up[:-1] & down[1:]) | (down[:-1] & up[1:])))


def _longest_stretch(values: Floats) -> int:
    """Number of rows in the longest stretch of one identical value."""
    if len(values) == 0:
        return 0
    return int(np.diff(np.r_[_changes(values), len(values)]).max())


def _constant(rows: Rows, inside: Mask, rate: Floats) -> tuple[str, ...]:
    columns = {"temperature": _those(rows.temperature_c, inside), "rate": rate}
    columns |= {f"channel {name}": _those(values, inside) for name, values in rows.channels.items()}
    return tuple(name for name, values in columns.items() if len(values) and np.ptp(values) == 0.0)
