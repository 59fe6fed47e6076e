"""What goes on where nothing is told from names: the columns that there are, and the options that name them."""

from __future__ import annotations

import re

from ..units import NATIVE
from .names import meaning, split_unit, words
from .tables import LoggerFile
from .unitchoice import OPTIONS

_HEXADECIMAL = re.compile(r"(?=.*[A-Fa-f])[0-9A-Fa-f]+h?|[0-9A-Fa-f]+h")

__all__ = ["in_text", "increments", "listed", "name_it", "nameless"]


def increments(file: LoggerFile) -> str:
    """What to do with a file of increments of angle; empty where there are none."""
    for table in file.tables:
        for column in table.columns:
            name, unit, _ = split_unit(column.name)
            if {"delta", "increment", "incr", "dtheta"} & set(words(name)):
                angle = column.unit or unit or "rad"
                return (
                    f'the increments as rates: --column rate="{column.name}" --rate-unit "{angle} / (0.01 s)" with the '
                    "row period in place of 0.01 s"
                )
    return ""


def in_text(file: LoggerFile, kind: str) -> str:
    """A column that by its name is of that kind, and holds no numbers: what stands there."""
    for table in file.tables:
        for column in table.columns:
            if column.kind == "text" and meaning(column.name, column.unit, table.name).kind == kind:
                shown = next((cell for cell in reversed(column.sample) if cell), "")
                if _HEXADECIMAL.fullmatch(shown):
                    return f"; or, as {column.name} holds {shown[:40]!r}, 0x before each of its numbers"
                return (
                    f"; or, as {column.name} holds {shown[:40]!r}, --csv decimal=, (or .) and --csv thousands=. "
                    "(or another mark), or --csv missing=WORD"
                )
    return ""


def listed(file: LoggerFile) -> str:
    names = [f"{t.name}/{c.name}" if t.name else c.name for t in file.tables for c in t.columns]
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")


def name_it(kind: str) -> str:
    return f'--column {kind}="..." with one of them, and {OPTIONS[kind]} (gyrotc\'s own is {NATIVE[kind]})'


def nameless(file: LoggerFile) -> str:
    """All that has to be said where no column has a name; empty where one has."""
    names = [column.name for table in file.tables for column in table.columns]
    if any(not name.startswith("column ") for name in names):
        return ""
    said = (f'--column {kind}="column ..." {OPTIONS[kind]} ...' for kind in ("time", "temperature", "rate"))
    return f"a line of names above the rows, or {' '.join(said)}"
