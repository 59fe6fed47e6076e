"""Rows of a logger become rows of a data set, chunk after chunk, and a run on disk."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from ...common.arrays import FloatArray
from ...common.errors import InputError, quoted
from ...results.files import create
from ..csv_file import number_in
from ..description import Layout, column_faults, likely_temperature
from ..reading import Evidence
from ..tables import Chunk, Column, LoggerTable
from ..units import Conversion, UnitError, channel_unit, conversion, meaning
from .clock import Clock
from .map_file import Choice, ImportPlan, Map, TimeMap
from .order import Times, out_of_order, refuse_skipped_hour
from .selection import NO_DEVICE, Device

NAMES_OF_COLUMNS = {
    "temperature": "temperature_c",
    "rate": "rate_dph",
    "rate_x": "rate_x_dph",
    "rate_y": "rate_y_dph",
    "rate_z": "rate_z_dph",
    "pulses": "pulses",
}


@dataclass
class ImportedRows:
    """The rows of one file under a plan.

    Attributes:
        file: Name for messages.
        plan: What is read.
        chosen: What is known of the logger.
        read: Rows of the file.
        count: Rows of these that were given.
        left_out: Rows of these that were not, by the reason.
        evidence: What the units can be judged by.
        raw: The first rows as the file has them, by column; for a preview.
        first_rows: The same rows as they were given.
        period_s: Shortest and longest step from row to row, s; from infinite to 0 before there is one.
    """

    file: str
    plan: ImportPlan
    chosen: Map
    read: int = 0
    count: int = 0
    left_out: Counter[str] = field(default_factory=Counter)
    raw: dict[str, list[str]] = field(default_factory=dict)
    first_rows: dict[str, list[float]] = field(default_factory=dict)
    period_s: tuple[float, float] = (np.inf, 0.0)

    def __post_init__(self) -> None:
        plan = self.plan
        unit = plan.time[0].unit if plan.time else None
        columns = [choice.column for choice in plan.time]
        self.clock = Clock(self.file, plan.main, columns, unit, plan.rate_hz, self.chosen.time)
        stated = self.chosen.columns.device not in (None, NO_DEVICE)
        self.device = Device(self.file, plan.main, plan.device, stated=stated)
        self._missing = [number for word in self.chosen.csv.missing if (number := number_in(word)) is not None]
        self._holds = dict.fromkeys([*(self.name_of(c) for c in plan.channels), "temperature_c"], np.nan)
        self.evidence = Evidence(len(plan.values))
        self.units = {name: one for name, one in self._conversions().items() if one is not None}
        self._readings_of_table: tuple[FloatArray, FloatArray] | None = None
        self._last: dict[str, float] | None = None
        self._time = np.zeros(0)

    @property
    def layout(self) -> Layout:
        """Meaning of the columns of the rows."""
        roles = [choice.role for choice in self.plan.values]
        axes = {role[-1]: NAMES_OF_COLUMNS[role] for role in roles if role.startswith("rate_")}
        value = "" if axes else NAMES_OF_COLUMNS[roles[0]]
        channels = tuple(choice.role for choice in self.plan.channels)
        return Layout("time_s", NAMES_OF_COLUMNS["temperature"], value, roles == ["pulses"], axes, channels)

    def chunks(self) -> Iterator[RowsChunk]:
        """Yield rows by column name, with the share of the file that was read.

        Raises:
            InputError: A row that cannot be taken, with its place and the change that goes on.
        """
        plan = self.plan
        choices = [*plan.values, *plan.channels]
        choices += [plan.temperature] * (plan.temperature.table is plan.main)
        where = [plan.where.column] if plan.where else []
        names = [*self.clock.names, *self.device.names, *where, *(choice.column.name for choice in choices)]
        for whole in plan.main.chunks(list(dict.fromkeys(names))):
            self.read += len(whole) + sum(whole.left_out.values())
            self.left_out.update(whole.left_out)
            chunk = self._picked(whole)
            self.device.look(chunk)
            lengths = {len(values) for values in chunk.columns.values()}
            if len(lengths) > 1:
                found = f"columns of {min(lengths)} to {max(lengths)} rows where they should be of one length"
                raise InputError(self.file, found, "a whole file: what is missing may be in the original")
            if not len(chunk):
                continue
            time = self.clock(chunk)
            columns = {"time_s": time}
            self._time = time
            columns |= {self.name_of(choice): self._native(choice, chunk) for choice in (plan.temperature, *choices)}
            self._keep_first(chunk, columns)
            kept, rows = self._whole(columns)
            if len(rows):
                kept, rows = self._in_order(kept, rows, chunk)
            if len(rows):
                self._check(kept, rows, chunk)
                self.count += len(kept["time_s"])
                value_names = [NAMES_OF_COLUMNS[choice.role] for choice in plan.values]
                self.evidence.add(kept["time_s"], kept["temperature_c"], [kept[n] for n in value_names])
                yield kept, chunk.done
        self._check_count()

    def _check_count(self) -> None:
        """Every row that was read was given or left out, and where the file states a number, as many were read.

        Raises:
            InputError: The file states another number.
        """
        stated = self.plan.main.rows
        if stated and self.read != stated:
            found = f"states {stated} rows, and {self.read} can be read"
            raise InputError(self.file, found, "a whole file: what is missing may be in the original")
        assert self.read == self.count + self.left_out.total()

    def _picked(self, chunk: Chunk) -> Chunk:
        """The rows that the plan picks; the others are counted."""
        if self.plan.where is None or not len(chunk):
            return chunk
        picked = self.plan.where.rows(chunk.columns[self.plan.where.column])
        if picked.all():
            return chunk
        self.left_out[f"not {self.plan.where}"] += int(np.count_nonzero(~picked))
        return chunk.only(picked)

    def notes(self) -> Iterator[str]:
        """Yield remarks on what a person may want to state, judged by the rows that were left out."""
        if hint := self.hint():
            yield f"most rows are left out{hint}"

    def hint(self) -> str:
        """The option for a temperature that few rows have, as the end of a sentence; empty where most rows have it."""
        without = sum(self.left_out[f"no number in {name}"] for name in self._holds)
        if without <= 0.5 * self.read:
            return ""
        if self.plan.temperature.table is not self.plan.main:
            return "; a larger tolerance of the joined file (--tolerance-s), or a file of the same time"
        return "; --set hold=true holds each reading of temperature and channels until the next one"

    def name_of(self, choice: Choice) -> str:
        """Name of the column that a choice becomes."""
        return NAMES_OF_COLUMNS.get(choice.role, choice.role)

    def _conversions(self) -> dict[str, Conversion | None]:
        every = (self.plan.temperature, *self.plan.values, *self.plan.channels)
        found = {self.name_of(choice): conversion_of(choice) for choice in every}
        time = self.plan.time[0].unit if self.plan.time else None
        return found | ({"time_s": conversion(time, "time")} if time else {})

    def _native(self, choice: Choice, chunk: Chunk) -> FloatArray:
        if choice.table is not self.plan.main:
            return self._held_at(choice)
        values = self._numbers(chunk.columns[choice.column.name])
        name = self.name_of(choice)
        unit = self.units.get(name)
        values = unit(values) if unit else values
        return self._held(name, values) if self.chosen.hold and name in self._holds else values

    def _numbers(self, column: Any) -> FloatArray:
        """Return the values of the file; NaN if the map says that a number is no reading."""
        values = np.asarray(column).astype(np.float64)
        if self._missing:
            values[np.isin(values, self._missing)] = np.nan
        return values

    def _held(self, name: str, values: FloatArray) -> FloatArray:
        """Hold each reading until the next one."""
        at = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), -1))
        held = np.where(at >= 0, values[np.maximum(at, 0)], self._holds[name])
        self._holds[name] = float(held[-1]) if len(held) else self._holds[name]
        return held

    def _held_at(self, choice: Choice) -> FloatArray:
        """The last reading of another table at the time of each row; NaN before its first, or where it is too old."""
        if self._readings_of_table is None:
            self._readings_of_table = self._readings(choice)
        times, values = self._readings_of_table
        if not len(times):
            return np.full(len(self._time), np.nan)
        at = np.searchsorted(times, self._time, "right") - 1
        known = at >= 0
        if choice.table.tolerance_s is not None:
            known &= self._time - times[np.maximum(at, 0)] <= choice.table.tolerance_s
        unit = self.units.get(self.name_of(choice))
        found = np.where(known, values[np.maximum(at, 0)], np.nan)
        return unit(found) if unit else found

    def _readings(self, choice: Choice) -> tuple[FloatArray, FloatArray]:
        table = choice.table
        clock = self._clock_of(table)
        times, values = [np.zeros(0)], [np.zeros(0)]
        for chunk in table.chunks(list(dict.fromkeys([*clock.names, choice.column.name]))):
            if not len(chunk):
                continue
            one = self._numbers(chunk.columns[choice.column.name])
            when = clock(chunk)
            good = np.isfinite(one) & np.isfinite(when)
            times.append(when[good])
            values.append(one[good])
        time = np.concatenate(times)
        if np.any(np.diff(time) < 0.0):
            at = int(np.argmin(np.diff(time))) + 1
            found = f"time goes back: {time[at]:.10g} s after {time[at - 1]:.10g} s"
            raise InputError(self._file_of(table), found, "readings in order of time")
        return time, np.concatenate(values)

    def _file_of(self, table: LoggerTable) -> str:
        """Name of the file of a table, for messages."""
        return self.file if table.tolerance_s is None else table.name

    def _clock_of(self, table: LoggerTable) -> Clock:
        """The clock of another table, set to that of the main one.

        Raises:
            InputError: It has no times, or none that can be compared with those of the rates.
        """
        of_file = table.name.partition("/")[0] if table.tolerance_s is not None else None
        joined = next((one for one in self.chosen.join if Path(one.file).name == of_file), None)
        columns = [c for n in joined.time if (c := table.column(n))] if joined else []
        columns = columns or _same_time(self.plan, table)
        where = self._file_of(table)
        if not columns and table.rate_hz is None:
            found = f"table {quoted(table.name)} has no column of time like that of {quoted(self.plan.main.name)}"
            raise InputError(where, found, "--column temperature=... of the table with the rates")
        unit = None
        if columns and columns[0].kind == "number":
            unit = _unit_of_time(columns[0], table) or (self.plan.time[0].unit if self.plan.time else None)
        stated = (
            TimeMap(format=joined.format, zone=joined.zone or self.chosen.time.zone) if joined else self.chosen.time
        )
        clock = Clock(where, table, columns, unit, table.rate_hz, stated)
        clock.follow(self.clock)
        return clock

    def _keep_first(self, chunk: Chunk, columns: dict[str, FloatArray]) -> None:
        if not self.raw:
            self.raw = {name: [str(value) for value in values[:3]] for name, values in chunk.columns.items()}
            self.first_rows = {name: [float(v) for v in values[:3]] for name, values in columns.items()}

    def _whole(self, columns: dict[str, FloatArray]) -> tuple[dict[str, FloatArray], NDArray[np.int64]]:
        """Return the rows without a missing value, and their numbers in the chunk."""
        good = np.ones(len(columns["time_s"]), dtype=bool)
        for name, values in columns.items():
            missing = ~np.isfinite(values) & good
            if missing.any():
                self.left_out[f"no number in {name}"] += int(missing.sum())
                good &= ~missing
        rows = np.flatnonzero(good)
        return ({n: v if good.all() else v[good] for n, v in columns.items()}, rows)

    def _in_order(
        self, kept: dict[str, FloatArray], rows: NDArray[np.int64], chunk: Chunk
    ) -> tuple[dict[str, FloatArray], NDArray[np.int64]]:
        """Drop rows that repeat the one before in every value, and check that times increase.

        Raises:
            InputError: They do not.
        """
        last = self._last or dict.fromkeys(kept, np.nan)
        before = {name: np.r_[last[name], values[:-1]] for name, values in kept.items()}
        out = np.all([values == before[name] for name, values in kept.items()], axis=0)
        self._leave_out("copies of the row before", out)
        time = kept["time_s"]
        reached = np.fmax.accumulate(np.r_[last["time_s"], time[:-1]])
        late = (time <= reached) & ~out
        if late.any() and not self.chosen.time.leave_out_late:
            at = int(np.argmax(late))
            raise out_of_order(self._times(chunk, rows, time, before["time_s"]), at)
        self._leave_out("time not behind that of the row before", late)
        taken = ~(out | late)
        kept, rows = {name: values[taken] for name, values in kept.items()}, rows[taken]
        if not len(rows):
            return kept, rows
        previous = np.r_[last["time_s"], kept["time_s"][:-1]]
        refuse_skipped_hour(self._times(chunk, rows, kept["time_s"], previous))
        steps = kept["time_s"] - previous
        self._last = {name: float(values[-1]) for name, values in kept.items()}
        steps = steps[np.isfinite(steps)]
        if steps.size:
            low, high = self.period_s
            self.period_s = (min(low, float(steps.min())), max(high, float(steps.max())))
        return kept, rows

    def _times(self, chunk: Chunk, rows: NDArray[np.int64], time_s: FloatArray, before_s: FloatArray) -> Times:
        return Times(self.file, self.plan.main, self.clock, chunk, rows, time_s, before_s)

    def _leave_out(self, reason: str, rows: NDArray[np.bool_]) -> None:
        if count := int(np.count_nonzero(rows)):
            self.left_out[reason] += count

    def _check(self, kept: dict[str, FloatArray], rows: NDArray[np.int64], chunk: Chunk) -> None:
        """Refuse values that no gyro and no chamber gives.

        Raises:
            InputError: There is one.
        """
        for fault in column_faults(kept, self.layout):
            place = self.plan.main.place(chunk.row(int(rows[fault.row])))
            kind = {"time_s": "time", "temperature_c": "temperature"}.get(fault.column, "rate")
            unit = self.units.get(fault.column)
            read = f" (read as {unit.unit})" if unit else ""
            guess = kind == "temperature" and not (unit and unit.changes)
            likely = likely_temperature(kept[fault.column]) if guess else None
            option = f"--{kind}-unit {likely}" if likely else f"another --{kind}-unit"
            if kind != "time" and fault.rows < _MAX_SHARE * len(rows):
                raw = self._raw(fault.column, chunk, int(rows[fault.row]))
                option = (
                    f"--set csv.missing={raw} takes {'it' if fault.rows == 1 else 'these'} as no reading, or {option}"
                )
            expected = f"{fault.expected.split(';')[0]}: {option}, or another --column {kind}=..."
            raise InputError(f"{self.file}, {place}, column {fault.column}", fault.found + read, expected)

    def _raw(self, name: str, chunk: Chunk, row: int) -> str:
        """A value as the file has it."""
        choices = (self.plan.temperature, *self.plan.values, *self.plan.channels)
        choice = next(choice for choice in choices if self.name_of(choice) == name)
        return f"{chunk.columns[choice.column.name][row]:.10g}" if choice.table is self.plan.main else "..."


# More implausible values than this share of the rows are no failed readings, but another unit.
_MAX_SHARE = 0.2


def conversion_of(choice: Choice) -> Conversion | None:
    """Return the conversion of a column; None if it is taken as it is."""
    if choice.unit is None or choice.role == "pulses":
        return None
    kind = "rate" if choice.role.startswith("rate") else choice.role
    if choice.role in NAMES_OF_COLUMNS:
        return conversion(choice.unit, kind)
    wanted = channel_unit(choice.role)
    try:
        return conversion(choice.unit, wanted) if wanted else None
    except UnitError:
        return None


def _same_time(plan: ImportPlan, table: LoggerTable) -> list[Column]:
    """The column of time of another table: of the same name, of stamps, or the first of time by name and unit."""
    if not plan.time:
        return []
    same = [column for choice in plan.time if (column := table.column(choice.column.name))]
    if len(same) == len(plan.time):
        return same
    stamps = [column for column in table.columns if column.kind == "stamp"]
    return (stamps or [column for column in table.columns if _unit_of_time(column, table)])[:1]


def _unit_of_time(column: Column, table: LoggerTable) -> str | None:
    """Unit of a column of times; None: it holds something else, or its unit stands nowhere."""
    known = meaning(column.name, column.unit, table.name)
    return known.unit if known.kind == "time" and column.kind == "number" else None


RowsChunk = tuple[dict[str, FloatArray], float]
"""Rows by column name, and the share of the file that was read."""
FileFormat = Literal["csv", "parquet"]
_GROUP_ROWS = 2**20  # of a row group: Arrow's own default


class RunFile:
    """Rows written chunk by chunk.

    Args:
        path: The file.
        format: Its form.
        names: Columns; `pulses` are whole numbers.
    """

    def __init__(self, path: Path, format: FileFormat, names: Sequence[str]) -> None:
        types = [(name, pa.int64() if name == "pulses" else pa.float64()) for name in names]
        self._schema = pa.schema(types)
        self._sink = create(path)
        self._writer: Any
        if format == "csv":
            self._sink.write((",".join(names) + "\n").encode())
            plain = pyarrow.csv.WriteOptions(include_header=False, quoting_style="none")
            self._writer = pyarrow.csv.CSVWriter(self._sink, self._schema, write_options=plain)
        else:
            self._writer = pyarrow.parquet.ParquetWriter(
                self._sink, self._schema, use_dictionary=False, compression="zstd", store_schema=False
            )

    def write(self, columns: dict[str, NDArray[np.float64]]) -> None:
        """Append rows."""
        arrays = [pa.array(columns[field.name]).cast(field.type) for field in self._schema]
        table = pa.Table.from_arrays(arrays, schema=self._schema)
        if isinstance(self._writer, pyarrow.parquet.ParquetWriter):
            self._writer.write_table(table, row_group_size=_GROUP_ROWS)
        else:
            self._writer.write_table(table)

    def __enter__(self) -> RunFile:
        return self

    def __exit__(self, *error: object) -> None:
        self._writer.close()
        self._sink.close()
