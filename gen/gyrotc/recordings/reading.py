"""One file of a recording: its columns understood, its numbers checked, read again as often as needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.metrics import median_step
from .csv_file import CsvFile
from .description import MIN_ROWS, Columns, Fault, Layout, Problems, arrange, column_faults, rate_faults
from .devices import MAX_DEVICES, names_device
from .fingerprints import Fingerprints, fingerprints_of
from .parquet import ParquetFile
from .records import NO_CHANNEL, NO_TEMPERATURE, NO_TEMPERATURE_THEN, Applied, EarthRate, Mark, Rows
from .sources import Source
from .units import Conversion, declared

_PART = 2**16  # rows that are looked at together
_MOST_CELLS = 2**12  # even, so that cells can be merged in pairs


class Evidence:
    """Means of time (s), temperature (C) and rates (deg/h) over cells of equally many rows; ranges; number of rows.

    Rows are added a block at a time. Where cells become too many, two become one: memory does not grow.

    Args:
        rates: Number of rates.
    """

    def __init__(self, rates: int) -> None:
        self.rows = 0
        self.temperature_c = (np.inf, -np.inf)
        self.same = 0
        self._rows_per_cell = 1
        self._cells = np.empty((_MOST_CELLS, 2 + rates))
        self._count = 0
        self._rest = np.empty((0, 2 + rates))

    def add(self, time_s: FloatArray, temperature_c: FloatArray, rates_dph: list[FloatArray]) -> None:
        """Add rows; those without a finite value in every column are left out."""
        for start in range(0, len(time_s), _PART):
            part = slice(start, start + _PART)
            self._add(np.column_stack([time_s[part], temperature_c[part], *(rate[part] for rate in rates_dph)]))

    def _add(self, block: FloatArray) -> None:
        whole = np.isfinite(block).all(axis=1)
        block = block if whole.all() else block[whole]
        if len(block) == 0:
            return
        low, high = self.temperature_c
        self.temperature_c = min(low, float(block[:, 1].min())), max(high, float(block[:, 1].max()))
        self.same += int(np.count_nonzero(block[1:, 2:] == block[:-1, 2:]))
        self.rows += len(block)
        block = np.concatenate([self._rest, block])
        while len(block) >= self._rows_per_cell:
            block = self._filled(block)
        self._rest = block

    @property
    def cells(self) -> FloatArray:
        """Means of the cells, shape (n, 2 + rates): time, temperature, rates."""
        return self._cells[: self._count]

    @property
    def stuck(self) -> bool:
        """True if most rates repeat the one before, so that their scatter is that of the resolution."""
        return 2 * self.same > self.rows * (self._cells.shape[1] - 2)

    def _filled(self, block: FloatArray) -> FloatArray:
        """Take as many rows as there is room for, and return the rest."""
        per = self._rows_per_cell
        n = min(len(block) // per, _MOST_CELLS - self._count)
        means = block[: n * per].reshape(n, per, -1).mean(axis=1)
        self._cells[self._count : self._count + n] = means
        self._count += n
        if self._count == _MOST_CELLS:
            self._cells[: _MOST_CELLS // 2] = self._cells.reshape(_MOST_CELLS // 2, 2, -1).mean(axis=1)
            self._count //= 2
            self._rows_per_cell *= 2
        return block[n * per :]


_LONGEST_GAP = 10.0  # row periods across which a temperature is interpolated
_SHORTEST_S = 1e-5  # no gyro is recorded faster; a time scale taken wrong makes blocks of 10^12 rows


@dataclass(frozen=True, slots=True)
class Recording:
    """A file whose numbers are in order.

    Attributes:
        file: The file.
        layout: Its columns.
        units: Conversions to gyrotc's units, by column.
        evidence: What its units can be judged by.
        fingerprints: What its rows can be known again by.
        equal_axes: Pairs of axes that hold the same values.
        devices: Values of the columns that name the gyro, by column.
        time_s: Its times, s.
        n_rows: Number of its rows.
        row_period_s: Median row period, s.
    """

    file: Source
    layout: Layout
    units: dict[str, Conversion]
    evidence: Evidence
    fingerprints: Fingerprints
    equal_axes: tuple[tuple[str, str], ...]
    devices: dict[str, tuple[float, ...]]
    time_s: FloatArray
    n_rows: int
    row_period_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Reader:
    """Reads the rows of one axis of a file.

    Attributes:
        units: Conversions to gyrotc's units, by column.
        pulse_weight_arcsec: Angle of one pulse, arcsec; used where pulses were counted.
        earth: Earth's rate to take off.
        applied: Correction to add back.
        temperature_late_s: How much later than the rate the temperature was recorded, s.
    """

    file: Source
    layout: Layout
    units: dict[str, Conversion]
    axis: str | None
    channels: tuple[str, ...]
    pulse_weight_arcsec: float | None
    earth: EarthRate | None
    applied: Applied | None
    row_period_s: float
    temperature_late_s: float = 0.0

    def __call__(self) -> Rows:
        """All rows.

        Raises:
            InputError: The file has been changed since it was checked.
        """
        layout = self.layout
        value = layout.value_of(self.axis)
        self.file.check_unchanged()
        columns = self.file.columns((layout.time, layout.temperature, value, *self.channels))
        if columns is None:
            columns, _, _ = self.file.scan()
        columns = _converted(columns, self.units)
        if layout.pulses:
            weight = self.pulse_weight_arcsec or 1.0
            columns |= {value: rate_of_pulses(columns[layout.time], columns[value], weight)}
        absent_s = unknown_times(columns, layout, self.channels)
        columns = known_rows(columns, layout, self.channels)
        time, rate = columns[layout.time], columns[value]
        if self.earth is not None:
            rate = rate - self.earth.rate_dph
        channels = {name: columns[name] for name in self.channels}
        rows = Rows(time, columns[layout.temperature], rate, channels, absent_s)
        if self.applied is not None:
            rows = replace(rows, rate_dph=rate + self.applied.correction_dph(rows, self.row_period_s))
        return in_time(rows, self.temperature_late_s, self.row_period_s) if self.temperature_late_s else rows


def in_time(rows: Rows, late_s: float, row_period_s: float) -> Rows:
    """The rows with the temperature that was recorded `late_s` later; without those for which there is none."""
    then = rows.time_s + late_s
    after = np.searchsorted(rows.time_s, then).clip(1, len(rows.time_s) - 1)
    known = (then >= rows.time_s[0]) & (then <= rows.time_s[-1])
    known &= np.diff(rows.time_s)[after - 1] <= _LONGEST_GAP * row_period_s
    temperature = np.interp(then, rows.time_s, rows.temperature_c)
    channels = {name: values[known] for name, values in rows.channels.items()}
    absent_s = {**rows.absent_s, NO_TEMPERATURE_THEN: rows.time_s[~known]}
    return Rows(rows.time_s[known], temperature[known], rows.rate_dph[known], channels, absent_s)


def unknown_times(columns: Mapping[str, FloatArray], layout: Layout, channels: Sequence[str]) -> dict[str, FloatArray]:
    """Return the times of the rows that `known_rows` leaves out, by the reason."""
    unknown = {}
    no_temperature = _missing(columns[layout.temperature])
    if no_temperature is not None:
        unknown[NO_TEMPERATURE] = columns[layout.time][no_temperature]
    for name in channels:
        missing = _missing(columns[name])
        if missing is not None:
            only = missing if no_temperature is None else missing & ~no_temperature
            unknown[NO_CHANNEL] = np.union1d(unknown.get(NO_CHANNEL, np.zeros(0)), columns[layout.time][only])
    return unknown


def _missing(values: FloatArray) -> NDArray[np.bool_] | None:
    """Return a mask of the values that are NaN; None if none is."""
    with np.errstate(over="ignore", invalid="ignore"):  # a sum beyond float64 is no NaN among the values
        return np.isnan(values) if np.isnan(np.sum(values)) else None


def known_rows(columns: dict[str, FloatArray], layout: Layout, channels: Sequence[str]) -> dict[str, FloatArray]:
    """Return the rows with a temperature and every channel: a row with a cell that is NaN is a missing sample.

    A rate that is NaN keeps its row: the temperature is known, and the rate counts nowhere.
    """
    known = np.ones(len(columns[layout.time]), dtype=bool)
    for name in (layout.temperature, *channels):
        missing = _missing(columns[name])
        if missing is not None:
            known &= ~missing
    if not known.all():
        for name in columns:  # one after the other, so that what is replaced goes: a long recording is not held twice
            columns[name] = columns[name][known]
    return columns


def _converted(columns: dict[str, FloatArray], units: Mapping[str, Conversion]) -> dict[str, FloatArray]:
    """Return columns in gyrotc's units."""
    return {name: units[name](values) if name in units else values for name, values in columns.items()}


def rate_of_pulses(time_s: FloatArray, pulses: FloatArray, weight_arcsec: float) -> FloatArray:
    """Mean rate since the last row, deg/h (1 arcsec/s = 1 deg/h); NaN in the first row."""
    rate = np.full(len(time_s), np.nan)
    rate[1:] = pulses[1:] * weight_arcsec / np.diff(time_s)
    return rate


def open_recording(
    name: str,
    path: Path,
    columns: Columns,
    units: Mapping[str, str],
    pulse_weight_arcsec: float | None,
    problems: Problems,
) -> Recording | None:
    """Open and check a file; return None, and report problems, if it is not in order."""
    before = len(problems)
    try:
        file = open_file(name, path)
        layout = arrange(name, file.names, columns, problems)
        if layout is None:
            return None
        if layout.pulses and pulse_weight_arcsec is None:
            raise InputError(f"{name}, column pulses", "no weight", "pulse_weight_arcsec in dataset.toml")
        if layout.pulses and "rate" in units:
            raise InputError("dataset.toml, field units.rate", "a unit", "none: the files count pulses")
        conversions = declared(units, _by_kind(layout))
        found = _checked(file, layout, conversions, pulse_weight_arcsec, problems)
    except InputError as error:
        problems.add(error)
        return None
    if len(problems) > before:
        return None
    period = median_step(found.time_s)
    if period < _SHORTEST_S:
        where, expected = f"{name}, column {layout.time}", f"at least {_SHORTEST_S:g} s; are they seconds?"
        problems.add(InputError(where, f"a median step of {period:.4g} s", expected))
        return None
    return Recording(file, layout, conversions, *found, n_rows=len(found.time_s), row_period_s=period)


def _by_kind(layout: Layout) -> dict[str, Sequence[str]]:
    return {
        "time": [layout.time],
        "temperature": [layout.temperature],
        "rate": list(layout.axes.values()) or [layout.value],
        "channels": layout.channels,
    }


def open_file(name: str, path: Path) -> Source:
    """Open a file by the ending of its name.

    Raises:
        InputError: There is none, or it is not what its name says.
    """
    return ParquetFile(name, path) if path.suffix.lower() == ".parquet" else CsvFile(name, path)


class _Contents(NamedTuple):
    """Figures of the rows of a file: fields of `Recording`."""

    evidence: Evidence
    fingerprints: Fingerprints
    equal_axes: tuple[tuple[str, str], ...]
    devices: dict[str, tuple[float, ...]]
    time_s: FloatArray


def _checked(
    file: Source, layout: Layout, units: Mapping[str, Conversion], pulse_weight_arcsec: float | None, problems: Problems
) -> _Contents:
    """Read all columns and check them."""
    values = file.columns(file.names)
    lines = None
    if values is None:
        values, lines, unread = file.scan()
        for fault in unread:
            problems.add(_problem(file, fault, fault.row))
        if unread:
            keep = np.all([~np.isnan(column) for column in values.values()], axis=0)
            values = {name: column[keep] for name, column in values.items()}
            lines = [line for line, kept in zip(lines, keep.tolist(), strict=True) if kept]
    values = _converted(values, units)
    time = values[layout.time]
    found = list(column_faults(values, layout))
    if layout.pulses and not found:
        found += rate_faults(layout.value, rate_of_pulses(time, values[layout.value], pulse_weight_arcsec or 1.0))
    for fault in found:
        place = lines[fault.row] if lines else file.place(fault.row)
        mark = Mark(file.name, (fault.row + 1, fault.row + 1))
        problems.add(_problem(file, fault, place, units.get(fault.column)), mark)
    if len(time) < MIN_ROWS:
        problems.add(InputError(file.name, f"{len(time)} rows", f"at least {MIN_ROWS}"))
    rows = len(time)
    values = known_rows(values, layout, layout.channels)
    time = values[layout.time]
    measured = min(np.count_nonzero(~np.isnan(values[n])) for n in layout.axes.values() or [layout.value])
    if measured < MIN_ROWS <= rows:
        some = f"{measured} rows with a temperature and a rate, the others have NaN"
        problems.add(InputError(file.name, some, f"at least {MIN_ROWS}"))
    rates = [values[name] for name in layout.axes.values() or [layout.value]]
    evidence = Evidence(len(rates))
    evidence.add(time, values[layout.temperature], rates)
    fingerprints = fingerprints_of(time, values[layout.temperature], rates)
    equal_axes = tuple(
        (one, other)
        for one, other in combinations(layout.axes, 2)
        if _are_copies(values[layout.axes[one]], values[layout.axes[other]])
    )
    named = {name: np.unique(values[name]) for name in layout.channels if names_device(name)}
    devices = {name: tuple(found.tolist()) for name, found in named.items() if len(found) <= MAX_DEVICES}
    return _Contents(evidence, fingerprints, equal_axes, devices, time)


def _are_copies(one: FloatArray, other: FloatArray) -> bool:
    """Test whether two columns hold the same values, of which not all are alike."""
    return np.array_equal(one, other, equal_nan=True) and bool(np.nanmin(one) < np.nanmax(one))


def _problem(file: Source, fault: Fault, place: int, unit: Conversion | None = None) -> InputError:
    rows = file.row_unit
    where = f"{file.name}, {rows} {place}" + (f", column {fault.column}" if fault.column else "")
    more = f" (and {fault.rows - 1} more {rows}s)" if fault.rows > 1 else ""
    declared_as = f" after conversion from {unit.unit}" if unit else ""
    return InputError(where, fault.found + declared_as + more, fault.expected)
