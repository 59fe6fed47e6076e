"""Tables of named columns, read in chunks or whole: the form that every format of a logger takes.

A file holds one table (CSV) or many (the sheets of a spreadsheet, the groups of a measurement file). Columns are named
`table/column` where there are many. An importer knows what its format says of units and of time; it guesses nothing.
"""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ..common.arrays import IntArray
from ..common.errors import InputError, install_command
from ..common.inputs import refuse_above

CHUNK_ROWS = 2**18  # read at once: 2 MiB a column of float64
MAX_COLUMNS = 64
"""Of a matrix whose columns are read; a wider one is a picture or a spectrum."""
Array = NDArray[Any]
ColumnKind = Literal["number", "stamp", "text"]


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table.

    Attributes:
        name: Name as the file has it.
        unit: As the file gives it, None where it gives none.
        why: Where the unit stands.
        kind: What its cells hold; "stamp": dates and times of day.
        sample: The first cells as text, for previews and to tell the form of stamps.
    """

    name: str
    unit: str | None = None
    why: str = ""
    kind: ColumnKind = "number"
    sample: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Chunk:
    """Some rows of a table.

    Attributes:
        columns: Values by name: numbers (NaN where a cell is missing), datetime64[ns], or text (pyarrow).
        first: Number of the first row in the table, from 0.
        rows: Numbers of the rows in the table; None: they follow one another.
        done: Share of the table that has been read with these rows, 0 to 1.
        left_out: Number of rows of the file that are not among them, by the reason.
    """

    columns: dict[str, Any]
    first: int
    done: float
    left_out: Mapping[str, int] = field(default_factory=dict)
    rows: IntArray | None = None

    def row(self, k: int) -> int:
        """Number in the table of a row of the chunk."""
        return self.first + k if self.rows is None else int(self.rows[k])

    def only(self, chosen: NDArray[np.bool_]) -> Chunk:
        """The chosen rows."""
        columns = {
            name: values.filter(pa.array(chosen)) if isinstance(values, pa.Array) else values[chosen]
            for name, values in self.columns.items()
        }
        return replace(self, columns=columns, rows=self.first + np.flatnonzero(chosen))

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()))) if self.columns else 0


@dataclass(frozen=True)
class LoggerTable(ABC):
    """Rows of one rhythm.

    Attributes:
        name: Name within the file; empty where there is one table.
        columns: Its columns.
        rate_hz: Rows per second where the format states it and no column holds times.
        why_rate: Where that stands.
        started: Time of the first row where the format states it.
        notes: What the file says, or shows, of rows that it lacks.
        rows: Number of rows where the format states it, else 0.
        above: Lines of text above the first row: names, units, and what else a logger writes there.
        tolerance_s: For how long a reading of a joined file holds, s; None: a table of the file itself.
    """

    name: str
    columns: tuple[Column, ...]
    rate_hz: float | None = None
    why_rate: str = ""
    started: datetime | None = None
    notes: tuple[str, ...] = field(default=())
    rows: int = 0
    above: int = 0
    tolerance_s: float | None = None

    @abstractmethod
    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """Yield rows in order, with the columns asked for.

        Raises:
            InputError: A row that cannot be read, with its place and the change that goes on.
        """

    def place(self, row: int) -> str:
        """Where a row stands, for messages."""
        return f"row {row + 1}" if not self.name else f"{self.name}, row {row + 1}"

    def cut_in_two(self, file: str, row: int) -> str:
        """Return words or commands that make two files of the rows before and from a row."""
        return f"a file with the rows before {self.place(row)}, and one with the rows from there on"

    def turned_round(self, file: str) -> str:
        """Return words or commands that make a file with the rows in reverse order."""
        return "a file in which the rows are sorted by time"

    def column(self, name: str) -> Column | None:
        """The column of a name, None if there is none."""
        return next((c for c in self.columns if c.name == name), None)


@dataclass(frozen=True, slots=True)
class LoggerFile:
    """A file of a logger.

    Attributes:
        path: Where it is.
        format: Words for its format.
        tables: What it holds.
        facts: Facts about the recording that the file states, such as a serial.
        csv: What a map keeps of how a CSV file is written, as keys of `[csv]`; empty for other formats.
        close: Ends the reading: after it no chunk comes.
        joined: Files whose tables stand behind its own.
        unread: What else the file holds: the name of each, with the reason in brackets.
    """

    path: Path
    format: str
    tables: tuple[LoggerTable, ...]
    facts: dict[str, str] = field(default_factory=dict)
    csv: dict[str, str] = field(default_factory=dict)
    close: Callable[[], object] = lambda: None
    joined: tuple[Path, ...] = ()
    unread: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse tables of more rows or columns than allowed.

        Raises:
            InputError: There is one.
        """
        for table in self.tables:
            where = f"{self.path.name} {table.name}".rstrip()
            refuse_above("rows", table.rows, where, "rows")
            refuse_above("columns", len(table.columns), where, "columns")


def optional_library(path: Path, module: str, extra: str, what: str) -> ModuleType:
    """A library that only one format, that of the file at `path`, needs.

    Raises:
        InputError: It is not installed; the message says what to install.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.split(".", maxsplit=1)[0]
        found = f"{what} is read by {package}, which is not installed"
        raise InputError(path.name, found, install_command(extra)) from error


def numbers(values: Any) -> Array:
    """An array of numbers as it is, in this machine's byte order, one value a row."""
    array = np.asarray(values)
    if array.dtype.byteorder == ">":
        array = array.astype(array.dtype.newbyteorder("="))
    return np.ascontiguousarray(array.reshape(-1))


ReadPart = Callable[[int, int], Any]
"""Gives the values of rows from a first to a last one (exclusive)."""


@dataclass(frozen=True)
class ArrayTable(LoggerTable):
    """Columns that can be read from any row on.

    Attributes:
        parts: Reads a part of each column.
    """

    parts: Mapping[str, ReadPart] = field(default_factory=dict)

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """Yield rows in order; see `LoggerTable.chunks`."""
        for first in range(0, self.rows, CHUNK_ROWS):
            last = min(first + CHUNK_ROWS, self.rows)
            values = {name: np.asarray(self.parts[name](first, last)) for name in names}
            yield Chunk(values or {"": np.zeros(last - first)}, first, last / self.rows)


def part_of(values: Any) -> ReadPart:
    """Return the reader of an array in memory."""
    return lambda first, last: values[first:last]


@dataclass(frozen=True, slots=True)
class Vector:
    """A column in a file of named arrays.

    Attributes:
        group: Columns of one group and one length are a table.
        table: Name of that table.
        rows: Number of values.
        column: Name, unit and kind.
        part: Reads its values.
    """

    group: str
    table: str
    rows: int
    column: Column
    part: ReadPart


def unread(name: str, why: str) -> str:
    """Return an entry of `LoggerFile.unread`."""
    return f"{name} ({why})"


def grouped(
    entries: Iterable[Vector | str], rates: Mapping[str, tuple[float, str]]
) -> tuple[tuple[LoggerTable, ...], tuple[str, ...]]:
    """Return the tables of columns of one group and one length, and what is in none of them.

    Args:
        entries: Columns, and what `unread` said of the other contents.
        rates: Rows per second by group, with the reason.
    """
    left: list[str] = []
    found: dict[tuple[str, int], list[tuple[Column, ReadPart]]] = {}
    names: dict[tuple[str, int], str] = {}
    for one in entries:
        if isinstance(one, str):
            left.append(one)
            continue
        if one.rows < 2:
            left.append(unread(one.column.name, "one value" if one.rows else "no values"))
            continue
        found.setdefault((one.group, one.rows), []).append((one.column, one.part))
        names[one.group, one.rows] = one.table
    lengths: dict[str, int] = {}
    for group, _ in found:
        lengths[group] = lengths.get(group, 0) + 1
    tables = []
    for (group, rows), members in found.items():
        name = names[group, rows] if lengths[group] == 1 else f"{names[group, rows]} ({rows} rows)".strip()
        rate, why = rates.get(group, (None, ""))
        parts = {column.name: part for column, part in members}
        columns_of = tuple(column for column, _ in members)
        tables.append(ArrayTable(name, columns_of, rate, why, rows=rows, parts=parts))
    return tuple(tables), tuple(left)


def rate_of(name: str, value: float) -> tuple[float, str] | None:
    """Return the rows per second that a single number of that name states, with the reason; None if it states none."""
    plain = name.lower().rsplit("/", 1)[-1].rsplit(".", 1)[-1]
    if not np.isfinite(value) or value <= 0.0:
        return None
    if plain in ("fs", "fs_hz", "sample_rate", "samplerate", "sampling_rate", "rate_hz", "samplingfrequency", "fsamp"):
        return float(value), f"{name} = {value:g} in the file, in Hz"
    if plain in ("dt", "ts", "dt_s", "ts_s", "sample_time", "sampletime"):
        return 1.0 / float(value), f"{name} = {value:g} in the file, in s"
    return None
