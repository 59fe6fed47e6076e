"""Tell rows of a CSV file from other lines; a file whose rows change their layout is refused, with the line.

Where the rows begin is guessed from the last lines of the head. What is above them may only be what a logger writes
above rows: names, units, and lines that say something. A line of numbers there is a row, and no row is passed over.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from ...common.errors import InputError
from .cells import DELIMITERS, MISSING_WORDS, is_number, split_line
from .stamps import forms_of

_WAYS = tuple((delimiter, decimal) for delimiter in DELIMITERS for decimal in (".", ","))
_SHEETS = (".xlsx", ".xlsm")  # endings of files that no command for text cuts
_FEWEST_NUMBERS = 2  # of a row: a temperature and a rate


class SeveralLayouts(InputError):
    """The rows of a file differ in their number of cells or in what parts them."""


@dataclass(frozen=True, slots=True)
class Row:
    """A line that can be a row: its number, and its layout (number of cells, delimiter)."""

    line: int
    layout: tuple[int, str]


def can_be_row(cells: Sequence[str], decimal: str) -> bool:
    """Test whether cells can be a row: two numbers or more, fewer words than numbers and stamps, no word in front.

    `Range: 400, 500` is none, because a word says what its numbers are. A word of which most are digits is no such
    word: it is a stamp of a form that is not known.
    """
    held = [cell for cell in cells if cell not in MISSING_WORDS]
    numbers = [is_number(cell, decimal) for cell in held]
    if sum(numbers) < _FEWEST_NUMBERS:
        return False
    told = [number or bool(forms_of([cell])) for number, cell in zip(numbers, held, strict=True)]
    return 2 * sum(told) > len(held) and (told[0] or _of_digits(held[0]))


def _of_digits(cell: str) -> bool:
    return sum(mark.isdigit() for mark in cell) > sum(mark.isalpha() for mark in cell)


def first_row(
    name: str, lines: Sequence[tuple[int, str]], guessed: int, count: int, delimiter: str, decimal: str
) -> int:
    """Index of the first row among lines with their numbers: the guessed one, or one above it of the same layout.

    Args:
        guessed: Index of the line from which on the rows have `count` cells.

    Raises:
        SeveralLayouts: A row above it is of another layout.
    """
    rows = rows_among(lines[:guessed], delimiter, decimal)
    layout = (count, delimiter)
    if any(row.layout != layout for row in rows):
        after = [Row(k, layout) for k, line in lines[guessed : guessed + 2]]
        raise _refusal(name, lines, [*rows, *after], delimiter)
    return next((k for k, (line, _) in enumerate(lines) if rows and line == rows[0].line), guessed)


def check_between(name: str, lines: Sequence[tuple[int, str]], count: int, delimiter: str, decimal: str) -> int:
    """Number of the first line between the names and the first row that is a row after all; 0: there is none.

    Below the names, one number makes a row.

    Raises:
        SeveralLayouts: It has another number of cells.
    """
    for line, text in lines:
        cells = split_line(text, delimiter)
        if any(cell not in MISSING_WORDS and is_number(cell, decimal) for cell in cells):
            if len(cells) != count:
                raise SeveralLayouts(f"{name}, line {line}", *_damaged(name, line, line, len(cells), count))
            return line
    return 0


def rows_among(lines: Sequence[tuple[int, str]], delimiter: str, decimal: str) -> list[Row]:
    """List the lines that can be rows in any dialect, and those that repeat the words of another: `IMU,0,20.1,10.2`."""
    split = [split_line(text, delimiter) for _, text in lines]
    words = [_words(cells, decimal) for cells in split]
    often = Counter(words)
    found = []
    for (line, text), cells, said in zip(lines, split, words, strict=True):
        if can_be_row(cells, decimal) or (said is not None and often[said] > 1):
            found.append(Row(line, (len(cells), delimiter)))
        elif layout := _other_layout(text):
            found.append(Row(line, layout))
    return found


def _other_layout(text: str) -> tuple[int, str] | None:
    """The layout of a line that is a row in another dialect."""
    for delimiter, decimal in _WAYS:
        cells = split_line(text, delimiter)
        if can_be_row(cells, decimal):
            return len(cells), delimiter
    return None


def _words(cells: Sequence[str], decimal: str) -> tuple[int, tuple[tuple[int, str], ...]] | None:
    """Number of cells and the words among them with their places; None without two numbers, or without words."""
    numbers = [is_number(cell, decimal) for cell in cells]
    words = tuple((k, cell) for k, cell in enumerate(cells) if not numbers[k] and cell not in MISSING_WORDS)
    return (len(cells), words) if words and sum(numbers) >= _FEWEST_NUMBERS else None


def _refusal(name: str, lines: Sequence[tuple[int, str]], rows: Sequence[Row], delimiter: str) -> SeveralLayouts:
    """The line where the layout changes, and the commands that part the file there or take single lines out."""
    at = next(k for k, row in enumerate(rows) if row.layout != rows[0].layout)
    before, after = rows[at - 1], rows[at]
    names = next((len(split_line(text, delimiter)) for k, text in reversed(lines) if k < rows[0].line), 0)
    if names == after.layout[0] != before.layout[0]:  # the names are those of the rows below
        found, remedy = _damaged(name, rows[0].line, before.line, before.layout[0], names)
        return SeveralLayouts(f"{name}, line {rows[0].line}", found, remedy)
    back = next((row for row in rows[at + 1 :] if row.layout == before.layout), None)
    if back is not None:
        found, remedy = _damaged(name, after.line, back.line - 1, after.layout[0], before.layout[0])
        return SeveralLayouts(f"{name}, line {after.line}", found, remedy)
    begins = next(k for k, _ in lines if k > before.line)
    found = f"{after.layout[0]} cells where line {before.line} has {before.layout[0]}"
    if after.layout[0] == before.layout[0]:
        found = f"cells parted by {after.layout[1]!r}, by {before.layout[1]!r} in line {before.line}"
    return SeveralLayouts(f"{name}, line {after.line}", found, parted(name, begins, names=begins < after.line))


def parted(name: str, line: int, *, names: bool) -> str:
    """The commands that part a file at a line, which begins the second part.

    Args:
        names: The second part begins with a line of names of its own.
    """
    if name.lower().endswith(_SHEETS):
        return "rows of one layout: those from there on, under their names, moved to a sheet of their own"
    file, one, two = (shlex.quote(part) for part in (name, f"{name}.1.csv", f"{name}.2.csv"))
    needs = "" if names else ", which then needs a line of names"
    return f"rows of one layout: `head -n {line - 1} {file} > {one}` and `tail -n +{line} {file} > {two}`{needs}"


def _damaged(name: str, first: int, last: int, count: int, expected: int) -> tuple[str, str]:
    """Return what is wrong with lines that do not fit the others, and the command that takes them out."""
    place = f"{first}" if first == last else f"{first},{last}"
    found = f"{_cells(count)}, and {expected} in the lines around it"
    if name.lower().endswith(_SHEETS):
        return found, f"{expected} cells, or no such row"
    file, to = shlex.quote(name), shlex.quote(f"{name}.csv")
    return found, f"{expected} cells: `sed {place}d {file} > {to}` leaves out what does not fit"


def _cells(count: int) -> str:
    return f"{count} cells" if count != 1 else "1 cell"


def row_misfit(
    name: str, line: int, row: Sequence[str], dialect: tuple[int, str, str, int], following: str | None
) -> SeveralLayouts:
    """The refusal of a line below the first row that has another number of cells.

    Args:
        dialect: Number of cells, delimiter, decimal mark, and number of the first row.
        following: The next line that holds something; None where there is none.
    """
    count, delimiter, decimal, first = dialect
    shown = (" " if delimiter == "whitespace" else delimiter).join(row)[:60]
    where, found = f"{name}, line {line}", f"{_cells(len(row))} where line {first} has {count}: {shown!r}"
    numbers = any(is_number(cell, decimal) for cell in row)
    following_fits = following is not None and len(split_line(following, delimiter)) == count
    if len(row) > 1 and following is not None and not following_fits:
        return SeveralLayouts(where, found, parted(name, line, names=not numbers))
    remedy = _damaged(name, line, line, len(row), count)[1]
    word = _beginning(row)
    if not numbers and word:
        remedy = f'{count} cells; --set csv.comment="{word}" leaves out lines that begin so'
    return SeveralLayouts(where, found, remedy)


def other_names(name: str, line: int, row: Sequence[str]) -> SeveralLayouts:
    """The refusal of a line of words among the rows, which may give the columns other names."""
    found = f"words in every column: {', '.join(row)[:60]!r}"
    return SeveralLayouts(f"{name}, line {line}", found, parted(name, line, names=True))


def _beginning(row: Sequence[str]) -> str:
    start = row[0].lstrip()[:20] if row else ""
    end = next((k for k, mark in enumerate(start) if k and not (mark.isalnum() or mark == "_")), len(start))
    return start[:end]
