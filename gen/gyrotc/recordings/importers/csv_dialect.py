"""Recognise the dialect of a CSV file: encoding, comments, delimiter, decimal mark, header, kinds of cells.

What is decided can be seen and overruled: it stands in the map under `[csv]`.
"""

from __future__ import annotations

import codecs
import re
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from ...common.errors import InputError, quoted
from ..units import quantity_of
from .cells import DELIMITERS, MISSING_WORDS, is_number, kind_of_cells, split_line, thousands_of
from .layout import check_between, first_row, rows_among
from .map_file import CsvMap
from .stamps import forms_of

_FACTS = re.compile(r"^\W*(?P<key>[A-Za-z][\w .#/]{1,40}?)\s*[:=,;\t]+\s*(?P<value>[^;,\t]+?)[\s;,]*$")
_LONGEST_FACT = 400  # characters of a line
_UNITS_LABEL = re.compile(r"(?:y_)?units?(?:_label)?:?|einheit(?:en)?:?", re.IGNORECASE)


def in_comments(
    lines: Sequence[str], comment: tuple[str, ...], data_line: int, delimiter: str, count: int
) -> list[tuple[int, list[str]]]:
    """Commented lines above the rows with as many cells as they: a header that is a comment."""
    found = []
    for k, line in enumerate(lines[: data_line - 1], start=1):
        mark = next((m for m in comment if line.startswith(m)), None)
        cells = _rejoined(split_line(line[len(mark) :].strip(), delimiter), count) if mark else []
        if len(cells) == count and count > 1:
            found.append((k, cells))
    return found


def _rejoined(cells: list[str], count: int) -> list[str]:
    """Join each unit in brackets to the name before it, if cells between blanks are more than columns."""
    if len(cells) <= count:
        return cells
    joined: list[str] = []
    for cell in cells:
        if joined and re.fullmatch(r"[\[(].*[\])]", cell):
            joined[-1] += f" {cell}"
        else:
            joined.append(cell)
    return joined


def header_of(
    above: Sequence[tuple[int, list[str]]], count: int, given: CsvMap, decimal: str
) -> tuple[int, int, tuple[str, ...], tuple[str, ...]]:
    """Line of the names, line of the units, names, units; made-up names where there is no header."""
    rows = [
        (k, cells) for k, cells in above if _fits_header(cells, count, decimal) and not _UNITS_LABEL.fullmatch(cells[0])
    ]
    rows += [(k, _rejoined(cells, count)) for k, cells in above if len(cells) > count]
    rows = sorted((k, cells) for k, cells in rows if _fits_header(cells, count, decimal))
    if given.header_line is not None:
        rows = [(k, cells) for k, cells in above if k == given.header_line]
        rows += [(k, cells) for k, cells in above if k == given.units_line]
    if not rows:
        return 0, 0, tuple(f"column {k + 1}" for k in range(count)), ("",) * count
    units_line, units = _labelled(above, count)
    of_units = [k for k in range(1, len(rows)) if _is_units(rows[k][1]) or rows[k][0] == given.units_line]
    if of_units:
        units_line, cells = rows[of_units[-1]]
        rows = rows[: of_units[-1]]
        units = [cell.strip("[](){} ") for cell in _padded(cells, count)]
    line, cells = rows[-1]
    names = _padded(cells, count)
    if len(set(names) - {""}) < len([n for n in names if n]) and len(rows) > 1:
        names = _with_group(_padded(rows[-2][1], count), names)
    names = [name.strip().strip("'\ufeff") for name in names]
    return line, units_line, tuple(names), tuple("" if u in ("-", "1", "none") else u for u in units)


def _labelled(above: Sequence[tuple[int, list[str]]], count: int) -> tuple[int, list[str]]:
    """Return number and units of the last line above the rows whose first cell says that it holds units."""
    line, units = 0, [""] * count
    for k, cells in above:
        if cells and _UNITS_LABEL.fullmatch(cells[0]) and any(quantity_of(cell) for cell in cells[1:] if cell):
            line, units = k, ["", *_padded(cells[1:], count - 1)[: count - 1]]
    if any(cells[:2] == ["X_Dimension", "Time"] for _, cells in above):
        units[0] = "s"  # of a LabVIEW measurement file
    return line, units


def _fits_header(cells: Sequence[str], count: int, decimal: str) -> bool:
    """A header has as many cells as the rows (one less where the rows end with a delimiter), and words."""
    if not (len(cells) == count or (len(cells) == count - 1 and count > 2)):
        return False
    return any(cell and not is_number(cell, decimal) for cell in cells)


def _padded(cells: Sequence[str], count: int) -> list[str]:
    return [*cells, *[""] * (count - len(cells))]


def _is_units(cells: Sequence[str]) -> bool:
    """Test whether a line holds units.

    At least one of its words is a unit of time, temperature or rate, and half of them are units; two fifths are
    enough if two are units of these.
    """
    words = [cell.strip("[](){} ") for cell in cells if cell.strip("[](){} -1")]
    known = sum(
        quantity_of(word) is not None
        or any(cell.strip()[:1] in "[(" and word in cell for cell in cells if cell.strip())
        for word in words
    )
    of_kinds = sum(quantity_of(word) is not None for word in words)
    return bool(words) and of_kinds > 0 and (known >= 0.5 * len(words) or (of_kinds > 1 and known >= 0.4 * len(words)))


def _with_group(groups: Sequence[str], names: Sequence[str]) -> list[str]:
    """Return names under headings; each heading holds until the next one."""
    joined, heading = [], ""
    for group, name in zip(groups, names, strict=True):
        heading = group or heading
        joined.append(f"{heading} {name}".strip() if heading != name else name)
    return joined


def facts_above(lines: Sequence[str], header: int) -> dict[str, str]:
    """`key: value` lines above the header."""
    return dict(_fact_pairs([line for k, line in enumerate(lines, start=1) if k != header][:200]))


def _fact_pairs(lines: Sequence[str]) -> Iterator[tuple[str, str]]:
    for line in lines:
        if len(line) <= _LONGEST_FACT and (found := _FACTS.match(line.lstrip("#%!*/ "))):
            yield found["key"].strip().lower(), found["value"].strip().strip('"')


_COMMENTS = ("#", "%", "//", "!", "*")
# Found and expected, for a file that is no text.
_BINARY = ("binary data of no known format", "CSV from the program that wrote it, or a format of docs/import.md")
_ENOUGH = 0.8  # share of the rows below a header that must be numbers: loggers leave cells empty
_LAST, _FEWEST = 60, 5  # lines that are looked at, at most and at least
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Dialect:
    """Dialect of a CSV file.

    Attributes:
        encoding: Name of the codec.
        delimiter: One character, or "whitespace".
        decimal: "." or ",".
        comment: Beginnings of lines that hold no rows.
        header_line: Line of the names, from 1; 0: there is none.
        units_line: Line of the units, from 1; 0: there is none.
        data_line: First line of rows, from 1.
        above: Lines above it that hold something else than rows, and are no comments.
        ignored: Rows above a line of names that was stated.
        names: Names of the columns; empty for a column that only ends the lines.
        units: Units by column, empty where none are given.
        missing: What cells without a number hold.
        thousands: The mark between thousands; empty: there is none.
        spaced_sign: Signs are separate from the digits.
        facts: `key: value` lines above the header.
    """

    encoding: str
    delimiter: str
    decimal: str
    comment: tuple[str, ...]
    header_line: int
    units_line: int
    data_line: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    missing: tuple[str, ...] = MISSING_WORDS
    thousands: str = ""
    spaced_sign: bool = False
    above: int = 0
    ignored: int = 0
    facts: dict[str, str] = field(default_factory=dict)

    def kept(self) -> dict[str, str]:
        """Return what an import map keeps of the dialect for the next file of the logger."""
        found = {"encoding": self.encoding, "delimiter": self.delimiter, "decimal": self.decimal}
        return found | ({"thousands": self.thousands} if self.thousands else {})


def dialect_of(name: str, head: bytes, given: CsvMap, *, whole: bool) -> Dialect:
    """The dialect of a file.

    Args:
        name: Name of the file, for messages.
        head: Its first bytes.
        given: `[csv]` of a map; its keys are not guessed.
        whole: Whether the head is all of the file.

    Raises:
        InputError: No rows of numbers can be found.
    """
    encoding = given.encoding or encoding_of(head)
    text = _text(name, head, encoding)
    lines = re.split(r"\r\n|\n|\r", text)[: None if whole else -1]
    comment = _comments(lines, given)
    kept = _kept(name, lines, comment)
    delimiter, decimal = _separators(name, [line for _, line in kept], given)
    split = [(k, split_line(line, delimiter)) for k, line in kept]
    count = Counter((len(cells) for _, cells in _last(split))).most_common(1)[0][0]
    stated = given.header_line or 0
    skipped = sum(k < stated for k, _ in kept)
    guessed = _first_row(name, split, count, decimal, stated)
    first = skipped + first_row(name, kept[skipped:], guessed - skipped, count, delimiter, decimal)
    ignored = len(rows_among(kept[:skipped], delimiter, decimal))
    above = [(k, cells) for k, cells in split if k < split[first][0]]
    above += in_comments(lines, comment, split[first][0], delimiter, count) if not above else []
    header, units_line, names, units = header_of(above, count, given, decimal)
    _check_commas(name, header, above, count)
    if header:
        between = [(k, line) for k, line in kept[:first] if k > max(header, units_line)]
        begins = check_between(name, between, count, delimiter, decimal)
        first = next((n for n, (k, _) in enumerate(kept) if k == begins), first)
    return Dialect(
        encoding=encoding,
        delimiter=delimiter,
        decimal=decimal,
        comment=comment,
        header_line=header,
        units_line=units_line,
        data_line=split[first][0],
        above=first - ignored,
        ignored=ignored,
        names=names,
        units=units,
        missing=(*MISSING_WORDS, *given.missing),
        **_digits([cell for _, row in split[first:] for cell in row], decimal, given),
        facts=facts_above(lines[: split[first][0] - 1], header),
    )


def _kept(name: str, lines: Sequence[str], comment: tuple[str, ...]) -> list[tuple[int, str]]:
    """List the lines that hold something, with their numbers.

    Raises:
        InputError: There is none.
    """
    kept = [(k, line) for k, line in enumerate(lines, start=1) if line.strip() and not line.startswith(comment)]
    if not kept:
        raise InputError(name, "no lines of rows", "a header and rows of numbers")
    return kept


def _check_commas(name: str, header: int, above: Sequence[tuple[int, list[str]]], count: int) -> None:
    """One mark does not part both columns and decimals.

    Raises:
        InputError: It does: the rows have two cells for each name.
    """
    if not header and above and 2 * len(above[-1][1]) == count > 2:
        found = f"{count // 2} names above rows of {count} cells: one mark parts columns and decimals"
        raise InputError(f"{name}, line {above[-1][0]}", found, "the file exported again with semicolons or tabs")


def _digits(cells: Sequence[str], decimal: str, given: CsvMap) -> dict[str, Any]:
    """Return the fields of a dialect that state the form of numbers besides their decimal mark."""
    spaced_sign = any(cell[:2] in ("+ ", "- ") for cell in cells)
    return {"thousands": given.thousands or thousands_of(cells, decimal), "spaced_sign": spaced_sign}


def without_nuls(name: str) -> str:
    """The command that takes NUL bytes out of a file of text."""
    return f"text: `tr -d '\\000' < {shlex.quote(name)} > {shlex.quote(name + '.csv')}` takes them out"


def encoding_of(head: bytes) -> str:
    """Name of the codec of a text, by its first bytes."""
    for mark, encoding in (
        (codecs.BOM_UTF8, "utf-8-sig"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
    ):
        if head.startswith(mark):
            return encoding
    if head[1:400:2].count(0) > 0.4 * len(head[1:400:2]):
        return "utf-16-le"
    if head[0:400:2].count(0) > 0.4 * len(head[0:400:2]):
        return "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")("strict").decode(head)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def _text(name: str, head: bytes, encoding: str) -> str:
    strange = sum(head.count(bytes([code])) for code in (*range(1, 9), *range(14, 32)))
    nuls = 0 if encoding.startswith("utf-16") else head.count(b"\x00")
    begins_with_text = not nuls or b"\x00" not in head.partition(b"\n")[0]
    if strange > 0.01 * len(head) or not begins_with_text:
        raise InputError(name, *_BINARY)
    if nuls:
        line = head[: head.index(b"\x00")].count(b"\n") + 1
        raise InputError(f"{name}, line {line}", f"{nuls} NUL bytes from there on", without_nuls(name))
    try:
        text = codecs.getincrementaldecoder(encoding)("strict").decode(head)
    except LookupError as error:
        raise InputError("[csv] encoding", quoted(encoding), "an encoding such as utf-8, utf-16, cp1252") from error
    except UnicodeDecodeError as error:
        line = head[: error.start].count(b"\n") + 1
        found = f"bytes that are no {encoding}"
        choices = "--set csv.encoding=... with cp932 (Japanese), gb18030 (Chinese), cp1251 (Cyrillic) or latin-1"
        raise InputError(f"{name}, line {line}", found, choices) from error
    if "\x00" in text:
        raise InputError(name, *_BINARY)
    return text


def _comments(lines: Sequence[str], given: CsvMap) -> tuple[str, ...]:
    seen = tuple(mark for mark in _COMMENTS if any(line.startswith(mark) for line in lines)) or ("#",)
    return tuple(dict.fromkeys((*seen, *given.comment)))


def _separators(name: str, lines: Sequence[str], given: CsvMap) -> tuple[str, str]:
    """Delimiter and decimal mark that make numbers of most cells of the last lines."""
    sample = _last(lines)
    best: tuple[float, int, tuple[str, str]] = (0.0, 0, ("", ""))
    for delimiter in [given.delimiter] if given.delimiter else DELIMITERS:
        split = [split_line(line, delimiter) for line in sample]
        count, often = Counter(len(cells) for cells in split).most_common(1)[0]
        for decimal in [given.decimal] if given.decimal else (".", ","):
            rows = [cells for cells in split if len(cells) == count and _holds_number(cells, decimal)]
            stated = given.thousands or ""
            kinds = [kind_of_cells(column, decimal, stated) for column in zip(*rows, strict=True)]
            numbers = sum(kind in ("number", "stamp") for kind in kinds)
            texts = sum(kind == "text" for kind in kinds)
            score = often / len(sample) * (numbers - 0.5 * texts) / max(len(kinds) - kinds.count("empty"), 1)
            counted = 0 if delimiter == "whitespace" else numbers  # blanks also part a date from its time
            if any(kind == "number" for kind in kinds) and (score, counted) > best[:2]:
                best = (score, counted, (delimiter, decimal))
    if not best[2][0]:
        raise InputError(name, f"no columns of numbers: {quoted(sample[-1])}", _instead(name, sample[-1]))
    return best[2]


def _holds_number(cells: Sequence[str], decimal: str) -> bool:
    """Test whether a line holds a number; a line of names does not."""
    return any(is_number(cell, decimal) for cell in cells)


def _instead(name: str, line: str) -> str:
    """Return what a user can do if lines are no rows of numbers."""
    if line.lstrip()[:1] in ("{", "["):
        return "a table: records of JSON as CSV or Parquet, one column for each field"
    if re.search(r"\w[=:] ?[-+]?[0-9.]", line):
        return f"numbers alone: sed -E 's/[A-Za-z_]+ ?[=:] ?//g' {name} > {name}.csv takes the words out"
    if re.search(r"[0-9] ?[A-DF-Za-df-z°%]", line):
        sed = f"sed -E 's/([0-9]) ?[A-DF-Za-df-z°%][^,;0-9 ]*/\\1/g' {name} > {name}.csv"
        return f"numbers alone: {sed} takes the units out, and options state them (--rate-unit, ...)"
    return "rows of numbers; --set csv.delimiter=... and --set csv.decimal=... name marks that are not seen"


def _last(lines: Sequence[T]) -> Sequence[T]:
    """The last lines: rows, however many lines stand above them in a short file."""
    return lines[-min(_LAST, max(len(lines) // 4, _FEWEST)) :]


def _first_row(name: str, split: Sequence[tuple[int, list[str]]], count: int, decimal: str, header: int) -> int:
    """Index of the first row of numbers: it and most of the next lines have the kinds of cells of the last ones."""
    tail = [cells for _, cells in _last(split) if len(cells) == count and _holds_number(cells, decimal)]
    kinds = [kind_of_cells(column, decimal) for column in zip(*tail, strict=True)]
    for k, (line, _) in enumerate(split):
        if line > header and all(_like(cells, kinds, decimal, count) for _, cells in split[k : k + 1]):
            following = [_like(cells, kinds, decimal, count) for _, cells in split[k : k + 8]]
            if sum(following) >= _ENOUGH * len(following):
                return k
    raise InputError(name, "no rows of numbers", "rows of numbers, or --set csv.header_line=N: the line of the header")


def _like(cells: Sequence[str], kinds: Sequence[str], decimal: str, count: int) -> bool:
    if len(cells) != count:
        return False
    for cell, kind in zip(cells, kinds, strict=True):
        if kind == "number" and cell not in MISSING_WORDS and not is_number(cell, decimal):
            return False
        if kind == "stamp" and not forms_of([cell]):
            return False
    return True
