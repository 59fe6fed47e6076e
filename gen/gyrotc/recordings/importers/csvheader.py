"""What stands above the rows of a CSV file: names, units, facts such as a serial."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ..units import kind_of
from .csvcells import cells_of, is_number

__all__ = ["facts_above", "header_of", "in_comments"]

_FACTS = re.compile(r"^\W*(?P<key>[A-Za-z][\w .#/]{1,40}?)\s*[:=,;\t]+\s*(?P<value>[^;,\t]+?)[\s;,]*$")
_UNITS_LABEL = re.compile(r"(?:y_)?units?(?:_label)?:?|einheit(?:en)?:?", re.IGNORECASE)


def in_comments(
    lines: Sequence[str], comment: tuple[str, ...], data_line: int, delimiter: str, count: int
) -> list[tuple[int, list[str]]]:
    """Commented lines above the rows with as many cells as they: a header that is a comment."""
    found = []
    for k, line in enumerate(lines[: data_line - 1], start=1):
        mark = next((m for m in comment if line.startswith(m)), None)
        cells = _rejoined(cells_of(line[len(mark) :].strip(), delimiter), count) if mark else []
        if len(cells) == count and count > 1:
            found.append((k, cells))
    return found


def _rejoined(cells: list[str], count: int) -> list[str]:
    """Cells between blanks, each unit in brackets with the name before it, where there are more than columns."""
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
    above: Sequence[tuple[int, list[str]]], count: int, given: Mapping[str, Any], decimal: str
) -> tuple[int, int, tuple[str, ...], tuple[str, ...]]:
    """Line of the names, line of the units, names, units; made-up names where there is no header."""
    rows = [
        (k, cells)
        for k, cells in above
        if _fits_header(cells, count, decimal) and not _UNITS_LABEL.fullmatch(cells[0])
    ]
    rows += [(k, _rejoined(cells, count)) for k, cells in above if len(cells) > count]
    rows = sorted((k, cells) for k, cells in rows if _fits_header(cells, count, decimal))
    if "header_line" in given:
        rows = [(k, cells) for k, cells in above if k == given["header_line"]]
        rows += [(k, cells) for k, cells in above if k == given.get("units_line", 0)]
    if not rows:
        return 0, 0, tuple(f"column {k + 1}" for k in range(count)), ("",) * count
    units_line, units = _labelled(above, count)
    of_units = [
        k for k in range(1, len(rows)) if _is_units(rows[k][1]) or rows[k][0] == given.get("units_line")
    ]
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
    """Units of a line that says so in its first cell, anywhere above the rows, and that of its abscissa."""
    line, units = 0, [""] * count
    for k, cells in above:
        if cells and _UNITS_LABEL.fullmatch(cells[0]) and any(kind_of(cell) for cell in cells[1:] if cell):
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
    """Whether a line holds units: at least half of its words are, or two fifths and two of them,
    and one of them is of time, temperature or rate.
    """
    words = [cell.strip("[](){} ") for cell in cells if cell.strip("[](){} -1")]
    known = sum(kind_of(word) is not None or _in_brackets(cells, word) for word in words)
    of_kinds = sum(kind_of(word) is not None for word in words)
    return (
        bool(words)
        and of_kinds > 0
        and (known >= 0.5 * len(words) or (of_kinds > 1 and known >= 0.4 * len(words)))
    )


def _in_brackets(cells: Sequence[str], word: str) -> bool:
    """Whether a word stands in brackets of its own."""
    return any(cell.strip()[:1] in "[(" and word in cell for cell in cells if cell.strip())


def _with_group(groups: Sequence[str], names: Sequence[str]) -> list[str]:
    """Names under headings: each heading holds until the next one."""
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
        if found := _FACTS.match(line.lstrip("#%!*/ ")):
            yield found["key"].strip().lower(), found["value"].strip().strip('"')
