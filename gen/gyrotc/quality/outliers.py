"""Rows of a rate that no noise of the gyro makes: spikes and bursts at the native rate, and the rows left out for them.

The level is the running median, over five blocks, of the blocks' medians: a spike, or a burst of up to two blocks, does
not move it, and a lasting step is followed. The scale is that of the rows themselves around that level, and of their
first differences, whichever is larger, so that noise that a filter made slow is not taken for outliers; it follows
noise that stays changed. Rows beyond seven times the scale are left out (Gaussian noise: one in 4e11), so that what one
row can do to a mean is bounded: Hampel's rejection, see Rousseeuw and Croux, J. Am. Stat. Assoc. 88 (1993) 1273.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ..common.arrays import BoolArray, FloatArray
from ..common.metrics import MAD_TO_SIGMA, median, middle_of_five
from ..recordings.records import Run
from ..results.training import LeftOutRows, Outliers

if TYPE_CHECKING:
    from ..recordings.records import Rows

__all__ = ["departing", "departing_rows", "outliers_of", "stretches_left_out"]

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


T = TypeVar("T", bound=np.generic)

_SIGMAS = 7.0  # once in 4e11 normal rows: a clean recording loses none
_AROUND = 5  # blocks of a running median
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
    if whole < _AROUND * n or len(rate) < 2 * _AROUND:
        return np.zeros(len(rate), dtype=bool)
    blocks = rate[:whole].reshape(-1, n)
    level = _running(np.median(blocks, axis=1))
    slack = _SLACK * _largest_around(np.abs(np.gradient(level)))
    rest = np.abs(rate - _spread(level, n, len(rate)))
    limit = _SIGMAS * _scale(rate, rest, n) + _spread(slack, n, len(rate))
    wild = rest > limit
    if not wild.any():
        return np.asarray(wild)
    alone = _beyond_neighbours(rate) > limit
    if n < _FEW:
        return np.asarray(wild & alone)
    ends = 2 * n  # a level that only one side shows: the start of a warm-up is no burst
    wild[:ends] &= alone[:ends]
    wild[-ends:] &= alone[-ends:]
    share = wild[:whole].reshape(-1, n).mean(axis=1)
    return np.asarray(wild | _spread((share > _BURST) & (n >= _BURST_ROWS), n, len(rate)))


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


def _spread(of_blocks: NDArray[T], n: int, rows: int) -> NDArray[T]:
    """A value for each block as one for each row; rows behind the last whole block have its value."""
    each = np.repeat(of_blocks, n)
    return np.concatenate([each, np.repeat(of_blocks[-1:], rows - len(each))]) if rows > len(each) else each


def _scale(rate: FloatArray, rest: FloatArray, n: int) -> FloatArray:
    """Standard deviation of a row about the level, for each row; robust, and never far below that of the whole."""
    step = np.abs(np.diff(rate, prepend=rate[:1]))
    moved = step[step > 0.0]
    if len(moved) == 0:
        return np.full(len(rate), np.inf)
    least = MAD_TO_SIGMA * median(moved) / np.sqrt(2.0)
    group = min(max(_GROUP, _GROUP_BLOCKS * n), len(rate))
    whole = len(rate) // group * group
    of_steps = np.median(step[:whole].reshape(-1, group), axis=1) / np.sqrt(2.0)
    of_rest = np.median(rest[:whole].reshape(-1, group), axis=1)
    sigma = np.maximum(MAD_TO_SIGMA * _running(np.maximum(of_steps, of_rest)), 0.5 * least)
    return np.asarray(_spread(sigma, group, len(rate)), dtype=np.float64)


def _beyond_neighbours(rate: FloatArray) -> FloatArray:
    """How far each row lies outside the range of the two rows before and the two after."""
    padded = np.pad(rate, 2, mode="reflect")
    around = np.delete(sliding_window_view(padded, 5), 2, axis=1)
    return np.asarray(np.abs(rate - np.clip(rate, around.min(axis=1), around.max(axis=1))))
