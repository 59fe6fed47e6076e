"""Tables of arrays that lie whole in a file or in memory: what MATLAB, HDF5 and measurement files give."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .tables import CHUNK_ROWS, Chunk, Column, LoggerTable

__all__ = ["ArrayTable", "Part", "grouped", "part_of", "rate_of"]

Part = Callable[[int, int], Any]
"""Gives the values of rows from a first to a last one (exclusive)."""


@dataclass(frozen=True)
class ArrayTable(LoggerTable):
    """Columns that can be read from any row on.

    Attributes:
        rows: Number of rows.
        parts: Reads a part of each column.
    """

    rows: int = 0
    parts: Mapping[str, Part] = field(default_factory=dict)

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """As `Table.chunks`."""
        for first in range(0, self.rows, CHUNK_ROWS):
            last = min(first + CHUNK_ROWS, self.rows)
            values = {name: np.asarray(self.parts[name](first, last)) for name in names}
            yield Chunk(values or {"": np.zeros(last - first)}, first, last / self.rows)


def part_of(values: Any) -> Part:
    """Reads an array that is in memory."""
    return lambda first, last: values[first:last]


def grouped(
    columns: Sequence[tuple[str, str, int, Column, Part]], rates: Mapping[str, tuple[float, str]]
) -> tuple[LoggerTable, ...]:
    """Tables of columns of one group and one length.

    Args:
        columns: Group, name of the table, number of rows, column, and what reads it.
        rates: Rows per second by group, with the reason.
    """
    found: dict[tuple[str, int], list[tuple[Column, Part]]] = {}
    names: dict[tuple[str, int], str] = {}
    for group, name, rows, column, part in columns:
        if rows > 1:
            found.setdefault((group, rows), []).append((column, part))
            names[group, rows] = name
    lengths: dict[str, int] = {}
    for group, _ in found:
        lengths[group] = lengths.get(group, 0) + 1
    tables = []
    for (group, rows), members in found.items():
        name = names[group, rows] if lengths[group] == 1 else f"{names[group, rows]} ({rows} rows)".strip()
        rate, why = rates.get(group, (None, ""))
        parts = {column.name: part for column, part in members}
        columns_of = tuple(column for column, _ in members)
        tables.append(ArrayTable(name, columns_of, rate, why, rows=rows, parts=parts))
    return tuple(tables)


def rate_of(name: str, value: float) -> tuple[float, str] | None:
    """Rows per second that a single number of that name states, with the reason; None if it does not."""
    plain = name.lower().rsplit("/", 1)[-1].rsplit(".", 1)[-1]
    if not np.isfinite(value) or value <= 0.0:
        return None
    if plain in (
        "fs",
        "fs_hz",
        "sample_rate",
        "samplerate",
        "sampling_rate",
        "rate_hz",
        "samplingfrequency",
        "fsamp",
    ):
        return float(value), f"{name} = {value:g} in the file, in Hz"
    if plain in ("dt", "ts", "dt_s", "ts_s", "sample_time", "sampletime"):
        return 1.0 / float(value), f"{name} = {value:g} in the file, in s"
    return None
