"""CSV recordings: fast reading by pyarrow, and a slow look at a file that cannot be read, to say why.

Read are UTF-8 text with or without byte order mark, LF or CRLF, quotes and spaces around cells, empty lines,
a last line without end. A last line that was torn off in the middle (a recording that still grows, a logger
that lost power) is left out.
"""

from __future__ import annotations

import csv
import io
import re
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.inputs import need_memory, open_input, refuse_above
from .files import Prefix, Source
from .values import Fault

__all__ = ["CsvFile"]

_BLOCK_BYTES = 2**20  # of a read: bounds memory
_LONGEST_LINE = 2**20  # bytes: a row has at most some hundred columns of 25 characters
_COPIES = 2.0  # of the columns while they are checked
_IMPORT = "`gyrotc import` reads other forms"
_NAN = ("nan", "+nan", "-nan")
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_TORN_NUMBER = re.compile(r"[+-]?([0-9]*\.?[0-9]*|([0-9]+\.?[0-9]*|\.[0-9]+)[eE][+-]?)")


class CsvFile(Source):
    """One CSV file, as long as it was when it was opened.

    Args:
        name: Name in messages.
        path: Where it is.

    Raises:
        InputError: It cannot be read, is no text, is empty or has no header.
    """

    row_unit = "line"

    def __init__(self, name: str, path: Path) -> None:
        self.name = name
        self.path = path
        try:
            file, size = open_input(path, name, "a CSV file")
            with file:
                refuse_above("recording_mib", size / 2**20, name, "MiB")
                head = io.BytesIO(file.read(min(size, _LONGEST_LINE))).readline()
            self.names = _header(name, head)
            refuse_above("columns", len(self.names), f"{name}, line 1", "columns")
            self._head = len(head)
            self.size, self.torn = _without_torn_line(path, size, len(head), len(self.names))
            self.keep_as_read()
        except OSError as error:
            raise InputError(name, f"cannot be read ({error.strerror})", "a readable file") from error

    def read(self, columns: Sequence[str]) -> dict[str, FloatArray] | None:
        """As `Source.read`, fast: by pyarrow, a few lines at a time.

        pyarrow's own streaming reader reads ahead in threads of its own, which outlive a file given up half-way.
        """
        unique = [f"{index} {name}" for index, name in enumerate(self.names)]
        options = pacsv.ConvertOptions(
            column_types=dict.fromkeys(unique, pa.float64()),
            include_columns=[unique[self.names.index(name)] for name in columns],
            null_values=[""],  # NaN is a number that is missing, read as such
        )
        at_once = pacsv.ReadOptions(use_threads=False, block_size=2**30, column_names=unique)
        most = self._most_rows()
        refuse_above("rows", most, self.name, "rows")
        need_memory(_COPIES * 8.0 * most * len(columns), self.name, f"{most} rows of {len(columns)} columns")
        read = {name: np.empty(most) for name in columns}
        at = 0
        try:
            for lines in self._blocks_of_lines():
                table = pacsv.read_csv(pa.BufferReader(lines), at_once, convert_options=options)
                for column, values in zip(read.values(), table.columns, strict=True):
                    if values.null_count:
                        return None
                    column[at : at + len(table)] = values.to_numpy()
                at += len(table)
        except pa.ArrowInvalid:
            return None
        return {name: column[:at] for name, column in read.items()}

    def _most_rows(self) -> int:
        """A number that the rows do not exceed: all line ends, of either kind, and a last line without; nor can
        there be more than cells of one character have room for.
        """
        ends = 0
        with Prefix(self.path, self.size) as prefix:
            while block := prefix.read(_BLOCK_BYTES):
                ends += block.count(b"\n") + block.count(b"\r")
        return min(ends, self.size // (2 * len(self.names))) + 1

    def _blocks_of_lines(self) -> Iterator[bytes]:
        """Whole lines below the header, about `_BLOCK_BYTES` at a time.

        Raises:
            pa.ArrowInvalid: A line is far too long.
        """
        with Prefix(self.path, self.size) as prefix:
            prefix.read(self._head)
            rest = b""
            while block := prefix.read(_BLOCK_BYTES):
                block = rest + block
                end = max(block.rfind(b"\n"), block.rfind(b"\r")) + 1
                if end == 0 and len(block) > _LONGEST_LINE:
                    raise pa.ArrowInvalid("no line end")
                if block[:end].strip():
                    yield block[:end]
                rest = block[end:]
            if rest.strip():
                yield rest

    def scan(self) -> tuple[dict[str, FloatArray], list[int], list[Fault]]:
        """As `Source.scan`, line by line."""
        cells: list[array[float]] = [array("d") for _ in self.names]
        lines = array("q")
        seen = _Faults()
        for number, line in self._lines():
            row = [_bare(cell) for cell in line.split(",")]
            if "\x00" in line:
                seen.add(number, "", "NUL byte", "a NUL byte (binary or damaged)", "text")
            elif len(row) != len(self.names):
                found = f"{len(row)} cells" if len(row) != 1 else "1 cell"
                seen.add(number, "", "ragged", found, f"{len(self.names)} as in the header")
            else:
                lines.append(number)
                for name, column, cell in zip(self.names, cells, row, strict=True):
                    column.append(seen.number(number, name, cell))
        columns = {name: np.array(column) for name, column in zip(self.names, cells, strict=True)}
        return columns, list(lines), seen.faults()

    def place(self, row: int) -> int:
        """Line number of a row."""
        for index, (number, _) in enumerate(self._lines()):
            if index == row:
                return number
        raise IndexError(row)

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Lines below the header that are not empty, with their numbers."""
        with Prefix(self.path, self.size) as prefix:
            text = io.TextIOWrapper(io.BufferedReader(prefix), encoding="utf-8", errors="replace")
            lines = iter(lambda: text.readline(_LONGEST_LINE), "")
            for number, line in enumerate(lines, start=1):
                if len(line) == _LONGEST_LINE:
                    where = f"{self.name}, line {number}"
                    raise InputError(where, f"{_LONGEST_LINE} characters and no end", "lines of cells")
                if number > 1 and line.rstrip("\r\n"):
                    yield number, line.rstrip("\r\n")


class _Faults:
    """Faults of cells, the first of each kind in each column, with their number."""

    def __init__(self) -> None:
        self._seen: dict[tuple[str, str], list[int]] = {}
        self._text: dict[tuple[str, str], tuple[str, str]] = {}

    def add(self, line: int, column: str, kind: str, found: str, expected: str) -> None:
        first = self._seen.setdefault((column, kind), [line, 0])
        first[1] += 1
        self._text.setdefault((column, kind), (found, expected))

    def number(self, line: int, column: str, cell: str) -> float:
        """The number in a cell; NaN and a fault if there is none."""
        if _NUMBER.fullmatch(cell):
            return float(cell)
        if cell.lower() in _NAN:
            return float("nan")
        if not cell:
            self.add(line, column, "empty", "an empty cell", "a number")
        else:
            self.add(line, column, "text", repr(cell[:40]), f"a number with a decimal point; {_IMPORT}")
        return float("nan")

    def faults(self) -> list[Fault]:
        return [
            Fault(line, column, count, *self._text[column, kind])
            for (column, kind), (line, count) in self._seen.items()
        ]


def _header(name: str, head: bytes) -> tuple[str, ...]:
    where = f"{name}, line 1"
    if not head:
        raise InputError(name, "is empty", "a header and rows")
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(name, "UTF-16 text", f"UTF-8 text; {_IMPORT}")
    if b"\x00" in head or len(head) == _LONGEST_LINE:
        raise InputError(name, "binary data", f"CSV text with a header; {_IMPORT}")
    try:
        text = head.decode("utf-8-sig").rstrip("\r\n")
    except UnicodeDecodeError:
        raise InputError(where, "bytes that are no UTF-8", f"CSV text in UTF-8; {_IMPORT}") from None
    if "\r" in text:
        raise InputError(where, "carriage returns inside a line", "line ends of LF or CRLF")
    if "," not in text:
        for mark, what in ((";", "semicolons"), ("\t", "tabs")):
            if mark in text:
                expected = f"commas between columns and points in decimals; {_IMPORT}"
                raise InputError(where, f"{what} between columns", expected)
    cells = next(csv.reader([text], skipinitialspace=True), [])
    names = tuple(_bare(cell) for cell in cells)
    if not names or all(_NUMBER.fullmatch(cell) for cell in names):
        raise InputError(
            where, "no header" if names else "an empty line", f"the names of the columns; {_IMPORT}"
        )
    return names


def _bare(cell: str) -> str:
    """A cell without the spaces and quotes around it."""
    return cell.strip().strip('"').strip()


def _without_torn_line(path: Path, size: int, head: int, columns: int) -> tuple[int, str]:
    """Size without a torn last line (no line end, and cells missing or a number cut), and that line."""
    start = max(head, size - _LONGEST_LINE)
    file, _ = open_input(path, path.name, "a CSV file")
    with file:
        file.seek(start)
        tail = file.read(size - start)
    at = max(tail.rfind(b"\n"), tail.rfind(b"\r")) + 1
    line = tail[at:].decode("utf-8", "replace")
    cells = [cell.strip() for cell in line.split(",")]
    whole = len(cells) == columns and _NUMBER.fullmatch(cells[-1])
    cut = _NUMBER.fullmatch(cells[-1]) or _TORN_NUMBER.fullmatch(cells[-1])
    numbers = cut and all(_NUMBER.fullmatch(cell) for cell in cells[:-1])
    if not line or whole or not numbers or len(cells) > columns:
        return size, ""
    return start + at, line
