"""Rows of a rate that no noise of the gyro makes: spikes and bursts at the native rate, and the rows left out for them.

The level is the running median, over five blocks, of the blocks' medians: a spike, or a burst of up to two blocks, does
not move it, and a lasting step is followed. The scale is that of the rows themselves around that level, and of their
first differences, whichever is larger, so that noise that a filter made slow is not taken for outliers; it follows
noise that stays changed. Rows beyond seven times the scale are left out (Gaussian noise: one in 4e11), so that what one
row can do to a mean is bounded: Hampel's rejection, see Rousseeuw and Croux, J. Am. Stat. Assoc. 88 (1993) 1273.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ..common.arrays import BoolArray, FloatArray
from ..common.metrics import MAD_TO_SIGMA, median_of_parts, middle_of_five
from ..recordings.records import Run
from ..results.training import LeftOutRows, Outliers

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


_SIGMAS = 7.0  # once in 4e11 normal rows: a clean recording loses none
_AROUND = 5  # blocks of a running median
_PART = 2**18  # rows that are looked at together: bounds memory
_GROUP = 200  # rows, at least, of one scale
_GROUP_BLOCKS = 10  # blocks, at least, of one scale: the same where rows are few to a block
_BURST = 0.1  # share of departing rows from which a block is left out whole
_BURST_ROWS = 10  # with fewer rows a block, one spike alone would be a tenth of it
_SLACK = 3.0  # changes of the level from block to block that the bias itself may make
_FEW = 5  # rows a block from which its median means something


def departing_rows(rows: Rows, run: Run, rows_per_block: int) -> NDArray[np.int64]:
    """Rows of a run's file (0 is the first) that are spikes or parts of bursts."""
    counted = run.in_span(rows.time_s) & np.isfinite(rows.rate_dph)
    if counted.all():
        return np.flatnonzero(departing(rows.rate_dph, rows_per_block))
    at = np.flatnonzero(counted)
    return np.asarray(at[departing(rows.rate_dph[at], rows_per_block)])


def departing(rate: FloatArray, rows_per_block: int) -> BoolArray:
    """Which rows of a rate (finite, in order of time, shape (n,)) are spikes or parts of bursts."""
    n = min(rows_per_block, max(len(rate) // (2 * _AROUND), 1))
    whole = len(rate) // n * n
    wild = np.zeros(len(rate), dtype=bool)
    if whole < _AROUND * n or len(rate) < 2 * _AROUND:
        return wild
    level = _running(_medians(lambda a, b: rate[a:b], whole, n))
    slack = _SLACK * _largest_around(np.abs(np.gradient(level)))
    sigma, group = _scale(rate, level, n)

    def limit(rows: NDArray[np.int64]) -> FloatArray:
        return np.asarray(_SIGMAS * _of_rows(sigma, group, rows) + _of_rows(slack, n, rows))

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
    step = n * max(1, _PART // n)
    parts = (values(a, min(a + step, rows)).reshape(-1, n) for a in range(0, rows, step))
    return np.concatenate([np.median(part, axis=1) for part in parts])


def _of_rows(of_blocks: FloatArray, n: int, rows: NDArray[np.int64]) -> FloatArray:
    """The value of each row's block of n; rows behind the last whole block have its value."""
    return np.asarray(of_blocks[np.minimum(rows // n, len(of_blocks) - 1)])


def _running(values: FloatArray) -> FloatArray:
    """Median of each value and its four neighbours; at the ends of those that there are, mirrored."""
    half = _AROUND // 2
    if len(values) <= half:
        return np.full(len(values), np.median(values))
    windows = sliding_window_view(np.pad(values, half, mode="reflect"), _AROUND)
    return middle_of_five(*windows.T)


def _largest_around(values: FloatArray) -> FloatArray:
    """Largest of each value and its four neighbours."""
    windows = sliding_window_view(np.pad(values, _AROUND // 2, mode="edge"), _AROUND)
    return np.asarray(windows.max(axis=1))


def _scale(rate: FloatArray, level: FloatArray, n: int) -> tuple[FloatArray, int]:
    """Standard deviation of a row about the level, for every so many rows; never far below that of the whole."""

    def steps(a: int, b: int) -> FloatArray:
        return np.abs(np.diff(rate[max(a - 1, 0) : b], prepend=rate[:1] if a == 0 else np.zeros(0)))

    def rest(a: int, b: int) -> FloatArray:
        return np.abs(rate[a:b] - _of_rows(level, n, np.arange(a, b)))

    def moved() -> Iterable[FloatArray]:
        parts = (steps(a, min(a + _PART, len(rate))) for a in range(0, len(rate), _PART))
        return (part[part > 0.0] for part in parts)

    group = min(max(_GROUP, _GROUP_BLOCKS * n), len(rate))
    whole = len(rate) // group * group
    if not any(map(len, moved())):
        return np.full(whole // group, np.inf), group
    least = MAD_TO_SIGMA * median_of_parts(moved) / np.sqrt(2.0)
    of_steps = _medians(steps, whole, group) / np.sqrt(2.0)
    sigma = MAD_TO_SIGMA * _running(np.maximum(of_steps, _medians(rest, whole, group)))
    return np.maximum(sigma, 0.5 * least), group


def _beyond_neighbours(rate: FloatArray, at: NDArray[np.int64]) -> FloatArray:
    """How far these rows lie outside the range of the two rows before and the two after, mirrored at the ends."""
    around = np.abs(at[:, None] + np.array([-2, -1, 1, 2]))
    near = rate[np.minimum(around, 2 * (len(rate) - 1) - around)]
    return np.asarray(np.abs(rate[at] - np.clip(rate[at], near.min(axis=1), near.max(axis=1))))
