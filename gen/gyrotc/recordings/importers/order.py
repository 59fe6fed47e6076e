"""Refuse times that do not go on: what happened at which row, and the option or command that reads the file."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...common.arrays import FloatArray
from ...common.errors import InputError
from ..tables import Chunk, LoggerTable
from .clock import Clock

_HOUR_S = 3600.0
# Clocks are moved for summer time at night.
_NIGHT_ENDS_H = 4
# A late sample is passed again within so many rows; after a restart of the clock the times of before take longer.
_MAX_LATE_ROWS = 100
# Each value of a column that tells sensors apart comes at least so often in a sample of rows.
_MIN_REPEATS = 3


@dataclass(frozen=True, slots=True)
class Times:
    """Times of rows in order.

    Attributes:
        file: Name for messages.
        table: The table of the rows.
        clock: What made the times.
        chunk: The chunk of the rows.
        rows: Numbers of the rows in the chunk.
        time_s: Their times, s.
        before_s: Time of the row before each, s.
    """

    file: str
    table: LoggerTable
    clock: Clock
    chunk: Chunk
    rows: NDArray[np.int64]
    time_s: FloatArray
    before_s: FloatArray

    def place(self, k: int) -> str:
        """Return the place of a row, for messages."""
        return f"{self.file}, {self.table.place(self.chunk.row(int(self.rows[k])))}"

    def text(self, k: int) -> str:
        """The time of a row as the file has it, with the seconds that it became."""
        seconds = f"{self.time_s[k]:.10g} s"
        cells = [_text(self.chunk.columns[name], int(self.rows[k])) for name in self.clock.names]
        return f"{' '.join(cells)} ({seconds})" if cells else seconds


def _text(values: Any, row: int) -> str:
    value = values[row]
    value = value.as_py() if hasattr(value, "as_py") else value
    return f"{value:.15g}" if isinstance(value, float | np.floating) else str(value)


def out_of_order(times: Times, at: int) -> InputError:
    """The refusal of a row whose time is not behind that of the rows before."""
    before = times.text(at - 1) if at else f"{times.before_s[at]:.10g} s"
    if times.time_s[at] == times.before_s[at]:
        found = f"the time of the row before, {times.text(at)}, with other values"
        return InputError(times.place(at), found, "; or ".join(_of_equal_times(times)))
    found = f"time goes back: {times.text(at)} after {before}"
    return InputError(times.place(at), found, _of_falling_times(times, at))


def _of_equal_times(times: Times) -> Iterator[str]:
    """Yield what a user can do if several rows have one time."""
    for column in times.table.columns:
        counts = Counter(cell for cell in column.sample if cell)
        of_sensors = len(counts) > 1 and min(counts.values()) >= _MIN_REPEATS and column.name not in times.clock.names
        if of_sensors and column.kind != "stamp":
            condition = shlex.quote(f"{column.name} == {next(iter(counts))}")
            yield f"--set where={condition} if {column.name} tells sensors apart"
            break
    yield "--set time.leave_out_late=true takes the first row of each time"
    yield "--set time.rate_hz=R counts rows of one sensor that come at a fixed rate"


def _of_falling_times(times: Times, at: int) -> str:
    """Return what a user can do if the time falls at a row."""
    steps = np.diff(times.time_s)
    if np.count_nonzero(steps < 0.0) > 0.5 * len(steps):
        return f"rows from the oldest to the newest: {times.table.turned_round(times.file)}"
    fall = times.before_s[at] - times.time_s[at]
    if times.clock.needs_zone and _about_an_hour(fall, steps):
        return "the zone of the stamps, such as --set time.zone=Europe/Berlin, as when summer time ends"
    behind = times.time_s[at : at + _MAX_LATE_ROWS]
    if at == len(times.time_s) - 1 or np.any(behind > times.before_s[at]):
        return "--set time.leave_out_late=true leaves out rows that come late"
    row = times.chunk.row(int(times.rows[at]))
    return f"a run for each start of the clock: {times.table.cut_in_two(times.file, row)}"


def _about_an_hour(seconds: float, steps: FloatArray) -> bool:
    period = float(np.median(np.abs(steps))) if len(steps) else 0.0
    return period < 0.5 * _HOUR_S and abs(abs(seconds) - _HOUR_S) <= 1.5 * period


def refuse_skipped_hour(times: Times) -> None:
    """Refuse stamps without a zone that skip an hour at night, as when summer time begins.

    Raises:
        InputError: They do.
    """
    zero_ns = times.clock.zero_ns
    steps = times.time_s - times.before_s
    if not times.clock.needs_zone or zero_ns is None or len(steps) < _MIN_REPEATS:
        return
    usual = steps[np.isfinite(steps)]
    for at in np.flatnonzero(np.abs(steps - _HOUR_S) < _HOUR_S).tolist():
        hour = int((zero_ns / 1e9 + times.before_s[at]) % 86_400 // _HOUR_S)
        if hour < _NIGHT_ENDS_H and _about_an_hour(float(steps[at]) - float(np.median(usual)), usual):
            found = f"{steps[at]:.10g} s after the row before: an hour is skipped, as when summer time begins"
            expected = (
                "the zone of the stamps, such as --set time.zone=Europe/Berlin; --set time.zone=UTC if an hour was "
                "really not recorded"
            )
            raise InputError(times.place(at), found, expected)
