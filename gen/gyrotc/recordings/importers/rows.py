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
from ...common.errors import InputError
from ...results.files import create
from ..description import Layout, column_faults, likely_temperature
from ..reading import Evidence
from ..tables import Chunk, Column, LoggerTable
from ..units import Conversion, UnitError, channel_unit, conversion, meaning
from .clock import Clock
from .map_file import Choice, ImportPlan, TimeMap

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
        stated: `[time]` of the map.
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
    stated: TimeMap
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
        self.clock = Clock(self.file, plan.main, columns, unit, plan.rate_hz, self.stated)
        self.evidence = Evidence(len(plan.values))
        self.units = {name: one for name, one in self._conversions().items() if one is not None}
        self._held: tuple[FloatArray, FloatArray] | None = None
        self._last: dict[str, float] | None = None
        self._time = np.zeros(0)

    @property
    def layout(self) -> Layout:
        """Columns of the rows that are given."""
        roles = [choice.role for choice in self.plan.values]
        axes = {role[-1]: NAMES_OF_COLUMNS[role] for role in roles if role.startswith("rate_")}
        value = "" if axes else NAMES_OF_COLUMNS[roles[0]]
        channels = tuple(choice.role for choice in self.plan.channels)
        return Layout("time_s", NAMES_OF_COLUMNS["temperature"], value, roles == ["pulses"], axes, channels)

    def chunks(self) -> Iterator[tuple[dict[str, FloatArray], float]]:
        """Rows by column name, and the share of the file that was read.

        Raises:
            InputError: A row that cannot be taken, with its place and the change that goes on.
        """
        plan = self.plan
        choices = [*plan.values, *plan.channels]
        choices += [plan.temperature] * (plan.temperature.table is plan.main)
        names = list(dict.fromkeys([*self.clock.names, *(choice.column.name for choice in choices)]))
        for chunk in plan.main.chunks(names):
            self.read += len(chunk) + sum(chunk.left_out.values())
            self.left_out.update(chunk.left_out)
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
                kept = self._in_order(kept, rows, chunk)
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
        values = np.asarray(chunk.columns[choice.column.name]).astype(np.float64)
        unit = self.units.get(self.name_of(choice))
        return unit(values) if unit else values

    def _held_at(self, choice: Choice) -> FloatArray:
        """The last reading of another table at the time of each row; NaN before its first."""
        if self._held is None:
            self._held = self._readings(choice)
        times, values = self._held
        at = np.searchsorted(times, self._time, "right") - 1
        unit = self.units.get(self.name_of(choice))
        found = np.where(at >= 0, values[np.maximum(at, 0)], np.nan) if len(values) else np.full(len(at), np.nan)
        return unit(found) if unit else found

    def _readings(self, choice: Choice) -> tuple[FloatArray, FloatArray]:
        table = choice.table
        clock = self._clock_of(table)
        times, values = [np.zeros(0)], [np.zeros(0)]
        for chunk in table.chunks(list(dict.fromkeys([*clock.names, choice.column.name]))):
            one = np.asarray(chunk.columns[choice.column.name]).astype(np.float64)
            when = clock(chunk)
            good = np.isfinite(one) & np.isfinite(when)
            times.append(when[good])
            values.append(one[good])
        return np.concatenate(times), np.concatenate(values)

    def _clock_of(self, table: LoggerTable) -> Clock:
        """The clock of another table, set to that of the main one."""
        columns = _same_time(self.plan, table)
        if not columns and table.rate_hz is None:
            found = f"table {table.name!r} has no column of time like that of {self.plan.main.name!r}"
            raise InputError(self.file, found, "--column temperature=... of the table with the rates")
        unit = None
        if columns and columns[0].kind == "number":
            unit = columns[0].unit or (self.plan.time[0].unit if self.plan.time else None)
        clock = Clock(self.file, table, columns, unit, table.rate_hz, self.stated)
        clock.origin = self.clock.origin
        return clock

    def _keep_first(self, chunk: Chunk, columns: dict[str, FloatArray]) -> None:
        if not self.raw:
            self.raw = {name: [str(value) for value in values[:3]] for name, values in chunk.columns.items()}
            self.first_rows = {name: [float(v) for v in values[:3]] for name, values in columns.items()}

    def _whole(self, columns: dict[str, FloatArray]) -> tuple[dict[str, FloatArray], NDArray[np.int64]]:
        """Rows without a missing value, and their numbers in the chunk."""
        good = np.ones(len(columns["time_s"]), dtype=bool)
        for name, values in columns.items():
            missing = ~np.isfinite(values) & good
            if missing.any():
                self.left_out[f"no number in {name}"] += int(missing.sum())
                good &= ~missing
        rows = np.flatnonzero(good)
        return ({n: v if good.all() else v[good] for n, v in columns.items()}, rows)

    def _in_order(self, kept: dict[str, FloatArray], rows: NDArray[np.int64], chunk: Chunk) -> dict[str, FloatArray]:
        """Without rows that repeat the one before in every value; times must go on.

        Raises:
            InputError: They do not.
        """
        last = self._last or dict.fromkeys(kept, np.nan)
        before = {name: np.r_[last[name], values[:-1]] for name, values in kept.items()}
        copies = np.all([values == before[name] for name, values in kept.items()], axis=0)
        if copies.any():
            self.left_out["copies of the row before"] += int(copies.sum())
        wrong = (kept["time_s"] <= before["time_s"]) & ~copies
        if wrong.any():
            at = int(np.argmax(wrong))
            self._refuse_time(kept["time_s"][at], before["time_s"][at], chunk.first + int(rows[at]))
        self._last = {name: float(values[-1]) for name, values in kept.items()}
        steps = (kept["time_s"] - before["time_s"])[~copies]
        steps = steps[np.isfinite(steps)]
        if steps.size:
            low, high = self.period_s
            self.period_s = (min(low, float(steps.min())), max(high, float(steps.max())))
        return {name: values[~copies] for name, values in kept.items()} if copies.any() else kept

    def _refuse_time(self, time: float, before: float, row: int) -> None:
        where = f"{self.file}, {self.plan.main.place(row)}"
        if time == before:
            found = f"the time of the row before, {time:.10g} s, with other values"
            expected = "times that go on; --rate-hz R counts rows that come at a fixed rate instead"
        elif 3000.0 < before - time < 4000.0 and self.clock.needs_zone:
            found = f"time goes back by {before - time:.10g} s, as when summer time ends"
            expected = "--time-zone with the zone of a fixed offset that the logger kept, or --rate-hz R"
        else:
            found = f"time goes back: {time:.10g} s after {before:.10g} s"
            expected = "times that go on: cut the file there and import its parts, or --rate-hz R to count rows"
        raise InputError(where, found, expected)

    def _check(self, kept: dict[str, FloatArray], rows: NDArray[np.int64], chunk: Chunk) -> None:
        """Values that no gyro and no chamber gives.

        Raises:
            InputError: There is one.
        """
        for fault in column_faults(kept, self.layout):
            place = self.plan.main.place(chunk.first + int(rows[min(fault.row, len(rows) - 1)]))
            kind = {"time_s": "time", "temperature_c": "temperature"}.get(fault.column, "rate")
            unit = self.units.get(fault.column)
            read = f" (read as {unit.unit})" if unit else ""
            guess = kind == "temperature" and not (unit and unit.changes)
            likely = likely_temperature(kept[fault.column]) if guess else None
            option = f"--{kind}-unit {likely}" if likely else f"another --{kind}-unit"
            expected = f"{fault.expected.split(';')[0]}: {option}, or another --column {kind}=..."
            raise InputError(f"{self.file}, {place}, column {fault.column}", fault.found + read, expected)


def conversion_of(choice: Choice) -> Conversion | None:
    """How a column is converted; None where it is taken as it is."""
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
    """The column of time of another table: of the same name, or the likeliest."""
    if not plan.time:
        return []
    found = [column for choice in plan.time if (column := table.column(choice.column.name))]
    if len(found) == len(plan.time):
        return found
    likely = [c for c in table.columns if meaning(c.name, c.unit, table.name).kind == "time" and c.unit]
    return likely[:1]


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
        """Appends rows."""
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
