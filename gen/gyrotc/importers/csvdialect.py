"""How a CSV file is written: encoding, comments, delimiter, decimal mark, header; told from its first lines.

What is decided can be seen and overruled: it stands in the map under `[csv]`.
"""

from __future__ import annotations

import codecs
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ..dataset.units import kind_of
from ..errors import InputError
from .stamps import forms_of

__all__ = ["MISSING", "Dialect", "cells_of", "cleaned", "dialect_of", "kind_of_cells"]

MISSING = (
    "",
    "nan",
    "NaN",
    "NAN",
    "NA",
    "N/A",
    "n/a",
    "na",
    "null",
    "NULL",
    "None",
    "none",
    "-",
    "--",
    "---",
    "#N/A",
)
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?[iI]nf(inity)?")
_DELIMITERS = (";", "\t", ",", "|", "whitespace")
_COMMENTS = ("#", "%", "//", "!", "*")
_ENOUGH = 0.8
_FACTS = re.compile(r"^\W*(?P<key>[A-Za-z][\w .#/]{1,40}?)\s*[:=,;\t]+\s*(?P<value>[^;,\t]+?)[\s;,]*$")


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a CSV file is written.

    Attributes:
        encoding: Name of the codec.
        delimiter: One character, or "whitespace".
        decimal: "." or ",".
        comment: Beginnings of lines that hold no rows.
        header_line: Line of the names, from 1; 0: there is none.
        units_line: Line of the units, from 1; 0: there is none.
        data_line: First line of rows, from 1.
        names: Names of the columns; empty for a column that only ends the lines.
        units: Units by column, empty where none are given.
        missing: What cells without a number hold.
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
    missing: tuple[str, ...] = MISSING
    facts: dict[str, str] = field(default_factory=dict)

    def to_map(self) -> dict[str, Any]:
        """As `[csv]` of a map."""
        comment: Any = self.comment[0] if len(self.comment) == 1 else list(self.comment)
        found = {
            "encoding": self.encoding,
            "delimiter": self.delimiter,
            "decimal": self.decimal,
            "comment": comment,
            "header_line": self.header_line,
            "units_line": self.units_line,
        }
        extra = [token for token in self.missing if token not in MISSING]
        return found | ({"missing": extra} if extra else {})


def dialect_of(name: str, head: bytes, given: Mapping[str, Any], *, whole: bool) -> Dialect:
    """The dialect of a file.

    Args:
        name: Of the file, for messages.
        head: Its first bytes.
        given: `[csv]` of a map; its keys are not guessed.
        whole: Whether the head is all of the file.

    Raises:
        InputError: No rows of numbers can be found.
    """
    encoding = given.get("encoding") or _encoding(head)
    text = _text(name, head, encoding)
    lines = re.split(r"\r\n|\n|\r", text)
    lines = lines if whole else lines[:-1]
    comment = _comments(lines, given)
    kept = [
        (k, line) for k, line in enumerate(lines, start=1) if line.strip() and not line.startswith(comment)
    ]
    if not kept:
        raise InputError(name, "no lines of rows", "a header and rows of numbers")
    delimiter, decimal = _separators(name, [line for _, line in kept], given)
    split = [(k, cells_of(line, delimiter)) for k, line in kept]
    count = _usual_count(split)
    first = _first_row(name, split, count, decimal, int(given.get("header_line") or 0))
    above = [(k, cells) for k, cells in split if k < split[first][0]]
    above += _in_comments(lines, comment, split[first][0], delimiter, count) if not above else []
    header, units_line, names, units = _header(above, count, given, decimal)
    return Dialect(
        encoding=encoding,
        delimiter=delimiter,
        decimal=decimal,
        comment=comment,
        header_line=header,
        units_line=units_line,
        data_line=split[first][0],
        names=names,
        units=units,
        missing=(*MISSING, *given.get("missing", ())),
        facts=_facts(lines[: split[first][0] - 1], header),
    )


def cells_of(line: str, delimiter: str) -> list[str]:
    """Cells of a line without the spaces and quotes around them."""
    if delimiter == "whitespace":
        return line.split()
    cells, cell, quoted = [], "", False
    for mark in line:
        if mark == '"':
            quoted = not quoted
        elif mark == delimiter and not quoted:
            cells.append(cell.strip())
            cell = ""
        else:
            cell += mark
    return [*cells, cell.strip()]


def kind_of_cells(cells: Sequence[str], decimal: str) -> str:
    """What cells hold: "number", "stamp", "text", or "empty"."""
    held = [cell for cell in cells if cell not in MISSING]
    if not held:
        return "empty"
    if all(_is_number(cell, decimal) for cell in held):
        return "number"
    return "stamp" if forms_of(held) else "text"


def _is_number(cell: str, decimal: str) -> bool:
    if decimal == ",":
        return "." not in cell and bool(_NUMBER.fullmatch(cell.replace(",", ".", 1)))
    return bool(_NUMBER.fullmatch(cell))


def _encoding(head: bytes) -> str:
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
    if strange > 0.01 * len(head) or (b"\x00" in head and not encoding.startswith("utf-16")):
        raise InputError(
            name, "binary data of no known format", "text, or a format that docs/import.md lists"
        )
    try:
        text = codecs.getincrementaldecoder(encoding)("strict").decode(head)
    except LookupError as error:
        raise InputError(
            "[csv] encoding", repr(encoding), "an encoding such as utf-8, utf-16, cp1252"
        ) from error
    except UnicodeDecodeError as error:
        line = head[: error.start].count(b"\n") + 1
        found = f"bytes that are no {encoding}"
        raise InputError(f"{name}, line {line}", found, "another --csv encoding=...") from error
    return text


def _comments(lines: Sequence[str], given: Mapping[str, Any]) -> tuple[str, ...]:
    stated = given.get("comment")
    more = (stated,) if isinstance(stated, str) else tuple(stated or ())
    seen = tuple(mark for mark in _COMMENTS if any(line.startswith(mark) for line in lines)) or ("#",)
    return tuple(dict.fromkeys((*seen, *more)))


def _separators(name: str, lines: Sequence[str], given: Mapping[str, Any]) -> tuple[str, str]:
    """Delimiter and decimal mark that make numbers of most cells of the last lines."""
    sample = lines[-60:]
    best: tuple[float, int, tuple[str, str]] = (0.0, 0, ("", ""))
    for delimiter in [given["delimiter"]] if given.get("delimiter") else _DELIMITERS:
        split = [cells_of(line, delimiter) for line in sample]
        count, often = Counter(len(cells) for cells in split).most_common(1)[0]
        rows = [cells for cells in split if len(cells) == count]
        for decimal in [given["decimal"]] if given.get("decimal") else (".", ","):
            kinds = [kind_of_cells(column, decimal) for column in zip(*rows, strict=True)]
            numbers = sum(kind in ("number", "stamp") for kind in kinds)
            texts = sum(kind == "text" for kind in kinds)
            score = often / len(sample) * (numbers - 0.5 * texts) / max(len(kinds), 1)
            if any(kind == "number" for kind in kinds) and (score, numbers) > best[:2]:
                best = (score, numbers, (delimiter, decimal))
    if not best[2][0]:
        found = f"no columns of numbers: {sample[-1][:60]!r}"
        raise InputError(
            name,
            found,
            "rows of numbers; --csv delimiter=... and --csv decimal=... name marks that are not seen",
        )
    return best[2]


def _usual_count(split: Sequence[tuple[int, list[str]]]) -> int:
    return Counter(len(cells) for _, cells in split[-60:]).most_common(1)[0][0]


def _first_row(
    name: str, split: Sequence[tuple[int, list[str]]], count: int, decimal: str, header: int
) -> int:
    """Index of the first row of numbers: it and most of the next lines have the kinds of cells of the last ones."""
    tail = [cells for _, cells in split[-40:] if len(cells) == count]
    kinds = [kind_of_cells(column, decimal) for column in zip(*tail, strict=True)]
    for k, (line, _) in enumerate(split):
        if line > header and all(_like(cells, kinds, decimal, count) for _, cells in split[k : k + 1]):
            following = [_like(cells, kinds, decimal, count) for _, cells in split[k : k + 8]]
            if sum(following) >= _ENOUGH * len(following):
                return k
    raise InputError(
        name, "no rows of numbers", "rows of numbers; --csv header_line=N names the line of the header"
    )


def _like(cells: Sequence[str], kinds: Sequence[str], decimal: str, count: int) -> bool:
    if len(cells) != count:
        return False
    for cell, kind in zip(cells, kinds, strict=True):
        if kind == "number" and cell not in MISSING and not _is_number(cell, decimal):
            return False
        if kind == "stamp" and not forms_of([cell]):
            return False
    return True


def _in_comments(
    lines: Sequence[str], comment: tuple[str, ...], data_line: int, delimiter: str, count: int
) -> list[tuple[int, list[str]]]:
    """Commented lines above the rows with as many cells as they: a header that is a comment."""
    found = []
    for k, line in enumerate(lines[: data_line - 1], start=1):
        mark = next((m for m in comment if line.startswith(m)), None)
        cells = cells_of(line[len(mark) :].strip(), delimiter) if mark else []
        if len(cells) == count and count > 1:
            found.append((k, cells))
    return found


def _header(
    above: Sequence[tuple[int, list[str]]], count: int, given: Mapping[str, Any], decimal: str
) -> tuple[int, int, tuple[str, ...], tuple[str, ...]]:
    """Line of the names, line of the units, names, units; made-up names where there is no header."""
    rows = [(k, cells) for k, cells in above if _fits_header(cells, count, decimal)]
    if "header_line" in given:
        rows = [(k, cells) for k, cells in above if k == given["header_line"]]
        rows += [(k, cells) for k, cells in above if k == given.get("units_line", 0)]
    if not rows:
        return 0, 0, tuple(f"column {k + 1}" for k in range(count)), ("",) * count
    units_line, units = 0, [""] * count
    if len(rows) > 1 and (_is_units(rows[-1][1]) or rows[-1][0] == given.get("units_line")):
        units_line, cells = rows.pop()
        units = [cell.strip("[](){} ") for cell in _padded(cells, count)]
    line, cells = rows[-1]
    names = _padded(cells, count)
    if len(set(names) - {""}) < len([n for n in names if n]) and len(rows) > 1:
        names = _with_group(_padded(rows[-2][1], count), names)
    names = [name.strip().strip("'\ufeff") for name in names]
    return line, units_line, tuple(names), tuple("" if u in ("-", "1", "none") else u for u in units)


def _fits_header(cells: Sequence[str], count: int, decimal: str) -> bool:
    """A header has as many cells as the rows (one less where the rows end with a delimiter), and words."""
    if not (len(cells) == count or (len(cells) == count - 1 and count > 2)):
        return False
    return any(cell and not _is_number(cell, decimal) for cell in cells)


def _padded(cells: Sequence[str], count: int) -> list[str]:
    return [*cells, *[""] * (count - len(cells))]


def _is_units(cells: Sequence[str]) -> bool:
    """Whether a line holds units: at least half of its words are, and one of them is of time, temperature or rate."""
    words = [cell.strip("[](){} ") for cell in cells if cell.strip("[](){} -1")]
    known = sum(kind_of(word) is not None or cell_in_brackets(cells, word) for word in words)
    return bool(words) and known >= 0.5 * len(words) and any(kind_of(word) for word in words)


def cell_in_brackets(cells: Sequence[str], word: str) -> bool:
    """Whether a word stands in brackets of its own."""
    return any(cell.strip()[:1] in "[(" and word in cell for cell in cells if cell.strip())


def _with_group(groups: Sequence[str], names: Sequence[str]) -> list[str]:
    """Names under headings: each heading holds until the next one."""
    joined, heading = [], ""
    for group, name in zip(groups, names, strict=True):
        heading = group or heading
        joined.append(f"{heading} {name}".strip() if heading != name else name)
    return joined


def _facts(lines: Sequence[str], header: int) -> dict[str, str]:
    """`key: value` lines above the header."""
    return dict(_fact_pairs([line for k, line in enumerate(lines, start=1) if k != header][:200]))


def _fact_pairs(lines: Sequence[str]) -> Iterator[tuple[str, str]]:
    for line in lines:
        if found := _FACTS.match(line.lstrip("#%!*/ ")):
            yield found["key"].strip().lower(), found["value"].strip().strip('"')


def cleaned(name: str) -> str:
    """A name for messages."""
    return name if len(name) <= 60 else name[:57] + "..."
