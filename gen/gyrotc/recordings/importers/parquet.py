"""Parquet files: units from the metadata of columns, stamps as they are typed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ...common.arrays import numpy_of
from ...common.errors import InputError
from ...common.inputs import ceiling, open_input, refuse_above
from ..tables import CHUNK_ROWS, Chunk, Column, LoggerFile, LoggerTable, numbers
from .cells import kind_of_cells

_BUFFER_BYTES = 2**20  # of a column: without one the whole column of a row group is read at once
_SAMPLE_ROWS = 20  # enough to tell text that is a date, a number or a hexadecimal count
_HARMLESS_BYTES = 2**26  # 64 MiB, which any host has: below it no ratio of packing is asked about
_DAMAGE = (pa.ArrowException, OSError, ValueError, MemoryError, OverflowError)  # of whatever pyarrow meets


class ParquetBatches:
    """A Parquet file of any program, as it was when it was opened.

    Attributes:
        name: Name in messages.
        path: Where it is.
        size: Bytes.
        schema: Its columns.
        rows: Number of rows.

    Raises:
        InputError: It cannot be read, is no Parquet, or unpacks to more than is allowed.
    """

    def __init__(self, name: str, path: Path) -> None:
        self.name, self.path = name, path
        opened, self.size = open_input(path, name, "a Parquet file")
        refuse_above("recording_mib", self.size / 2**20, name, "MiB")
        try:
            with opened, pq.ParquetFile(opened) as file:
                self.schema: pa.Schema = file.schema_arrow
                self.rows: int = file.metadata.num_rows
                unpacked = _unpacked(file.metadata)
        except _DAMAGE as error:
            raise InputError(name, f"cannot be read as Parquet ({_short(error)})", "a whole Parquet file") from error
        refuse_above("columns", len(self.schema), name, "columns")
        refuse_above("rows", self.rows, name, "rows")
        _refuse_bomb(name, self.size, max(unpacked, 8 * self.rows * len(self.schema)))

    def batches(self, columns: Sequence[str], most: int = CHUNK_ROWS) -> Iterator[pa.RecordBatch]:
        """Batches of columns, at most so many rows each.

        Raises:
            InputError: The file is damaged.
        """
        opened, _ = open_input(self.path, self.name, "a Parquet file")
        at = 0
        with opened:
            try:
                with pq.ParquetFile(opened, pre_buffer=False, buffer_size=_BUFFER_BYTES) as file:
                    for batch in file.iter_batches(most, columns=list(columns), use_threads=False):
                        at += len(batch)
                        yield batch
                if at != self.rows:
                    raise ValueError(f"{at} rows instead of {self.rows}")
            except _DAMAGE as error:
                found = f"is damaged ({_short(error)})"
                raise InputError(self.name, found, "a whole Parquet file") from error


def _unpacked(metadata: pq.FileMetaData) -> int:
    """Bytes of all pages once unpacked, as the file states them.

    Of row groups, not of columns: pyarrow ends the process where a damaged file lacks the description of a column.
    """
    return sum(metadata.row_group(k).total_byte_size for k in range(metadata.num_row_groups))


def _refuse_bomb(name: str, size: int, unpacked: int) -> None:
    """A small file that unpacks to gigabytes.

    Raises:
        InputError: It is one.
    """
    if unpacked > _HARMLESS_BYTES and unpacked > ceiling("parquet_ratio") * size:
        found = f"{size} bytes that unpack to {unpacked} or more"
        raise InputError(
            name, found, f"at most {ceiling('parquet_ratio'):g} times; write it again with less compression"
        )


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:120]


def open_parquet(path: Path) -> LoggerFile:
    """A Parquet file.

    Raises:
        InputError: It is damaged, or larger than is allowed.
    """
    file = ParquetBatches(path.name, path)
    sample = next(file.batches(file.schema.names, _SAMPLE_ROWS), None)
    columns = tuple(column for one in file.schema if (column := _column_of(one, sample)) is not None)
    return LoggerFile(path, "Parquet file", (ParquetTable("", columns, file=file, rows=file.rows),))


def open_numbers(path: Path) -> LoggerFile:
    """A Parquet file of numbers alone: a recording of a data set.

    Raises:
        InputError: As `open_parquet`, or a column holds no numbers.
    """
    file = ParquetBatches(path.name, path)
    for one in file.schema:
        if not (pa.types.is_integer(one.type) or pa.types.is_floating(one.type)):
            expected = "numbers; `gyrotc import` reads stamps and more"
            raise InputError(f"{path.name}, column {one.name}", f"holds {one.type}", expected)
    columns = tuple(Column(name) for name in file.schema.names)
    return LoggerFile(path, "Parquet file", (ParquetTable("", columns, file=file, rows=file.rows),))


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
        k.decode("utf-8", "replace").lower(): v.decode("utf-8", "replace") for k, v in (field.metadata or {}).items()
    }
    unit = metadata.get("unit") or metadata.get("units")
    if pa.types.is_integer(field.type) or pa.types.is_floating(field.type) or pa.types.is_decimal(field.type):
        return Column(field.name, unit, "the metadata of the column" if unit else "")
    if pa.types.is_timestamp(field.type):
        return Column(field.name, "UTC" if field.type.tz else None, kind="stamp")
    if pa.types.is_duration(field.type):
        return Column(field.name, field.type.unit, "the type of the column")
    if pa.types.is_string(field.type) or pa.types.is_large_string(field.type):
        cells = tuple(str(v or "") for v in sample.column(field.name).to_pylist()) if sample is not None else ()
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
    return numbers(numpy_of(column))
