"""From a data set to the records that diagnosis works on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..causes.base import History
from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..recordings.records import Dataset, Rows, Run
from .blocks import Record, Records

__all__ = ["block_length", "records_of"]


_ROW_S = 5.0  # finer rows are averaged first
_MIN_BLOCKS = 1000  # below this number of blocks they are made shorter than the averaging asks for
_MAX_BLOCKS = 5000  # above it longer


def records_of(dataset: Dataset, role: str, *, block_s: float, average_s: float) -> Records:
    """Records of all runs of one role.

    Blocks are `average_s` long, shorter down to `block_s` where the recordings are short.

    Raises:
        InputError: There is no such run, or nothing usable in them.
    """
    runs = [run for run in dataset.runs if run.role == role]
    if not runs:
        raise InputError(str(dataset.folder), f"no run has the role {role}", "at least one run with it")
    first = min((run.started for run in runs if run.started is not None), default=None)
    found = []
    for k, run in enumerate(runs):
        day = None
        if run.started is not None and first is not None:
            day = (run.started - first).total_seconds() / 86400.0
        found.append(_record(run, dataset.channels, k, len(runs), day, block_s))
    if sum(int(r.usable.sum()) for r in found) == 0:
        raise InputError(str(dataset.folder), "no usable row", "rows with a temperature and a rate")
    return Records(tuple(found), block_length(found, block_s, average_s))


def block_length(runs: Sequence[Record], block_s: float, average_s: float) -> float:
    """Length of a block, s."""
    row = max(run.row_s for run in runs)
    total = sum(float(r.usable.sum()) * r.row_s for r in runs)
    wanted = float(np.clip(average_s, total / _MAX_BLOCKS, max(total / _MIN_BLOCKS, block_s)))
    return max(round(wanted / row), 1) * row


def _record(
    run: Run, channels: Sequence[str], number: int, count: int, day: float | None, block_s: float
) -> Record:
    rows = run.rows()
    usable = run.in_span(rows.time_s) & np.isfinite(rows.rate_dph) & np.isfinite(rows.temperature_c)
    for name in channels:
        usable &= np.isfinite(rows.channels[name])
    group = max(round(min(block_s, 10.0) / run.row_period_s), 1) if run.row_period_s < _ROW_S else 1
    if group > 1:
        rows, usable = _thinned(rows, usable, group)
    temperature = _bridged(rows.time_s, rows.temperature_c)
    on = None if run.power_on_s is None else rows.time_s - run.power_on_s
    history = History(time_s=rows.time_s, temperature_c=temperature, on_s=on, run=number, runs=count, day=day)
    values = {name: _bridged(rows.time_s, rows.channels[name]) for name in channels}
    name = run.file if run.from_s is None else f"{run.file}@{run.from_s:g}"
    return Record(name, history, np.where(usable, rows.rate_dph, 0.0), usable, run.environment, values)


def _thinned(rows: Rows, usable: NDArray[np.bool_], group: int) -> tuple[Rows, NDArray[np.bool_]]:
    """Means over `group` rows; a mean counts when half of its rows do."""
    n = len(rows.time_s) // group * group
    use = usable[:n].reshape(-1, group)
    count = np.maximum(use.sum(axis=1), 1)

    def mean(values: FloatArray) -> FloatArray:
        part = values[:n].reshape(-1, group)
        return np.asarray(np.where(use, np.nan_to_num(part), 0.0).sum(axis=1) / count)

    time = rows.time_s[:n].reshape(-1, group).mean(axis=1)
    filled = Rows(
        time,
        np.nanmean(
            np.where(np.isfinite(rows.temperature_c[:n]), rows.temperature_c[:n], np.nan).reshape(-1, group),
            axis=1,
        ),
        mean(rows.rate_dph),
        {k: mean(v) for k, v in rows.channels.items()},
    )
    return filled, 2 * use.sum(axis=1) >= group


def _bridged(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Straight lines over missing values: operators need some history; the rows themselves do not count."""
    good = np.isfinite(values)
    if good.all():
        return values
    if not good.any():
        return np.zeros_like(values)
    return np.interp(time_s, time_s[good], values[good])
