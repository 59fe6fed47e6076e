"""Rows of a rate that no noise of the gyro makes: spikes and bursts at the native rate, and the rows left out for them.

The level is the running median of the blocks' medians: a spike, or a burst of up to ten rows or two blocks, does not
move it, and a lasting step is followed. The scale is that of the rows themselves around that level, and of their
first differences, whichever is larger, so that noise that a filter made slow is not taken for outliers; it follows
noise that stays changed. Rows beyond seven times the scale are left out (Gaussian noise: one in 4e11), so that what one
row can do to a mean is bounded: Hampel's rejection, see Rousseeuw and Croux, J. Am. Stat. Assoc. 88 (1993) 1273.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter

from ..common.arrays import BoolArray, FloatArray, those
from ..common.metrics import MAD_TO_SIGMA, median_of_parts, middle_of_five, quantile_of_parts
from ..mirror.front_end import samples_per_block
from ..recordings.records import Run
from ..results.base import Finding
from ..results.training import LeftOutRows, Outliers
from .findings import SPIKE_SIGMAS, finding, mark_of

if TYPE_CHECKING:
    from ..recordings.records import Rows

_JOINED = 10  # rows between two that make them one stretch
_LISTED = 200  # stretches; beyond, they are counted only


def stretches_left_out(run: Run, times_s: NDArray[np.float64]) -> list[LeftOutRows]:
    """Stretches of rows that were left out, times on the clock of the run, the end exclusive.

    Args:
        times_s: Times of these rows, increasing.
    """
    if len(times_s) == 0:
        return []
    first = np.flatnonzero(np.diff(times_s, prepend=-np.inf) > _JOINED * run.row_period_s)
    last = np.r_[first[1:], len(times_s)] - 1
    return [
        LeftOutRows(
            file=run.file,
            from_s=float(times_s[a]),
            to_s=round(float(times_s[b] + 0.5 * run.row_period_s), 6),
            rows=int(b - a + 1),
        )
        for a, b in zip(first, last, strict=True)
    ]


def outliers_of(stretches: Sequence[LeftOutRows], kept: float) -> Outliers:
    """`outliers` of `training.json`: number of rows left out, their share of all, where (the first 200 stretches).

    Args:
        kept: Number of rows that training took.
    """
    rows = sum(stretch.rows for stretch in stretches)
    return Outliers(rows=rows, share=rows / (rows + kept), stretches=tuple(stretches[:_LISTED]))


_AROUND = 5  # blocks of a running median, at least
_PART = 2**16  # rows that are looked at together: bounds memory
_GROUP = 200  # rows, at least, of one scale
_GROUP_BLOCKS = 10  # blocks, at least, of one scale: the same where rows are few to a block
_BURST = 0.1  # share of departing rows from which a block is left out whole
_BURST_ROWS = 10  # with fewer rows a block, one spike alone would be a tenth of it
_SLACK = 3.0  # changes of the level from block to block that the bias itself may make
_FEW = 5  # rows a block from which its median means something
_USUAL, _ALIKE = (0.9, 0.01)  # share of steps that are no larger, and of it: nearer rows are at one step of a converter
_TOGETHER = 10  # rows of a burst that do not move the level; a longer departure is a piece of record


def spike_findings(run: Run, rows: Rows, wild: NDArray[np.int64]) -> Iterator[Finding]:
    """Spikes and bursts of a run (`departing_rows`): how many, where, and the largest."""
    if len(wild) == 0:
        return
    stretches = stretches_left_out(run, rows.time_s[wild])
    rate = rows.rate_dph[wild]
    departure = np.nan_to_num(np.abs(rate - _beside(rows.rate_dph, wild)))
    k = int(np.argmax(departure))
    at, size = float(rows.time_s[wild[k]]), float(departure[k])
    spans = [(s.from_s, s.to_s) for s in stretches]
    # A burst is also in rows that chance leaves within the limit: so many before the first, but for one in twenty
    share = len(wild) * run.row_period_s / sum(end - start for start, end in spans)
    hidden = float(np.ceil(np.log(0.05) / np.log1p(-share))) if share < 1.0 else 0.0
    text = (
        f"{len(wild)} rows of {run.file} depart from those around them, most at {at:.10g} s: by {size:.4g} deg/h, "
        f"where {SPIKE_SIGMAS:g} times their noise is the limit ({len(spans)} stretches). They do not reach the fit."
    )
    yield finding(
        "rate_outliers",
        text,
        run,
        marks=[mark_of(run.file, rows, *span) for span in spans],
        # A row may be a mean over the time before it
        time_s=(at, spans[0][0] - (1.0 + hidden) * run.row_period_s, spans[-1][1]),
        size=((size, size, size), "deg/h"),
        leave_out=spans,
        stretches=len(spans),
        rows=len(wild),
        rate_dph=float(rate[k]),
    )


def _beside(rate: FloatArray, wild: NDArray[np.int64]) -> FloatArray:
    """The mean of the nearest rows on both sides of each spike that are none; at an end of one side."""
    first = np.flatnonzero(np.diff(wild, prepend=-2) > 1)
    count = np.diff(np.r_[first, len(wild)])
    before, after = wild[first] - 1, wild[first + count - 1] + 1
    before, after = np.where(before < 0, after, before), np.where(after >= len(rate), before, after)
    return np.repeat(0.5 * (rate[before] + rate[after]), count)


BLOCK_S = 10.0  # around a row, where no model says how long its blocks are


def departing_rows(rows: Rows, run: Run, rows_per_block: int | None = None) -> NDArray[np.int64]:
    """Rows of a run's file (0 is the first) that are spikes or parts of bursts."""
    rows_per_block = rows_per_block or samples_per_block(BLOCK_S, run.row_period_s)
    counted = run.in_span(rows.time_s) & np.isfinite(rows.rate_dph)
    wild = np.flatnonzero(departing(those(rows.rate_dph, counted), rows_per_block))
    return wild if counted.all() else np.flatnonzero(counted)[wild]


def departing(rate: FloatArray, rows_per_block: int) -> BoolArray:
    """Which rows of a rate (finite, in order of time, shape (n,)) are spikes or parts of bursts."""
    n = min(rows_per_block, max(len(rate) // (2 * _AROUND), 1))
    whole = len(rate) // n * n
    wild = np.zeros(len(rate), dtype=bool)
    if whole < _AROUND * n or len(rate) < 2 * _AROUND:
        return wild
    around = max(_AROUND, 2 * -(-_TOGETHER // n) + 1)
    level = _running(_medians(lambda a, b: rate[a:b], whole, n), around)
    slack = _SLACK * np.asarray(maximum_filter1d(np.abs(np.gradient(level)), around, mode="nearest"))
    sigma, group = _scale(rate, level, n)

    def limit(rows: NDArray[np.int64]) -> FloatArray:
        return np.asarray(SPIKE_SIGMAS * _of_rows(sigma, group, rows) + _of_rows(slack, n, rows))

    for a in range(0, len(rate), _PART):
        part = rate[a : a + _PART]
        rows = np.arange(a, a + len(part))
        wild[a : a + len(part)] = np.abs(part - _of_rows(level, n, rows)) > limit(rows)
    at = np.flatnonzero(wild)
    # With few rows to a block, and where only one side shows the level: the start of a warm-up is no burst
    alone = at if n < _FEW else at[(at < 2 * n) | (at >= len(rate) - 2 * n)]
    wild[alone] = _beyond_neighbours(rate, alone) > limit(alone)
    if n < _BURST_ROWS or len(at) == 0:
        return wild
    bursts = np.flatnonzero(wild[:whole].reshape(-1, n).mean(axis=1) > _BURST)
    for k in bursts.tolist():
        wild[k * n : len(rate) if (k + 1) * n == whole else (k + 1) * n] = True
    return wild


def _medians(values: Callable[[int, int], FloatArray], rows: int, n: int) -> FloatArray:
    """Medians of every n of so many rows, whose values from a row to another are given."""
    if n == 1:
        return values(0, rows)
    step = n * max(1, _PART // n)
    parts = (values(a, min(a + step, rows)).reshape(-1, n) for a in range(0, rows, step))
    return np.concatenate([_middles(part) for part in parts])


def _middles(rows: FloatArray) -> FloatArray:
    """Medians of rows of finite numbers, shape (n, m): those of `np.median`, whose checks cost more than it."""
    low, high = (rows.shape[1] - 1) // 2, rows.shape[1] // 2
    ordered = np.partition(rows, (low, high), axis=1)
    return np.asarray((ordered[:, low] + ordered[:, high]) / 2)


def _of_rows(of_blocks: FloatArray, n: int, rows: NDArray[np.int64]) -> FloatArray:
    """The value of each row's block of n; rows behind the last whole block have its value."""
    return np.asarray(of_blocks[np.minimum(rows // n, len(of_blocks) - 1)])


def _running(values: FloatArray, around: int = _AROUND) -> FloatArray:
    """Median of each value and those around it; at the ends of those that there are, mirrored."""
    if len(values) <= around // 2:
        return np.full(len(values), np.median(values))
    if around > _AROUND:
        return np.asarray(median_filter(values, around, mode="mirror"))
    windows = sliding_window_view(np.pad(values, around // 2, mode="reflect"), around)
    return middle_of_five(*windows.T)


def _scale(rate: FloatArray, level: FloatArray, n: int) -> tuple[FloatArray, int]:
    """Standard deviation of a row about the level, for every so many rows; never far below that of the whole."""

    def steps(a: int, b: int) -> FloatArray:
        return np.abs(np.diff(rate[max(a - 1, 0) : b], prepend=rate[:1] if a == 0 else np.zeros(0)))

    def rest(a: int, b: int) -> FloatArray:
        return np.abs(rate[a:b] - _of_rows(level, n, np.arange(a, b)))

    def all_steps() -> Iterable[FloatArray]:
        return (steps(a, min(a + _PART, len(rate))) for a in range(0, len(rate), _PART))

    alike = _ALIKE * quantile_of_parts(all_steps, _USUAL)

    def moved() -> Iterable[FloatArray]:
        return (part[part > alike] for part in all_steps())

    group = min(max(_GROUP, _GROUP_BLOCKS * n), len(rate))
    whole = len(rate) // group * group
    if not any(map(len, moved())):
        return np.full(whole // group, np.inf), group
    least = MAD_TO_SIGMA * median_of_parts(moved) / np.sqrt(2.0)
    of_steps = _medians(steps, whole, group) / np.sqrt(2.0)
    sigma = MAD_TO_SIGMA * _running(np.maximum(of_steps, _medians(rest, whole, group)))
    return np.maximum(sigma, 0.5 * least), group


def _beyond_neighbours(rate: FloatArray, at: NDArray[np.int64]) -> FloatArray:
    """How far these rows lie outside the range of the two rows before and the two after their stretch.

    At the ends every row stands for itself, and the record is mirrored: the start of a warm-up is no burst.
    """
    starts = np.flatnonzero(np.diff(at, prepend=-2) > 1)
    count = np.diff(np.r_[starts, len(at)])
    first, last = (np.repeat(at[k], count) for k in (starts, starts + count - 1))
    end = (first < 2) | (last > len(rate) - 3)
    first, last = np.where(end, at, first), np.where(end, at, last)
    around = np.abs(np.stack([first - 2, first - 1, last + 1, last + 2], axis=1))
    near = rate[np.minimum(around, 2 * (len(rate) - 1) - around)]
    return np.asarray(np.abs(rate[at] - np.clip(rate[at], near.min(axis=1), near.max(axis=1))))
