"""CSV of any dialect: what stands above the rows, then blocks of whole lines, read by pyarrow.

Sheets of a spreadsheet (`.xlsx`, by openpyxl) become CSV files in a folder of its own, and are read as one is.
"""

from __future__ import annotations

import codecs
import csv
import re
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from ...common.errors import InputError
from ..files import blocks_of_lines, parsed
from ..tables import Chunk, Column, LoggerFile, LoggerTable, library
from .csv_dialect import HEXADECIMAL, MISSING, Dialect, cells_of, dialect_of, kind_of_cells, plain_lines, plain_number


def _lines_of(lines: bytes, number: int) -> Iterator[tuple[int, str]]:
    yield from enumerate(lines.decode("utf-8", "replace").split("\n"), start=number)


_HEAD_BYTES = 2**18  # for guessing a dialect: about a thousand lines
_SAMPLE = 40  # rows, half of them from the end, where formats that change show
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


def open_csv(path: Path, given: dict[str, Any]) -> LoggerFile:
    """A CSV file with its dialect, recognised from its head and `[csv]` of a map.

    Raises:
        InputError: No rows of numbers can be found.
    """
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
        whole = not file.read(1)
    if not head.strip():
        raise InputError(path.name, "is empty", "a header and rows")
    dialect = dialect_of(path.name, head, given, whole=whole)
    rows = _sample_rows(head, dialect, whole)
    columns = tuple(
        _column(name, unit, dialect, [row[k] for row in rows])
        for k, (name, unit) in enumerate(zip(_unique(dialect.names), dialect.units, strict=True))
    )
    table = CsvTable(
        name="", columns=columns, path=path, dialect=dialect, size=path.stat().st_size, **_stated_rate(dialect)
    )
    return LoggerFile(path, _words(dialect), (table,), dialect.facts, dialect.to_map())


@dataclass(frozen=True)
class CsvTable(LoggerTable):
    """The rows of a CSV file.

    Attributes:
        path: The file.
        dialect: How it is written.
        size: Bytes that are read; what is written meanwhile is not.
        remarks: What was left out while reading, by what it was.
    """

    path: Path = Path()
    dialect: Dialect = field(default_factory=lambda: Dialect("utf-8", ",", ".", (), 0, 0, 1, (), ()))
    size: int = 0
    remarks: dict[str, int] = field(default_factory=dict)

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """As `Table.chunks`: a chunk for each block of lines."""
        first = 0
        for lines, number, done in self._blocks():
            rows = self._rows(lines, number, names, last=done >= 1.0)
            if rows is not None and len(next(iter(rows.values()))):
                yield Chunk(rows, first, done)
                first += len(next(iter(rows.values())))

    def place(self, row: int) -> str:
        """Number of the line of a row."""
        at = 0
        for lines, number, _ in self._blocks():
            for line, text in _lines_of(lines, number):
                if self._is_row(text):
                    if at == row:
                        return f"line {line}"
                    at += 1
        return f"row {row + 1}"

    def _blocks(self) -> Iterator[tuple[bytes, int, float]]:
        one = self.dialect
        return blocks_of_lines(self.path, self.size, self.path.name, first=one.data_line, encoding=one.encoding)

    def _is_row(self, text: str) -> bool:
        return bool(text.strip()) and not text.startswith(self.dialect.comment) and not self._is_header(text)

    def _is_header(self, text: str) -> bool:
        cells = cells_of(text, self.dialect.delimiter)
        names = [name for name in self.dialect.names if name]
        return (
            bool(self.dialect.header_line)
            and [c for c in cells if c] == names
            and not all(_NUMBER.fullmatch(name) for name in names)
        )

    def _rows(self, lines: bytes, number: int, names: Sequence[str], *, last: bool) -> dict[str, Any] | None:
        plain = self._without_comments(lines)
        try:
            return self._fast(plain, names)
        except (pa.ArrowInvalid, pa.ArrowKeyError):
            return self._slow(lines, number, names, last=last)

    def _without_comments(self, lines: bytes) -> bytes:
        for mark in self.dialect.comment:
            octets = mark.encode()
            if lines.startswith(octets) or b"\n" + octets in lines:
                lines = re.sub(rb"(?m)^" + re.escape(octets) + rb"[^\n]*\n?", b"", lines)
        if self.dialect.delimiter == "whitespace":
            lines = re.sub(rb"(?m)^[ \t]+|[ \t\r]+$", b"", lines)
            lines = re.sub(rb"[ \t]+", b" ", lines)
        elif self.dialect.thousands or self.dialect.spaced_sign:
            one = self.dialect
            lines = plain_lines(lines, one.delimiter, one.thousands, spaced_sign=one.spaced_sign)
        return lines

    def _fast(self, lines: bytes, names: Sequence[str]) -> dict[str, Any]:
        if not lines.strip():
            return {name: np.empty(0) for name in names}
        table = parsed(
            lines,
            [column.name for column in self.columns],
            {name: self._type(name) for name in names},
            delimiter=" " if self.dialect.delimiter == "whitespace" else self.dialect.delimiter,
            decimal=self.dialect.decimal,
            missing=self.dialect.missing,
        )
        return {name: _values(table.column(name)) for name in names}

    def _type(self, name: str) -> pa.DataType:
        column = self.column(name)
        if column is None or column.kind != "number":
            return pa.string()
        long = [c for c in column.sample if len(c) >= 16]
        whole = long and all(re.fullmatch(r"[+-]?\d{16,18}|", c) for c in column.sample)
        counted = any(column.sample) and all(HEXADECIMAL.fullmatch(c) for c in column.sample if c)
        return pa.int64() if whole or counted else pa.float64()

    def _slow(self, lines: bytes, number: int, names: Sequence[str], *, last: bool) -> dict[str, Any]:
        """The rows of a block cell by cell.

        Raises:
            InputError: A line that is no row; it says what goes on.
        """
        index = {column.name: k for k, column in enumerate(self.columns)}
        cells: dict[str, list[Any]] = {name: [] for name in names}
        every = list(_lines_of(lines, number))
        torn = last and not lines.endswith((b"\n", b"\r"))
        for k, (line, text) in enumerate(every):
            if not self._is_row(text):
                self.remarks["repeated header lines"] = self.remarks.get("repeated header lines", 0) + (
                    bool(text.strip()) and self._is_header(text)
                )
                continue
            row = cells_of(text, self.dialect.delimiter)
            try:
                parsed = self._parsed(line, row, names, index)
            except InputError:
                if torn and k == len(every) - 1:
                    self.remarks["unfinished last line"] = 1
                    break
                raise
            for name, value in parsed.items():
                cells[name].append(value)
        return {
            name: np.array(values) if self._type(name) != pa.string() else pa.array(values, pa.string())
            for name, values in cells.items()
        }

    def _parsed(self, line: int, row: list[str], names: Sequence[str], index: dict[str, int]) -> dict[str, Any]:
        where = f"{self.path.name}, line {line}"
        if len(row) != len(self.columns):
            found = f"{len(row)} cells: {self.dialect.delimiter.join(row)[:60]!r}"
            hint = f'--csv comment="{_beginning(row)}" leaves out lines that begin so'
            if row and row[0][:1].isdigit():
                hint = "mend or delete that line, which looks like a row"
            raise InputError(where, found, f"{len(self.columns)} as in the first rows; {hint}")
        values: dict[str, Any] = {}
        for name in names:
            cell = row[index[name]]
            if cell in self.dialect.missing:
                values[name] = float("nan") if self._type(name) != pa.string() else None
            elif self._type(name) == pa.string():
                values[name] = cell
            elif HEXADECIMAL.fullmatch(cell):
                values[name] = int(cell, 16)
            else:
                plain = plain_number(cell, self.dialect.decimal, self.dialect.thousands)
                if not _NUMBER.fullmatch(plain) and plain.lower().lstrip("+-") not in ("inf", "infinity"):
                    hint = f'--csv missing="{cell[:20]}" takes it as no reading'
                    raise InputError(f"{where}, column {name}", repr(cell[:40]), f"a number; {hint}")
                values[name] = int(plain) if self._type(name) == pa.int64() else float(plain)
        return values


def _values(column: Any) -> Any:
    """Numbers as numpy arrays, text as one pyarrow array."""
    joined = column.combine_chunks()
    if isinstance(joined, pa.ChunkedArray):
        joined = pa.concat_arrays(joined.chunks) if joined.num_chunks else pa.array([], joined.type)
    if pa.types.is_string(joined.type):
        return joined
    return joined.to_numpy(zero_copy_only=False)


def _sample_rows(head: bytes, dialect: Dialect, whole: bool) -> list[list[str]]:
    text = codecs.getincrementaldecoder(dialect.encoding)("replace").decode(head)
    lines = re.split(r"\r\n|\n|\r", text)
    lines = lines[dialect.data_line - 1 :] if whole else lines[dialect.data_line - 1 : -1]
    rows = [
        cells_of(line, dialect.delimiter) for line in lines if line.strip() and not line.startswith(dialect.comment)
    ]
    rows = [row for row in rows if len(row) == len(dialect.names)]
    return rows if len(rows) <= _SAMPLE else [*rows[: _SAMPLE // 2], *rows[-_SAMPLE // 2 :]]


def _column(name: str, unit: str, dialect: Dialect, cells: Sequence[str]) -> Column:
    kind = kind_of_cells(cells, dialect.decimal, dialect.thousands)
    why = f"in line {dialect.units_line}" if unit else ""
    known = tuple("" if cell in MISSING else cell for cell in cells)
    return Column(name, unit or None, why, "number" if kind in ("number", "empty") else kind, known)  # type: ignore[arg-type]


def _unique(names: Sequence[str]) -> list[str]:
    """Names that differ: one without a name, or there twice, gets its number."""
    seen: set[str] = set()
    result = []
    for k, name in enumerate(names, start=1):
        one = name if name and name not in seen else f"{name} #{k}".strip()
        seen.add(one)
        result.append(one)
    return result


def _beginning(row: Sequence[str]) -> str:
    word = re.match(r"\W*\w*", row[0] if row else "")
    return word[0][:20] if word else ""


def _stated_rate(dialect: Dialect) -> dict[str, Any]:
    """Rows per second where a line above the header states them: `Sample rate: 100 Hz`."""
    for key, value in dialect.facts.items():
        found = re.match(r"([\d.,]+)\s*(k?hz|/s|sps|samples/s)?", value.lower())
        if re.search(r"sampl\w*.{0,3}(rate|freq)|abtastrate|^fs$|output data rate|^odr$", key) and found and found[2]:
            rate = float(found[1].replace(",", ".")) * (1000.0 if found[2] == "khz" else 1.0)
            return {"rate_hz": rate, "why_rate": f"{key}: {value}, above the rows"} if rate > 0.0 else {}
    return {}


def _words(dialect: Dialect) -> str:
    delimiter = {"\t": "tabs", "whitespace": "spaces"}.get(dialect.delimiter, repr(dialect.delimiter))
    head = f"header in line {dialect.header_line}" if dialect.header_line else "no header"
    units = f", units in line {dialect.units_line}" if dialect.units_line else ""
    return f"CSV, {dialect.encoding}, delimiter {delimiter}, decimals with {dialect.decimal!r}, {head}{units}"


_MOST_SHEETS = 20  # of a workbook that is a recording


def open_spreadsheet(path: Path) -> LoggerFile:
    """A workbook: each sheet with a header and rows is a table; formulas count by the value that was saved.

    Raises:
        InputError: openpyxl is not installed, the file is damaged, or no sheet holds rows of numbers.
    """
    openpyxl = library(path, "openpyxl", "excel", "a spreadsheet")
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    except Exception as error:  # whatever a damaged file makes of the parser
        what = " ".join(str(error).split())[:100]
        raise InputError(path.name, f"cannot be read as a spreadsheet ({what})", "a whole .xlsx file") from error
    folder = Path(tempfile.mkdtemp())
    tables: list[LoggerTable] = []
    refused: list[InputError] = []
    sheets = book.worksheets[:_MOST_SHEETS]
    for k, sheet in enumerate(sheets):
        place = folder / f"{k}.csv"
        with place.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerows([_cell(value) for value in row] for row in sheet.iter_rows(values_only=True))
        try:
            tables += _tables(place, sheet.title if len(sheets) > 1 else "")
        except InputError as error:
            refused.append(InputError(f"{path.name}, sheet {sheet.title}", error.found, error.expected))
    if not tables:
        raise refused[0] if refused else InputError(path.name, "no sheets", "a sheet with a header and rows")
    return LoggerFile(path, "spreadsheet", tuple(tables))


def _tables(place: Path, name: str) -> list[LoggerTable]:
    given = {"encoding": "utf-8", "delimiter": ",", "decimal": "."}
    return [replace(table, name=name) for table in open_csv(place, given).tables]


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, datetime):
        return value.isoformat(sep=" ")
    if isinstance(value, date | time):
        return value.isoformat()
    return repr(value) if isinstance(value, float) else str(value)
