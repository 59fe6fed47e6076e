"""Times whose parts stand in columns of numbers: year, month, ..., second; milliseconds beside a stamp."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from .names import words
from .tables import Column

__all__ = ["form_of_parts", "fraction_of", "parts_of", "text_of"]

_CODES = {
    "year": "%Y", "month": "%m", "day": "%d", "hour": "%H", "hours": "%H", "hr": "%H", "minute": "%M", "minutes": "%M",
    "min": "%M", "second": "%S", "seconds": "%S", "sec": "%S",
}  # fmt: skip
# Digits of that part of a second.
_FRACTIONS = {
    "ms": 3,
    "msec": 3,
    "millis": 3,
    "millisecond": 3,
    "milliseconds": 3,
    "us": 6,
    "microseconds": 6,
}
_ORDER = ("%Y", "%m", "%d", "%H", "%M", "%S", "%f")
_TIME_OF_DAY = {"%H", "%M", "%S"}


def _code(column: Column) -> str | None:
    """What part of a time a column of numbers is named after; None where its name says more, or something else."""
    name = words(column.name)
    if column.kind != "number" or len(name) != 1:
        return None
    return "%f" if name[0] in _FRACTIONS else _CODES.get(name[0])


def parts_of(columns: Sequence[Column]) -> list[Column]:
    """Columns of numbers that make a time of day, or a date and one, in order; none where some part is missing."""
    found = {code: column for column in reversed(columns) if (code := _code(column)) is not None}
    dated = {"%Y", "%m", "%d"} & set(found)
    if not set(found) >= _TIME_OF_DAY or len(dated) not in (0, 3):
        return []
    return [found[code] for code in _ORDER if code in found]


def fraction_of(columns: Sequence[Column], stamp: Column) -> Column | None:
    """The column of milliseconds that follows a stamp without a fraction."""
    at = columns.index(stamp) + 1
    if at < len(columns) and _code(columns[at]) == "%f" and not any("." in cell for cell in stamp.sample):
        return columns[at]
    return None


def form_of_parts(columns: Sequence[Column]) -> str:
    """The form of such columns, joined by blanks; empty where a name says no part."""
    codes = [_code(column) for column in columns]
    return " ".join(code for code in codes if code) if all(codes) else ""


def text_of(column: Column, values: Any) -> Any:
    """A column as text: as it is, or its whole numbers with the digits that its part has."""
    if isinstance(values, pa.Array | pa.ChunkedArray):
        return pc.utf8_trim(values, ' "')
    name = words(column.name)
    width = _FRACTIONS.get(name[0], 2) if len(name) == 1 else 2
    whole = np.asarray(values, dtype=np.float64)
    texts = [f"{v:0{width}.0f}" if np.isfinite(v) and v == np.floor(v) else None for v in whole.tolist()]
    return pa.array(texts, pa.string())
