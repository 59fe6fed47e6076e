"""Cells of a line of CSV, and what they hold."""

from __future__ import annotations

import re
from collections.abc import Sequence

from .forms import forms_of

__all__ = ["MISSING", "cells_of", "is_number", "kind_of_cells"]

MISSING = (
    "", "nan", "NaN", "NAN", "NA", "N/A", "n/a", "na", "null", "NULL", "None", "none", "-", "--", "---", "#N/A",
)  # fmt: skip
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?[iI]nf(inity)?")


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
    if all(is_number(cell, decimal) for cell in held):
        return "number"
    return "stamp" if forms_of(held) else "text"


def is_number(cell: str, decimal: str) -> bool:
    if decimal == ",":
        return "." not in cell and bool(_NUMBER.fullmatch(cell.replace(",", ".", 1)))
    return bool(_NUMBER.fullmatch(cell))
