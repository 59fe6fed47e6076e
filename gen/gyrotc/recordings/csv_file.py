"""Recordings as CSV, read in blocks of whole lines.

Read are UTF-8 text with or without byte order mark, LF or CRLF, quotes and spaces around cells, empty lines, a last
line without end. pyarrow reads the blocks; a block that it cannot make numbers of is read cell by cell, so that every
fault is named with its line. A last line that was torn off in the middle is left out (a recording that still grows, a
logger that lost power).
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from ..common.arrays import FloatArray, numpy_of
from ..common.errors import InputError, quoted
from ..common.inputs import need_memory, open_input, refuse_above
from .description import Fault
from .sources import BLOCK_BYTES, Prefix, Source

_LONGEST_LINE = 2**20  # bytes: a row has at most some hundred columns of 25 characters
_COPIES = 2.0  # of the columns while they are checked
_IMPORT = "`gyrotc import` reads other forms"
_NAN = ("nan", "+nan", "-nan")
LONGEST_NUMBER = 64  # characters: a float64 needs 25
_BEGINS = frozenset("0123456789.")  # of a number behind its sign


def number_in(cell: str) -> float | None:
    """The number that a cell holds, written with a point; None where it holds none, or a word such as nan."""
    if len(cell) > LONGEST_NUMBER or not cell.isascii() or "_" in cell or cell.lstrip("+-")[:1] not in _BEGINS:
        return None
    try:
        return float(cell)
    except ValueError:
        return None


def blocks_of_lines(
    path: Path, size: int, name: str, *, first: int = 2, encoding: str = "utf-8"
) -> Iterator[tuple[bytes, int, float]]:
    """Blocks of whole lines in UTF-8 with line ends of LF, the number of their first line, and the share read.

    Args:
        size: Number of bytes that are read.
        name: Name of the file in messages.
        first: Number of the first line that is wanted; the header is line 1.

    Raises:
        InputError: Bytes that the encoding does not know, or a line without end.
    """
    decoder = codecs.getincrementaldecoder(encoding)("strict")
    plain = encoding in ("utf-8", "utf-8-sig", "ascii")
    rest, number, left = b"", 1, size
    with Prefix(path, size) as prefix:
        while block := prefix.read(BLOCK_BYTES):
            left -= len(block)
            try:
                text = block if plain else decoder.decode(block, final=not left).encode()
            except UnicodeDecodeError as error:
                found, place = f"bytes that are no {encoding}", number + rest.count(b"\n")
                raise InputError(f"{name}, after line {place}", found, "another --set csv.encoding=...") from error
            block = _with_lf(rest + text, last=not left)
            end = len(block) if not left else block.rfind(b"\n") + 1
            if end == 0 and len(block) > _LONGEST_LINE:
                raise InputError(f"{name}, line {number}", f"{len(block)} bytes and no end", "lines of cells")
            lines, rest = block[:end], block[end:]
            count = lines.count(b"\n")
            if number < first:
                skipped = min(first - number, count)
                lines = lines.split(b"\n", skipped)[skipped] if skipped else lines
                number += skipped
                count -= skipped
            if number >= first and lines.strip():
                yield lines.removeprefix(codecs.BOM_UTF8), number, 1.0 - left / size
            number += count
    if left:
        raise InputError(name, f"became {left} bytes shorter while it was read", "a file that stays as it is")


def _lines_held(lines: bytes) -> int:
    """Number of lines that are not empty."""
    if lines.startswith(b"\n") or b"\n\n" in lines:
        lines = re.sub(rb"\n+", b"\n", lines).removeprefix(b"\n")
    return lines.count(b"\n") + (not lines.endswith(b"\n") and bool(lines))


def _with_lf(block: bytes, *, last: bool) -> bytes:
    """Line ends of any kind as LF; a carriage return that ends the block waits for the next one."""
    if b"\r" not in block:
        return block
    if block.endswith(b"\r") and not last:
        return block[:-1].replace(b"\r\n", b"\n").replace(b"\r", b"\n") + b"\r"
    return block.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def parsed(
    lines: bytes,
    names: Sequence[str],
    types: Mapping[str, pa.DataType],
    *,
    delimiter: str = ",",
    decimal: str = ".",
    missing: Sequence[str] = ("",),
) -> pa.RecordBatch | None:
    """The columns that have a type, of lines without a header; NaN is a number, null stands for `missing`.

    pyarrow's own streaming reader reads ahead in threads of its own, which outlive a file given up half-way.

    Args:
        names: Of all columns; they differ.

    Returns:
        The rows; None where a line has another number of cells, a cell is no value of its type, or a quote that stays
        open joins lines.
    """
    try:
        table = pacsv.read_csv(
            pa.BufferReader(lines),
            pacsv.ReadOptions(use_threads=False, block_size=2**30, column_names=list(names)),
            pacsv.ParseOptions(delimiter=delimiter),
            pacsv.ConvertOptions(
                column_types=dict(types),
                include_columns=list(types),
                null_values=list(missing),
                strings_can_be_null=True,
                decimal_point=decimal,
                check_utf8=False,
            ),
        )
    except (pa.ArrowInvalid, pa.ArrowKeyError):
        return None
    if len(table) != _lines_held(lines):
        return None
    batches = table.combine_chunks().to_batches()
    return batches[0] if batches else pa.RecordBatch.from_pylist([], schema=table.schema)


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
            self.size, self.torn = _without_torn_line(path, size, len(head), len(self.names))
            self.keep_as_read()
        except OSError as error:
            raise InputError(name, f"cannot be read ({error.strerror})", "a readable file") from error

    def read(self, columns: Sequence[str]) -> dict[str, FloatArray] | None:
        """Read columns by the fast parser; see `Source.read`."""
        unique = [f"{index} {name}" for index, name in enumerate(self.names)]
        wanted = {unique[self.names.index(name)]: pa.float64() for name in columns}
        most = self._most_rows()
        refuse_above("rows", most, self.name, "rows")
        need_memory(_COPIES * 8.0 * most * len(columns), self.name, f"{most} rows of {len(columns)} columns")
        read = {name: np.empty(most) for name in columns}
        at = 0
        for lines, _, _ in blocks_of_lines(self.path, self.size, self.name):
            batch = parsed(lines, unique, wanted)
            if batch is None or any(values.null_count for values in batch.columns):
                return None
            for column, values in zip(read.values(), batch.columns, strict=True):
                column[at : at + len(batch)] = numpy_of(values)
            at += len(batch)
        return {name: column[:at] for name, column in read.items()}

    def _most_rows(self) -> int:
        """A number that the rows do not exceed: all line ends, of either kind, and a last line without; nor can
        there be more than cells of one character have room for.
        """
        ends = 0
        with Prefix(self.path, self.size) as prefix:
            while block := prefix.read(BLOCK_BYTES):
                ends += block.count(b"\n") + block.count(b"\r")
        return min(ends, self.size // (2 * len(self.names))) + 1

    def scan(self) -> tuple[dict[str, FloatArray], list[int], list[Fault]]:
        """Read line by line what `read` cannot; see `Source.scan`."""
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
        if (value := number_in(cell)) is not None:
            return value
        if cell.lower() in _NAN:
            return float("nan")
        if not cell:
            self.add(line, column, "empty", "an empty cell", "a number")
        else:
            self.add(line, column, "text", quoted(cell), f"a number with a decimal point; {_IMPORT}")
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
    if not names or all(number_in(cell) is not None for cell in names):
        raise InputError(where, "no header" if names else "an empty line", f"the names of the columns; {_IMPORT}")
    return names


def nuls_at_end(path: Path, size: int) -> int:
    """Number of NUL bytes at the end of a file of text: what a logger that lost power had not written yet."""
    file, _ = open_input(path, path.name, "a file of text")
    count = 0
    with file:
        while count < size:
            start = max(size - count - BLOCK_BYTES, 0)
            file.seek(start)
            block = file.read(size - count - start)
            held = len(block.rstrip(b"\x00"))
            count += len(block) - held
            if held:
                break
    return count


def _bare(cell: str) -> str:
    """A cell without the spaces and quotes around it."""
    return cell.strip().strip('"').strip()


def _without_torn_line(path: Path, size: int, head: int, columns: int) -> tuple[int, str]:
    """Size without a torn last line (no line end, and cells missing or a number cut), and that line."""
    nuls = nuls_at_end(path, size)
    size -= nuls
    start = max(head, size - _LONGEST_LINE)
    file, _ = open_input(path, path.name, "a CSV file")
    with file:
        file.seek(start)
        tail = file.read(size - start)
    at = max(tail.rfind(b"\n"), tail.rfind(b"\r")) + 1
    line = tail[at:].decode("utf-8", "replace")
    cells = [cell.strip() for cell in line.split(",")]
    whole = len(cells) == columns and number_in(cells[-1]) is not None
    cut = number_in(f"{cells[-1]}0") is not None  # a digit more makes a number of what was torn off within one
    numbers = cut and all(number_in(cell) is not None for cell in cells[:-1])
    if not line or whole or not numbers or len(cells) > columns:
        return size, f"{nuls} NUL bytes" if nuls else ""
    return start + at, line
