"""Cells of a line of text: where they begin and end, and what they hold."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..csv_file import LONGEST_NUMBER, number_in
from .stamps import forms_of

MISSING_WORDS = (
    "", "nan", "NaN", "NAN", "NA", "N/A", "n/a", "na", "null", "NULL", "None", "none", "-", "--", "---", "#N/A",
)  # fmt: skip
DELIMITERS = (";", "\t", ",", "|", "whitespace")
HEXADECIMAL = re.compile(r"0[xX][0-9A-Fa-f]{1,15}")  # of a counter; within 63 bits
_INFINITE = ("inf", "infinity")
_BLANKS = " \u00a0\u202f\u2009'\u2019"  # between thousands: blanks of all widths, apostrophes
_GROUPED = {
    decimal: re.compile(
        rf"(?:[+-] *)?[0-9]{{1,3}}(?P<mark>[{_BLANKS}{other}])[0-9]{{3}}(?:(?P=mark)[0-9]{{3}})*"
        rf"{re.escape(decimal)}[0-9]+"
    )
    for decimal, other in ((",", "."), (".", ","))
}  # only with a decimal mark behind it: 1.234 alone may be either


def split_line(line: str, delimiter: str) -> list[str]:
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


def kind_of_cells(cells: Sequence[str], decimal: str, thousands: str = "") -> str:
    """Return the kind of some cells: "number", "stamp", "text" or "empty".

    Args:
        thousands: The mark between thousands, where it is stated.
    """
    held = [cell for cell in cells if cell not in MISSING_WORDS]
    if not held:
        return "empty"
    if all(is_number(cell, decimal, thousands) for cell in held):
        return "number"
    return "stamp" if forms_of(held) else "text"


def is_number(cell: str, decimal: str, thousands: str = "") -> bool:
    """Test whether a cell is a number; marks between thousands count if they can be nothing else, or as stated."""
    if len(cell) > LONGEST_NUMBER:
        return False
    if thousands and re.fullmatch(rf"[^{re.escape(thousands)}]{{1,4}}({re.escape(thousands)}\d{{3}})+(\D.*)?", cell):
        cell = cell.replace(thousands, "")
    if _GROUPED[decimal].fullmatch(cell) or HEXADECIMAL.fullmatch(cell):
        return True
    if decimal == "," and "." in cell:
        return False
    plain = plain_number(cell, decimal, "")
    return number_in(plain) is not None or is_infinite(plain)


def is_infinite(cell: str) -> bool:
    """Test whether a cell holds the word for infinity, with or without a sign."""
    return cell.lstrip("+-").lower() in _INFINITE


def thousands_of(cells: Sequence[str], decimal: str) -> str:
    """The mark between thousands of numbers, empty where there is none."""
    for cell in cells:
        if len(cell) <= LONGEST_NUMBER and (found := _GROUPED[decimal].fullmatch(cell)):
            return found["mark"]
    return ""


def plain_number(cell: str, decimal: str, thousands: str) -> str:
    """A number without marks between thousands and without blanks behind its sign, with a point."""
    plain = cell.replace(thousands, "") if thousands else cell
    plain = re.sub(r"^([+-]) +", r"\1", plain)
    return plain.replace(",", ".", 1) if decimal == "," else plain


def plain_lines(lines: bytes, delimiter: str, thousands: str, *, spaced_sign: bool) -> bytes:
    """Return lines of cells in UTF-8 with plain numbers; the decimal mark stays.

    Args:
        spaced_sign: Signs are separate from the digits.
    """
    edge = re.escape(delimiter.encode())
    if spaced_sign:
        lines = re.sub(rb"(?m)(^|" + edge + rb'|")( *[+-]) +(?=[0-9.])', rb"\1\2", lines)
    if thousands:
        mark = thousands.encode()
        start, digits = rb"(?m)(^|" + edge + rb'|")( *[+-]?[0-9]{1,3}', rb"[0-9]{3})+)"
        grouped = re.compile(start + rb"(?:" + re.escape(mark) + digits + rb'(?=[.,"\r\n]|' + edge + rb"|$)")
        lines = grouped.sub(lambda found: found[1] + found[2].replace(mark, b""), lines)
    return lines
