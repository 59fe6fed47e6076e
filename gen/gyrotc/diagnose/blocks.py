"""Recordings as diagnosis sees them: native rows for the operators, means over blocks for the statistics.

Every feature is computed on the rows and averaged afterwards; nothing is filtered after averaging.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..causes.base import History
from ..common.arrays import PART, BoolArray, FloatArray, parts_of
from ..common.errors import InputError
from ..common.inputs import need_memory
from ..quality.judgement import Judged, judge
from ..recordings.records import Dataset, Rows, Run

_BLOCK_BYTES = 8 * 64  # of the features of a block that are averaged together
_SLOPE_SPAN_S = 200.0  # window of dT/dt, centred: no delay that a lag could stand for


@dataclass(frozen=True, slots=True)
class RunRecord:
    """One run.

    Attributes:
        name: Name of the run in messages and tables.
        history: The whole record at its native rate.
        rate_dph: Measured rate less the mean of all runs, deg/h, shape (n,); 0 where it does not count.
        usable: Rows that may be used, shape (n,).
        read: Rows of the file that belong to the run.
        outliers: Rows of each stretch of them whose rates were left out as outliers.
        environment: Environment as the data set names it.
        channels: Auxiliary channels by name, shape (n,) each.
        file: Name of the file of the run.
    """

    name: str
    history: History
    rate_dph: FloatArray
    usable: NDArray[np.bool_]
    environment: str = ""
    read: int = 0
    outliers: tuple[int, ...] = ()
    channels: Mapping[str, FloatArray] = field(default_factory=dict)
    file: str = ""

    @property
    def row_s(self) -> float:
        """Median row period, s."""
        return float(np.median(np.diff(self.history.time_s)))


@dataclass(frozen=True)
class Records:
    """All training runs, and the blocks over which they are averaged.

    Attributes:
        runs: The runs.
        block_s: Length of a block, s.
        index: Per run, the block of every row, shape (n,).
        kept: Per run, numbers of the blocks that are used, ascending; a block is used when at least half
            of its rows are usable.
    """

    runs: tuple[RunRecord, ...]
    block_s: float
    index: tuple[NDArray[np.int64], ...] = field(init=False)
    kept: tuple[NDArray[np.int64], ...] = field(init=False)

    def __post_init__(self) -> None:
        index, kept = [], []
        for run in self.runs:
            time = run.history.time_s
            number = np.floor((time - time[0]) / self.block_s + 1e-6).astype(np.int64)
            need_memory(_BLOCK_BYTES * float(number[-1]), run.name, f"its blocks of {self.block_s:g} s")
            nominal = max(round(self.block_s / run.row_s), 1)
            count = np.bincount(number, weights=run.usable)
            index.append(number)
            kept.append(np.flatnonzero(2 * count >= nominal))
        object.__setattr__(self, "index", tuple(index))
        object.__setattr__(self, "kept", tuple(kept))

    @property
    def size(self) -> int:
        """Number of blocks in all."""
        return sum(k.size for k in self.kept)

    def spans(self) -> list[slice]:
        """Slices of each run's blocks in the joined arrays."""
        ends = np.cumsum([k.size for k in self.kept])
        return [slice(int(e - k.size), int(e)) for e, k in zip(ends, self.kept, strict=True)]

    def average_run(self, number: int, rows: FloatArray, weight: NDArray[np.bool_] | None = None) -> FloatArray:
        """Block means of one run's rows, shape (n,) or (n, k); `weight` leaves rows out (default: `usable`)."""
        use = self.runs[number].usable if weight is None else weight
        index, kept = self.index[number], self.kept[number]
        starts = np.flatnonzero(np.diff(index, prepend=-1))
        table = rows.reshape(len(rows), -1) * use[:, None]
        sums = np.zeros((int(index[-1]) + 1, table.shape[1]))
        sums[index[starts]] = np.add.reduceat(table, starts, axis=0)
        count = np.bincount(index, weights=use)
        means = sums[kept] / np.maximum(count[kept], 1.0)[:, None]
        return means[:, 0] if rows.ndim == 1 else means

    def average(self, rows: Sequence[FloatArray]) -> FloatArray:
        """Block means of all runs, joined: shape (N,) or (N, k)."""
        return np.concatenate([self.average_run(k, r) for k, r in enumerate(rows)])

    def columns(self, feature: Callable[[History], FloatArray]) -> FloatArray:
        """A feature of the histories as joined block means, shape (N, k)."""
        return self.average([feature(run.history) for run in self.runs])

    def target(self) -> FloatArray:
        """Return the block means of the measured rate, deg/h, shape (N,)."""
        return self.average([np.where(run.usable, run.rate_dph, 0.0) for run in self.runs])

    def without_rows(self, masks: Sequence[NDArray[np.bool_]]) -> Records:
        """Return the runs with `usable` replaced and the same blocks; runs of which too little is left drop out."""
        tried = Records(tuple(replace(r, usable=m) for r, m in zip(self.runs, masks, strict=True)), self.block_s)
        return Records(tried.long_enough(), self.block_s)

    def long_enough(self) -> tuple[RunRecord, ...]:
        """The runs that have two blocks at least, numbered anew: of fewer a run shows no course of time."""
        left = [r for r, kept in zip(self.runs, self.kept, strict=True) if kept.size > 1]
        return tuple(replace(r, history=replace(r.history, run=k, runs=len(left))) for k, r in enumerate(left))


def singled_out(where: NDArray[np.bool_]) -> FloatArray:
    """One column for every block that is marked, 1 there and 0 elsewhere, shape (N, marked)."""
    at = np.flatnonzero(where)
    out = np.zeros((where.size, at.size))
    out[at, np.arange(at.size)] = 1.0
    return out


def centred_slope(history: History, span_s: float = _SLOPE_SPAN_S) -> FloatArray:
    """dT/dt in C/min at every row: least-squares slope over a span (at least ±2 rows), one-sided at the ends."""
    time, value = history.time_s, history.temperature_c
    half = max(span_s / 2, 2.0 * float(np.median(np.diff(time))))
    low = np.searchsorted(time, time - half - 1e-9)
    high = np.searchsorted(time, time + half + 1e-9)
    t = time - time[0]
    x = value - value.mean()
    sums = [np.concatenate(([0.0], np.cumsum(v))) for v in (np.ones_like(t), t, x, t * t, t * x)]
    n, st, sx, stt, stx = (s[high] - s[low] for s in sums)
    spread = n * stt - st * st
    slope = (n * stx - st * sx) / np.where(spread > 0.0, spread, 1.0)
    return np.asarray(60.0 * slope)


_ROW_S = 5.0  # finer rows are averaged first
_MIN_BLOCKS = 1000  # below this number of blocks they are made shorter than the averaging asks for
_MAX_BLOCKS = 5000  # above it longer


def records_of(
    dataset: Dataset, role: str, *, block_s: float, average_s: float, judged: Judged | None = None
) -> Records:
    """Return the records of all runs of one role.

    The mean rate is taken off: the static map leaves out weak directions, and with them a trace of any constant, which
    beside a large one (Earth's rate) would look like an effect.

    Blocks are `average_s` long, shorter down to `block_s` where the recordings are short. Runs without two blocks are
    left out.

    Args:
        judged: Judgement of the rows of the runs; None: they are judged here.

    Raises:
        InputError: There is no such run, or nothing usable in them.
    """
    judged = judged or judge(dataset)
    runs = [run for run in dataset.runs if run.role == role]
    if not runs:
        raise InputError(str(dataset.folder), f"no run has the role {role}", "at least one run with it")
    first = min((run.started for run in runs if run.started is not None), default=None)
    found = []
    for k, run in enumerate(runs):
        day = None
        if run.started is not None and first is not None:
            day = (run.started - first).total_seconds() / 86400.0
        found.append(_record(run, judged, dataset.channels, k, len(runs), day, block_s))
    if not any(r.usable.any() for r in found):
        raise InputError(str(dataset.folder), "no usable row", "rows with a temperature and a rate")
    records = _in_blocks(tuple(r for r in found if len(r.usable) > 1), block_s, average_s)
    count = sum(int(r.usable.sum()) for r in records.runs)
    mean_dph = sum(float(r.rate_dph.sum()) for r in records.runs) / max(count, 1)
    centred = [replace(r, rate_dph=np.where(r.usable, r.rate_dph - mean_dph, 0.0)) for r in records.runs]
    return Records(tuple(centred), records.block_s)


def _in_blocks(runs: tuple[RunRecord, ...], block_s: float, average_s: float) -> Records:
    """The runs that are long enough for blocks of a length that is chosen for them alone."""
    records = Records(runs, block_length(runs, block_s, average_s) if runs else block_s)
    left = records.long_enough()
    return records if len(left) == len(runs) else _in_blocks(left, block_s, average_s)


def block_length(runs: Sequence[RunRecord], block_s: float, average_s: float) -> float:
    """Length of a block, s."""
    row = max(run.row_s for run in runs)
    total = sum(float(r.usable.sum()) * r.row_s for r in runs)
    wanted = float(np.clip(average_s, total / _MAX_BLOCKS, max(total / _MIN_BLOCKS, block_s)))
    return max(round(wanted / row), 1) * row


def _record(
    run: Run, judged: Judged, channels: Sequence[str], number: int, count: int, day: float | None, block_s: float
) -> RunRecord:
    rows = run.rows()
    usable = judged.usable(run, rows) & np.isfinite(rows.temperature_c)
    for name in channels:
        usable &= np.isfinite(rows.channels[name])
    inside = run.in_span(rows.time_s)
    found = (e.rows for e in judged.of(run).events if (e.kind, e.column) == ("outlier", "rate"))
    outliers = tuple(end - first for first, end in found if inside[first])
    read = int(np.count_nonzero(inside))
    group = max(round(min(block_s, 10.0) / run.row_period_s), 1) if run.row_period_s < _ROW_S else 1
    if group > 1:
        rows, usable = grouped_rows(rows, usable, group)
    temperature = without_gaps(rows.time_s, rows.temperature_c)
    on = None if run.power_on_s is None else rows.time_s - run.power_on_s
    history = History(time_s=rows.time_s, temperature_c=temperature, on_s=on, run=number, runs=count, day=day)
    values = {name: without_gaps(rows.time_s, rows.channels[name]) for name in channels}
    rate = np.where(usable, rows.rate_dph, 0.0)
    return RunRecord(name_of(run), history, rate, usable, run.environment, read, outliers, values, run.file)


def name_of(run: Run) -> str:
    """Name of a run in messages and tables."""
    return run.file if run.from_s is None else f"{run.file}@{run.from_s:g}"


def grouped_rows(rows: Rows, usable: NDArray[np.bool_], group: int) -> tuple[Rows, NDArray[np.bool_]]:
    """Return means over `group` rows; a mean counts if half of its rows do."""
    n = len(rows.time_s) // group * group
    use = usable[:n].reshape(-1, group)
    count = np.maximum(use.sum(axis=1), 1)
    parts = list(parts_of(n // group, max(1, PART // group)))

    def thinned(values: FloatArray, mean: Callable[[FloatArray, BoolArray], FloatArray]) -> FloatArray:
        groups = values[:n].reshape(-1, group)
        return np.concatenate([mean(groups[part], use[part]) for part in parts])

    def of_used(values: FloatArray) -> FloatArray:
        sums = thinned(values, lambda x, used: np.where(used, np.nan_to_num(x), 0.0).sum(axis=1))
        return np.asarray(sums / count)

    filled = Rows(
        thinned(rows.time_s, lambda x, _: x.mean(axis=1)),
        thinned(rows.temperature_c, lambda x, _: np.nanmean(np.where(np.isfinite(x), x, np.nan), axis=1)),
        of_used(rows.rate_dph),
        {k: of_used(v) for k, v in rows.channels.items()},
    )
    return filled, 2 * use.sum(axis=1) >= group


def without_gaps(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Straight lines over missing values: operators need some history; the rows themselves do not count."""
    good = np.isfinite(values)
    if good.all():
        return values
    if not good.any():
        return np.zeros_like(values)
    return np.interp(time_s, time_s[good], values[good])
