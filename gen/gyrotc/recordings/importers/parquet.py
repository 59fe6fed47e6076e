"""Parquet, Feather and other files of Arrow: units from the metadata of columns, stamps as they are typed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.feather

from ...common.errors import InputError
from ..parquet_file import ParquetBatches
from .csv_dialect import kind_of_cells
from .tables import CHUNK_ROWS, Chunk, Column, LoggerFile, LoggerTable, numbers

_SAMPLE_ROWS = 20  # enough to tell text that is a date, a number or a hexadecimal count


def open_parquet(path: Path) -> LoggerFile:
    """A Parquet file.

    Raises:
        InputError: It is damaged, or larger than is allowed.
    """
    file = ParquetBatches(path.name, path)
    sample = next(file.batches(file.schema.names, _SAMPLE_ROWS), None)
    columns = tuple(one for typed in file.schema if (one := _column_of(typed, sample)) is not None)
    return LoggerFile(path, "Parquet file", (ParquetTable("", columns, file=file),))


@dataclass(frozen=True, kw_only=True)
class ParquetTable(LoggerTable):
    """The rows of a Parquet file."""

    file: ParquetBatches

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """As `Table.chunks`."""
        at = 0
        for batch in self.file.batches(list(names) or [self.columns[0].name], CHUNK_ROWS):
            values = {n: _values_of(batch.column(k)) for k, n in enumerate(batch.schema.names)}
            yield Chunk(values, at, (at + len(batch)) / max(self.file.rows, 1))
            at += len(batch)


def _column_of(field: Any, sample: Any) -> Column | None:
    """The column that a field of Arrow is; None where it holds neither numbers nor text.

    Args:
        sample: The first rows, None where there are none.
    """
    metadata = {
        k.decode("utf-8", "replace").lower(): v.decode("utf-8", "replace")
        for k, v in (field.metadata or {}).items()
    }
    unit = metadata.get("unit") or metadata.get("units")
    if pa.types.is_integer(field.type) or pa.types.is_floating(field.type) or pa.types.is_decimal(field.type):
        return Column(field.name, unit, "the metadata of the column" if unit else "")
    if pa.types.is_timestamp(field.type):
        return Column(field.name, "UTC" if field.type.tz else None, kind="stamp")
    if pa.types.is_duration(field.type):
        return Column(field.name, field.type.unit, "the type of the column")
    if pa.types.is_string(field.type) or pa.types.is_large_string(field.type):
        cells = (
            tuple(str(v or "") for v in sample.column(field.name).to_pylist()) if sample is not None else ()
        )
        kind = kind_of_cells(cells, ".")
        return Column(field.name, kind="stamp" if kind == "stamp" else "text", sample=cells)
    return None


def _values_of(column: Any) -> Any:
    """Values of a column of Arrow as those of a chunk."""
    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        return column.cast(pa.string())
    if pa.types.is_timestamp(column.type):
        return column.cast(pa.timestamp("ns")).to_numpy(zero_copy_only=False)
    if pa.types.is_duration(column.type):
        return column.cast(pa.int64()).to_numpy(zero_copy_only=False)
    if pa.types.is_decimal(column.type):
        return column.cast(pa.float64()).to_numpy(zero_copy_only=False)
    return numbers(np.asarray(column.to_numpy(zero_copy_only=False)))


def open_feather(path: Path) -> LoggerFile:
    """A Feather file of version 1 or 2, which is a file of Arrow.

    Raises:
        InputError: It is damaged.
    """
    try:
        table = pyarrow.feather.read_table(path, memory_map=False)
        table.validate(full=True)
    except (pa.ArrowException, OSError, ValueError) as error:
        what = " ".join(str(error).split())[:100]
        raise InputError(path.name, f"cannot be read as Feather ({what})", "a whole Feather file") from error
    sample = table.slice(0, _SAMPLE_ROWS)
    columns = tuple(one for typed in table.schema if (one := _column_of(typed, sample)) is not None)
    return LoggerFile(path, "Feather file", (ArrowTable("", columns, table=table, rows=len(table)),))


@dataclass(frozen=True, kw_only=True)
class ArrowTable(LoggerTable):
    """Rows of Arrow in memory."""

    table: pa.Table = field(default_factory=lambda: pa.table({}))
    rows: int = 0

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """As `Table.chunks`."""
        wanted = list(names) or [self.columns[0].name]
        for first in range(0, self.rows, CHUNK_ROWS):
            part = self.table.select(wanted).slice(first, CHUNK_ROWS).combine_chunks()
            values = {name: _values_of(_flat(part.column(name))) for name in wanted}
            yield Chunk(values, first, (first + len(part)) / self.rows)


def _flat(column: pa.ChunkedArray) -> pa.Array:
    return column.chunk(0) if column.num_chunks == 1 else pa.concat_arrays(column.chunks)
