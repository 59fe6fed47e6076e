"""Time stamps against the rows: rows that are missing, clocks that were set, stamps that drift or are coarse."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import BoolArray, FloatArray, masked
from ..common.missing import missing_rows
from ..recordings.records import Mark, Rows, Run
from ..results.base import Finding
from .findings import finding

_AROUND_S, _AROUND_ROWS = 300.0, 10  # what is fitted on either side of a gap
_LEAST_JUMP_C, _JUMP_SIGMAS = 1.0, 20.0  # what the time would have done to the temperature, had it passed
# Of the change that the gap should have brought: less is none; and of its noise
_UNMOVED, _UNMOVED_SIGMAS = 0.1, 5.0
_SLOPE_RATIO = 2.0  # ratio of dT/dt before and after: beyond it the temperature turned within the gap
# Of a run, and rows in each: enough for a median that is sure to a tenth of its scatter
_PARTS, _LEAST_STEPS = 50, 40
_DRIFT, _DRIFT_SIGMAS = 0.005, 5.0  # half a per cent of dT/dt
# Of a row period, and of the rows: a clock of coarser ticks than the rows
_COARSE, _COARSE_SHARE = 0.4, 0.05
_COARSE_ROWS = 2**16  # at the start, which tell it
_EVEN_ROWS, _EVEN, _EVEN_SHARE = 400, 1.25, 0.8  # parts in which even rows stay so near a line, in units
_REPORTED = 20  # that are reported: enough to see a pattern
_HOUR_S = 3600.0  # a change of summer time


def time_findings(run: Run, rows: Rows) -> Iterator[Finding]:
    """Yield what is suspect about the times of a run."""
    inside = run.in_span(rows.time_s)
    time, temperature = masked(rows.time_s, inside), masked(rows.temperature_c, inside)
    at: Sequence[int] = range(len(rows))
    together: BoolArray = np.broadcast_to(np.True_, max(len(rows) - 1, 0))
    if not inside.all():
        rows_inside = np.flatnonzero(inside)
        at = rows_inside.tolist()
        together = np.diff(rows_inside) == 1  # what was excluded is no gap
    if len(together) < _AROUND_ROWS:
        return
    coarse = _coarse(run, np.diff(time[: _COARSE_ROWS + 1])[together[:_COARSE_ROWS]])
    if coarse is not None:
        yield coarse
        return
    gaps, count = missing_rows(time, run.row_period_s)
    gaps, count = gaps[together[gaps]], count[together[gaps]]
    jumps = [k for k in gaps[:1000].tolist() if _clock_was_set(time, temperature, k, run.row_period_s)]
    missing = ~np.isin(gaps, jumps)
    if jumps:
        yield _jumps(run, time, at, jumps)
    if missing.any():
        yield _gaps(run, time, at, gaps[missing], int(count[missing].sum()))
    even = np.array(together)
    even[gaps] = False
    yield from _drift(run, time, at, even)


def _marks(run: Run, time: FloatArray, at: Sequence[int], places: list[int]) -> tuple[Mark, ...]:
    return tuple(
        Mark(run.file, (int(at[k]) + 1, int(at[k + 1]) + 1), (float(time[k]), float(time[k + 1])))
        for k in places[:_REPORTED]
    )


def _gaps(run: Run, time: FloatArray, at: Sequence[int], gaps: NDArray[np.int64], missing: int) -> Finding:
    longest = int(gaps[np.argmax(time[gaps + 1] - time[gaps])])
    places = sorted(gaps.tolist(), key=lambda k: time[k] - time[k + 1])[:_REPORTED]
    text = (
        f"{len(gaps)} gaps; {missing} rows of {run.row_period_s:.4g} s are missing; the longest from "
        f"{time[longest]:.10g} to {time[longest + 1]:.10g} s (rows {at[longest] + 1} and {at[longest + 1] + 1})"
    )
    return finding("gaps", text, run, marks=_marks(run, time, at, places))


def _jumps(run: Run, time: FloatArray, at: Sequence[int], jumps: list[int]) -> Finding:
    by = time[jumps[0] + 1] - time[jumps[0]] - run.row_period_s
    hours = round(by / _HOUR_S)
    whole = abs(by - hours * _HOUR_S) < 2.0 * run.row_period_s and hours
    clock = f", {hours} h: a clock that was set" if whole else ""
    text = (
        f"the time jumps by {by:.10g} s between rows {at[jumps[0]] + 1} and {at[jumps[0] + 1] + 1}, from "
        f"{time[jumps[0]]:.10g} to {time[jumps[0] + 1]:.10g} s{clock}, and the temperature goes on as if one row "
        f"had passed" + (f" ({len(jumps)} such places)" if len(jumps) > 1 else "")
    )
    return finding("time_jumps", text, run, marks=_marks(run, time, at, jumps))


def _clock_was_set(time: FloatArray, temperature: FloatArray, k: int, period_s: float) -> bool:
    """Test whether the temperature, on a ramp before and behind row k, did not move in the time that seems to pass."""
    rows = max(_AROUND_ROWS, min(round(_AROUND_S / period_s), 3000))
    before, after = slice(max(k + 1 - rows, 0), k + 1), slice(k + 1, k + 1 + rows)
    fits = [_line(time[part] - time[k], temperature[part]) for part in (before, after)]
    if fits[0] is None or fits[1] is None:
        return False
    (level, slope, noise), (next_level, next_slope, next_noise) = fits[0], fits[1]
    if slope * next_slope <= 0.0 or not 1.0 / _SLOPE_RATIO < slope / next_slope < _SLOPE_RATIO:
        return False
    gap = float(time[k + 1] - time[k])
    sigma = max(noise, next_noise)
    expected = 0.5 * (slope + next_slope) * gap
    moved = next_level + next_slope * gap - level
    if abs(expected) < max(_LEAST_JUMP_C, _JUMP_SIGMAS * sigma):
        return False
    return abs(moved - slope * period_s) < min(_UNMOVED * abs(expected), _UNMOVED_SIGMAS * sigma + 0.1)


def _line(time: FloatArray, temperature: FloatArray) -> tuple[float, float, float] | None:
    """Level at time 0 (C), slope (C/s) and scatter (C) of a straight line; None for too few rows."""
    if len(time) < _AROUND_ROWS:
        return None
    slope, level = np.polyfit(time, temperature, 1)
    return float(level), float(slope), float(np.std(temperature - level - slope * time))


def _coarse(run: Run, some: FloatArray) -> Finding | None:
    """Stamps whose own resolution is about the row period: rows seem to be missing, or twice as dense, by turns."""
    short = some[some < 5.5 * run.row_period_s]
    kinds = np.unique(np.round(short / run.row_period_s, 3)) * run.row_period_s
    if not 2 <= len(kinds) <= 8:
        return None
    unit = min(float(kinds[0]), float(np.diff(kinds).min()))
    whole = np.abs(kinds / unit - np.round(kinds / unit)).max() < 0.01
    odd = float(np.mean(np.abs(short - run.row_period_s) > 0.25 * run.row_period_s))
    if not whole or unit < _COARSE * run.row_period_s or odd < _COARSE_SHARE or not _regular(some, unit):
        return None
    text = (
        f"time stamps come in steps of {unit:.4g} s, which is about the row period ({short.mean():.4g} s in the "
        f"mean): {odd:.0%} of the rows seem to come early or after missing ones"
    )
    return finding("coarse_time", text, run)


def _regular(step: FloatArray, unit: float) -> bool:
    """Test whether stamps are those of even rows cut to a unit: rows that are really missing leave their line."""
    time = np.cumsum(step)
    size = min(_EVEN_ROWS, len(time))
    parts = time[: len(time) // size * size].reshape(-1, size)
    at = np.arange(size) - 0.5 * (size - 1)
    centred = parts - parts.mean(axis=1, keepdims=True)
    rest = centred - (centred @ at / (at @ at))[:, None] * at
    return float(np.mean(np.abs(rest).max(axis=1) < _EVEN * unit)) > _EVEN_SHARE


def _drift(run: Run, time: FloatArray, at: Sequence[int], even: BoolArray) -> Iterator[Finding]:
    """Rows that come ever faster or slower by the stamps: the clock of the rows or that of the stamps drifts.

    Args:
        even: Between which neighbouring rows none is missing.
    """
    parts = min(_PARTS, len(even) // _LEAST_STEPS)
    if parts < 4:
        return
    size = len(even) // parts

    def steps(part: int) -> FloatArray:
        rows = slice(part * size, (part + 1) * size)
        return np.where(even[rows], np.diff(time[rows.start : rows.stop + 1]), np.nan)

    count = np.count_nonzero(even[: parts * size].reshape(parts, size), axis=1)
    kept = np.flatnonzero(count >= 0.5 * size).tolist()
    if len(kept) < 4:
        return
    mean = np.array([np.nanmean(steps(k)) for k in kept])
    usual = float(np.median(mean))
    squares = sum(float(np.nansum((steps(k) - m) ** 2)) for k, m in zip(kept, mean, strict=True))
    scatter = float(np.sqrt(squares / count[kept].sum()))
    difference = np.abs(mean / usual - 1.0)
    limit = _DRIFT + _DRIFT_SIGMAS * scatter / usual / np.sqrt(count[kept])
    if not (difference > limit).any():
        return
    worst = kept[int(np.argmax(difference - limit))]
    total = float(np.sum(np.abs(mean - usual) * count[kept]))
    every = (usual, float(np.nanmean(steps(worst))))
    yield _drifting(run, time, at, (worst * size, (worst + 1) * size), every, total)


def _drifting(
    run: Run, time: FloatArray, at: Sequence[int], span: tuple[int, int], every: tuple[float, float], total: float
) -> Finding:
    """The finding, of the steps of a span; `every`: s from row to row, usually and there."""
    first, last = span
    text = (
        f"the time stamps drift against the row count: rows come every {every[0]:.6g} s, but every "
        f"{every[1]:.6g} s from row {at[first] + 1} to {at[last] + 1} ({time[first]:.10g} to "
        f"{time[last]:.10g} s); in all stamps and rows part by {total:.4g} s"
    )
    return finding(
        "time_drifts",
        text,
        run,
        marks=(Mark(run.file, (int(at[first]) + 1, int(at[last]) + 1), (float(time[first]), float(time[last]))),),
    )
