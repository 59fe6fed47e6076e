"""Parquet files of any program: units from the metadata of columns, stamps as they are typed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa

from ....common.arrays import numpy_of
from ....common.errors import InputError
from ...parquet import ParquetBatches, is_text
from ...tables import CHUNK_ROWS, Chunk, Column, LoggerFile, LoggerTable, numbers, unread
from ..cells import kind_of_cells
from ..format import Format

# Enough to tell text that is a date, a number or a hexadecimal count.
_SAMPLE_ROWS = 20


def open_parquet(path: Path) -> LoggerFile:
    """A Parquet file.

    Raises:
        InputError: It is damaged, or larger than is allowed.
    """
    file = ParquetBatches(path.name, path)
    columns = tuple(_column_of(field, file) for field in file.schema if _is_readable(field.type))
    left = tuple(unread(field.name, str(field.type)) for field in file.schema if not _is_readable(field.type))
    return LoggerFile(path, "Parquet file", (ParquetTable("", columns, file=file, rows=file.rows),), unread=left)


@dataclass(frozen=True, kw_only=True)
class ParquetTable(LoggerTable):
    """The rows of a Parquet file."""

    file: ParquetBatches

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """Yield rows in order; see `LoggerTable.chunks`."""
        at = 0
        for batch in self.file.batches(list(names) or [self.columns[0].name], CHUNK_ROWS):
            values = {n: _values_of(batch.column(k)) for k, n in enumerate(batch.schema.names)}
            yield Chunk(values, at, (at + len(batch)) / max(self.file.rows, 1))
            at += len(batch)


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind))


def _is_readable(kind: pa.DataType) -> bool:
    """Test whether values of a type are numbers, times or text."""
    return _is_number(kind) or is_text(kind) or bool(pa.types.is_timestamp(kind) or pa.types.is_duration(kind))


def _column_of(field: pa.Field, file: ParquetBatches) -> Column:
    """The column that a field of Arrow is."""
    metadata = {
        k.decode("utf-8", "replace").lower(): v.decode("utf-8", "replace") for k, v in (field.metadata or {}).items()
    }
    unit = metadata.get("unit") or metadata.get("units")
    if _is_number(field.type):
        return Column(field.name, unit, "the metadata of the column" if unit else "")
    if pa.types.is_timestamp(field.type):
        return Column(field.name, "UTC" if field.type.tz else None, kind="stamp")
    if pa.types.is_duration(field.type):
        return Column(field.name, field.type.unit, "the type of the column")
    cells: tuple[str, ...] = ()
    with suppress(InputError):  # long texts, which are no stamps
        sample = next(file.batches([field.name], _SAMPLE_ROWS), None)
        cells = tuple(str(v or "") for v in sample.column(0).to_pylist()) if sample is not None else ()
    return Column(field.name, kind="stamp" if kind_of_cells(cells, ".") == "stamp" else "text", sample=cells)


def _values_of(column: pa.Array) -> Any:
    """Return the values of a column of Arrow as those of a chunk."""
    if pa.types.is_string(column.type):
        return column
    if pa.types.is_timestamp(column.type):
        return column.cast(pa.timestamp("ns")).to_numpy(zero_copy_only=False)
    if pa.types.is_duration(column.type):
        return column.cast(pa.int64()).to_numpy(zero_copy_only=False)
    if pa.types.is_decimal(column.type):
        return column.cast(pa.float64()).to_numpy(zero_copy_only=False)
    return numbers(numpy_of(column))


FORMAT = Format(open_parquet, (b"PAR1",), in_child=False)
