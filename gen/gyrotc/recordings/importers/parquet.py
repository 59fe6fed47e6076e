"""Parquet files of other programs, batch by batch: units from the metadata of columns, stamps as they are typed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ...common.errors import InputError
from .csv_dialect import kind_of_cells
from .tables import CHUNK_ROWS, Chunk, Column, LoggerFile, LoggerTable, numbers

__all__ = ["open_parquet"]

_DAMAGE = (pa.ArrowException, OSError, ValueError)


def open_parquet(path: Path) -> LoggerFile:
    """A Parquet file.

    Raises:
        InputError: It is damaged.
    """
    try:
        with pq.ParquetFile(path) as file:
            schema, rows = file.schema_arrow, file.metadata.num_rows
            sample = next(file.iter_batches(20, use_threads=False), None)
    except _DAMAGE as error:
        what = " ".join(str(error).split())[:100]
        raise InputError(path.name, f"cannot be read as Parquet ({what})", "a whole Parquet file") from error
    columns = tuple(column for field in schema if (column := _column(field, sample)) is not None)
    return LoggerFile(path, "Parquet file", (ParquetTable("", columns, path=path, rows=rows),))


@dataclass(frozen=True)
class ParquetTable(LoggerTable):
    """The rows of a Parquet file."""

    path: Path = Path()
    rows: int = 0

    def chunks(self, names: Sequence[str]) -> Iterator[Chunk]:
        """As `Table.chunks`."""
        at = 0
        try:
            with pq.ParquetFile(self.path, pre_buffer=False) as file:
                wanted = list(names) or [self.columns[0].name]
                for batch in file.iter_batches(CHUNK_ROWS, columns=wanted, use_threads=False):
                    values = {n: _values(batch.column(k)) for k, n in enumerate(batch.schema.names)}
                    yield Chunk(values, at, (at + len(batch)) / max(self.rows, 1))
                    at += len(batch)
        except _DAMAGE as error:
            what = " ".join(str(error).split())[:100]
            raise InputError(self.path.name, f"is damaged ({what})", "a whole Parquet file") from error


def _column(field: Any, sample: Any) -> Column | None:
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


def _values(column: Any) -> Any:
    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        return column.cast(pa.string())
    if pa.types.is_timestamp(column.type):
        return column.cast(pa.timestamp("ns")).to_numpy(zero_copy_only=False)
    if pa.types.is_duration(column.type):
        return column.cast(pa.int64()).to_numpy(zero_copy_only=False)
    if pa.types.is_decimal(column.type):
        return column.cast(pa.float64()).to_numpy(zero_copy_only=False)
    return numbers(np.asarray(column.to_numpy(zero_copy_only=False)))
