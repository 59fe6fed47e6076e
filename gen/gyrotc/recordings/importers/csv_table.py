"""CSV of any dialect: what stands above the rows, then blocks of whole lines, read by pyarrow."""

from __future__ import annotations

import codecs
import itertools
import re
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from ...common.errors import InputError, quoted
from ..csv_file import blocks_of_lines, nuls_at_end, number_in, parsed
from ..tables import Chunk, Column, LoggerFile, LoggerTable
from .cells import (
    HEXADECIMAL,
    MISSING_WORDS,
    is_infinite,
    is_number,
    kind_of_cells,
    plain_lines,
    plain_number,
    split_line,
)
from .csv_dialect import Dialect, dialect_of, encoding_of, without_nuls
from .layout import can_be_row, other_names, row_misfit
from .map_file import CsvMap


def _lines_of(lines: bytes, number: int) -> Iterator[tuple[int, str]]:
    yield from enumerate(lines.decode("utf-8", "replace").split("\n"), start=number)


_HEAD_BYTES = 2**18  # for guessing a dialect: about a thousand lines
_MOST = 0.8  # share of the cells of a column of numbers that are numbers
_SAMPLE = 40  # rows, half of them from the end, where formats that change show


def open_csv(path: Path, given: CsvMap) -> LoggerFile:
    """A CSV file with its dialect, recognised from its head and `[csv]` of a map.

    Raises:
        InputError: No rows of numbers can be found.
    """
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    size, nuls = path.stat().st_size, 0
    if not (given.encoding or encoding_of(head)).lower().startswith("utf-16"):
        nuls = nuls_at_end(path, size)
    size -= nuls
    head, whole = head[:size], size <= len(head)
    if not head.strip():
        raise InputError(path.name, "is empty", "a header and rows")
    dialect = dialect_of(path.name, head, given, whole=whole)
    rows = _sample_rows(head, dialect, whole)
    columns = tuple(
        _column(name, unit, dialect, [row[k] for row in rows])
        for k, (name, unit) in enumerate(zip(_unique(dialect.names), dialect.units, strict=True))
    )
    table = CsvTable(
        name="",
        columns=columns,
        path=path,
        dialect=dialect,
        size=size,
        above=dialect.above,
        notes=(f"{nuls} NUL bytes behind the last row are no rows: the logger lost power",) if nuls else (),
        **_stated_rate(dialect),
    )
    return LoggerFile(path, _words(dialect), (table,), dialect.facts, dialect.kept())


@dataclass(frozen=True)
class CsvTable(LoggerTable):
    """The rows of a CSV file.

    Attributes:
        path: The file.
        dialect: How it is written.
        size: Bytes that are read; what is written meanwhile is not.
    """

    path: Path = Path()
    dialect: Dialect = field(default_factory=lambda: Dialect("utf-8", ",", ".", (), 0, 0, 1, (), ()))
    size: int = 0

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """Yield rows in order, a chunk for each block of lines; see `LoggerTable.chunks`."""
        first = 0
        left = Counter({"above the stated line of names": self.dialect.ignored})
        for lines, number, done in self._blocks():
            left["behind a mark of comments"] += self._commented_rows(lines)
            rows = self._rows(lines, number, names, left, last=done >= 1.0)
            chunk = Chunk(rows, first, done, {reason: count for reason, count in left.items() if count})
            yield chunk
            first += len(chunk)
            left.clear()

    def place(self, row: int) -> str:
        """Number of the line of a row."""
        at = 0
        for lines, number, _ in self._blocks():
            for line, text in _lines_of(lines, number):
                if self._is_line(text) and not self._is_header(text):
                    if at == row:
                        return f"line {line}"
                    at += 1
        return f"row {row + 1}"

    def cut_in_two(self, file: str, row: int) -> str:
        """The commands that make two files, each with all that is above the rows."""
        if self.dialect.encoding.startswith("utf-16"):
            return super().cut_in_two(file, row)
        line = int(self.place(row).rpartition(" ")[2])
        return _commands(
            file,
            f"head -n {line - 1} {{name}} > {{name}}.1.csv",
            f"(head -n {self.dialect.data_line - 1} {{name}}; tail -n +{line} {{name}}) > {{name}}.2.csv",
        )

    def turned_round(self, file: str) -> str:
        """The command that reverses the rows."""
        if self.dialect.encoding.startswith("utf-16"):
            return super().turned_round(file)
        first = self.dialect.data_line
        return _commands(file, f"(head -n {first - 1} {{name}}; tail -n +{first} {{name}} | tac) > {{name}}.csv")

    def _blocks(self) -> Iterator[tuple[bytes, int, float]]:
        one = self.dialect
        return blocks_of_lines(self.path, self.size, self.path.name, first=one.data_line, encoding=one.encoding)

    def _is_line(self, text: str) -> bool:
        return bool(text.strip()) and not text.startswith(self.dialect.comment)

    def _is_header(self, text: str) -> bool:
        cells = split_line(text, self.dialect.delimiter)
        names = [name for name in self.dialect.names if name]
        return (
            bool(self.dialect.header_line)
            and [c for c in cells if c] == names
            and not all(is_number(name, self.dialect.decimal) for name in names)
        )

    def _commented_rows(self, lines: bytes) -> int:
        """Number of lines that would be rows without the mark of comments that they begin with."""
        one, found = self.dialect, 0
        for mark in one.comment:
            octets = mark.encode()
            if lines.startswith(octets) or b"\n" + octets in lines:
                for line in re.findall(rb"(?m)^" + re.escape(octets) + rb"([^\n]*)", lines):
                    cells = split_line(line.decode("utf-8", "replace"), one.delimiter)
                    found += len(cells) == len(one.names) and can_be_row(cells, one.decimal)
        return found

    def _rows(
        self, lines: bytes, number: int, names: Sequence[str], left: Counter[str], *, last: bool
    ) -> dict[str, Any]:
        """The rows of a block; lines that are none are counted in `left`."""
        rows = self._fast(self._without_comments(lines), names)
        return self._slow(lines, number, names, left, last=last) if rows is None else rows

    def _without_comments(self, lines: bytes) -> bytes:
        for mark in self.dialect.comment:
            octets = mark.encode()
            if lines.startswith(octets) or b"\n" + octets in lines:
                lines = re.sub(rb"(?m)^" + re.escape(octets) + rb"[^\n]*\n?", b"", lines)
        if self.dialect.delimiter == "whitespace":
            lines = re.sub(rb"[ \t]+", b" ", lines)
            lines = re.sub(rb"(?m)^ | $", b"", lines)
        elif self.dialect.thousands or self.dialect.spaced_sign:
            one = self.dialect
            lines = plain_lines(lines, one.delimiter, one.thousands, spaced_sign=one.spaced_sign)
        return lines

    def _fast(self, lines: bytes, names: Sequence[str]) -> dict[str, Any] | None:
        """The rows of lines, None where one is no row."""
        if not lines.strip():
            return {name: np.empty(0) for name in names}
        batch = parsed(
            lines,
            [column.name for column in self.columns],
            {name: self._type(name) for name in names},
            delimiter=" " if self.dialect.delimiter == "whitespace" else self.dialect.delimiter,
            decimal=self.dialect.decimal,
            missing=self.dialect.missing,
        )
        return {name: _values(batch.column(name)) for name in names} if batch is not None else None

    def _type(self, name: str) -> pa.DataType:
        column = self.column(name)
        if column is None or column.kind != "number":
            return pa.string()
        long = [c for c in column.sample if len(c) >= 16]
        whole = long and all(re.fullmatch(r"[+-]?\d{16,18}|", c) for c in column.sample)
        counted = any(column.sample) and all(HEXADECIMAL.fullmatch(c) for c in column.sample if c)
        return pa.int64() if whole or counted else pa.float64()

    def _slow(
        self, lines: bytes, number: int, names: Sequence[str], left: Counter[str], *, last: bool
    ) -> dict[str, Any]:
        """The rows of a block cell by cell.

        Raises:
            InputError: A line that is no row; it says what goes on.
        """
        index = {column.name: k for k, column in enumerate(self.columns)}
        cells: dict[str, list[Any]] = {name: [] for name in names}
        every = [(line, text) for line, text in _lines_of(lines, number) if self._is_line(text)]
        torn = last and not lines.endswith((b"\n", b"\r"))
        for k, (line, text) in enumerate(every):
            if self._is_header(text):
                left["repeated header lines"] += 1
                continue
            try:
                parsed = self._parsed(line, text, names, index, every[k + 1][1] if k + 1 < len(every) else None)
            except InputError:
                if torn and k == len(every) - 1:
                    left["unfinished last line"] += 1
                    break
                raise
            for name, value in parsed.items():
                cells[name].append(value)
        return {
            name: np.array(values, dtype=np.int64 if self._type(name) == pa.int64() and _whole(values) else np.float64)
            if self._type(name) != pa.string()
            else pa.array(values, pa.string())
            for name, values in cells.items()
        }

    def _parsed(
        self, line: int, text: str, names: Sequence[str], index: dict[str, int], following: str | None
    ) -> dict[str, Any]:
        one = self.dialect
        if "\x00" in text:
            raise InputError(f"{self.path.name}, line {line}", "NUL bytes", without_nuls(self.path.name))
        row = split_line(text, one.delimiter)
        if len(row) != len(self.columns):
            layout = (len(self.columns), one.delimiter, one.decimal, one.data_line)
            raise row_misfit(self.path.name, line, row, layout, following)
        return {name: self._value(line, row, name, row[index[name]]) for name in names}

    def _value(self, line: int, row: list[str], name: str, cell: str) -> Any:
        one, kind = self.dialect, self._type(name)
        if cell in one.missing:
            return float("nan") if kind != pa.string() else None
        if kind == pa.string():
            return cell
        if HEXADECIMAL.fullmatch(cell):
            return int(cell, 16)
        plain = plain_number(cell, one.decimal, one.thousands)
        value = number_in(plain)
        if value is None and is_infinite(plain):
            value = float(plain)
        if value is not None:
            return int(plain) if kind == pa.int64() and plain.lstrip("+-").isdigit() else value
        if len(row) > 1 and not any(c in one.missing or is_number(c, one.decimal, one.thousands) for c in row):
            raise other_names(self.path.name, line, row)
        hint = f'--set csv.missing="{cell[:20]}" takes it as no reading'
        raise InputError(f"{self.path.name}, line {line}, column {name}", quoted(cell), f"a number; {hint}")


def _commands(file: str, *commands: str) -> str:
    """Return shell commands on a file of text, which unpack it first if it is packed."""
    packed = file.lower().endswith(".gz")
    name = shlex.quote(file[: -len(".gz")] if packed else file)
    unpacked = [f"gunzip -k {shlex.quote(file)}"] if packed else []
    return ", ".join(f"`{command}`" for command in [*unpacked, *(command.format(name=name) for command in commands)])


def _whole(values: Sequence[Any]) -> bool:
    return all(isinstance(value, int) for value in values)


def _values(column: pa.Array) -> Any:
    """Return numbers as numpy arrays and text as it is."""
    return column if pa.types.is_string(column.type) else column.to_numpy(zero_copy_only=False)


def _sample_rows(head: bytes, dialect: Dialect, whole: bool) -> list[list[str]]:
    text = codecs.getincrementaldecoder(dialect.encoding)("replace").decode(head)
    lines = re.split(r"\r\n|\n|\r", text)
    lines = lines[dialect.data_line - 1 :] if whole else lines[dialect.data_line - 1 : -1]
    rows = [
        split_line(line, dialect.delimiter) for line in lines if line.strip() and not line.startswith(dialect.comment)
    ]
    rows = [row for row in rows if len(row) == len(dialect.names)]
    return rows if len(rows) <= _SAMPLE else [*rows[: _SAMPLE // 2], *rows[-_SAMPLE // 2 :]]


def _column(name: str, unit: str, dialect: Dialect, cells: Sequence[str]) -> Column:
    kind = kind_of_cells(cells, dialect.decimal, dialect.thousands)
    why = f"in line {dialect.units_line}" if unit else ""
    known = tuple("" if cell in MISSING_WORDS else cell for cell in cells)
    held = [cell for cell in known if cell]
    numbers = sum(is_number(cell, dialect.decimal, dialect.thousands) for cell in held)
    if kind == "empty" or (kind == "text" and numbers > _MOST * len(held)):  # its words are refused with their line
        kind = "number"
    return Column(name, unit or None, why, kind, known)  # type: ignore[arg-type]


def _unique(names: Sequence[str]) -> list[str]:
    """Return distinct names: a column without a name, or with a repeated one, gets its number or the next free one."""
    seen: set[str] = set()
    result = []
    for place, name in enumerate(names, start=1):
        numbered = (f"{name} #{number}".strip() for number in itertools.count(place))
        one = name if name and name not in seen else next(other for other in numbered if other not in seen)
        seen.add(one)
        result.append(one)
    return result


def _stated_rate(dialect: Dialect) -> dict[str, Any]:
    """Return the fields of a table for the rows per second of a line above the header: `Sample rate: 100 Hz`."""
    for key, value in dialect.facts.items():
        found = re.match(r"([\d.,]+)\s*(k?hz|/s|sps|samples/s)?", value.lower())
        number = number_in(found[1].replace(",", ".")) if found else None
        named = re.search(r"sampl\w*.{0,3}(rate|freq)|abtastrate|^fs$|output data rate|^odr$", key)
        if named and found and found[2] and number is not None:
            rate = number * (1000.0 if found[2] == "khz" else 1.0)
            return {"rate_hz": rate, "why_rate": f"{key}: {value}, above the rows"} if rate > 0.0 else {}
    return {}


def _words(dialect: Dialect) -> str:
    delimiter = {"\t": "tabs", "whitespace": "spaces"}.get(dialect.delimiter, repr(dialect.delimiter))
    head = f"header in line {dialect.header_line}" if dialect.header_line else "no header"
    units = f", units in line {dialect.units_line}" if dialect.units_line else ""
    return f"CSV, {dialect.encoding}, delimiter {delimiter}, decimals with {dialect.decimal!r}, {head}{units}"
