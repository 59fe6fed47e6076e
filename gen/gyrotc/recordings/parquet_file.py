"""Parquet: files of any program batch by batch, within limits, and recordings of numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.inputs import ceiling, need_memory, open_input, refuse_above
from .files import Source
from .values import Fault

_BATCH_ROWS = 2**16  # of a read: half a MiB a column
_HARMLESS_BYTES = 2**26  # 64 MiB, which any host has: below it no ratio of packing is asked about
_COPIES = 2.0  # of the columns while they are checked
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
            raise InputError(
                name, f"cannot be read as Parquet ({_short(error)})", "a whole Parquet file"
            ) from error
        refuse_above("columns", len(self.schema), name, "columns")
        refuse_above("rows", self.rows, name, "rows")
        _refuse_bomb(name, self.size, max(unpacked, 8 * self.rows * len(self.schema)))

    def batches(self, columns: Sequence[str], most: int = _BATCH_ROWS) -> Iterator[pa.RecordBatch]:
        """Batches of columns, at most so many rows each.

        Raises:
            InputError: The file is damaged.
        """
        opened, _ = open_input(self.path, self.name, "a Parquet file")
        at = 0
        with opened:
            try:
                with pq.ParquetFile(opened, pre_buffer=False) as file:
                    for batch in file.iter_batches(most, columns=list(columns), use_threads=False):
                        at += len(batch)
                        yield batch
                if at != self.rows:
                    raise ValueError(f"{at} rows instead of {self.rows}")
            except _DAMAGE as error:
                found = f"is damaged ({_short(error)})"
                raise InputError(self.name, found, "a whole Parquet file") from error


class ParquetFile(Source):
    """One recording.

    Args:
        name: Name in messages.
        path: Where it is.

    Raises:
        InputError: As `ParquetBatches`, or a column holds no numbers.
    """

    row_unit = "row"

    def __init__(self, name: str, path: Path) -> None:
        self.name, self.path = name, path
        self._file = ParquetBatches(name, path)
        self.size = self._file.size
        try:
            self.keep_as_read()
        except OSError as error:
            raise InputError(name, f"cannot be read ({_short(error)})", "a whole Parquet file") from error
        self.names = tuple(self._file.schema.names)
        for field in self._file.schema:
            if not (pa.types.is_integer(field.type) or pa.types.is_floating(field.type)):
                raise InputError(
                    f"{name}, column {field.name}",
                    f"holds {field.type}",
                    "numbers; `gyrotc import` reads stamps and more",
                )

    def read(self, columns: Sequence[str]) -> dict[str, FloatArray]:
        """As `Source.read`, batch by batch; never None."""
        rows = self._file.rows
        need_memory(_COPIES * 8.0 * rows * len(columns), self.name, f"{rows} rows of {len(columns)} columns")
        read = {column: np.empty(rows) for column in columns}
        at = 0
        for batch in self._file.batches(columns):
            for name, values in zip(batch.schema.names, batch.columns, strict=True):
                try:
                    read[name][at : at + len(batch)] = values.to_numpy(zero_copy_only=False)
                except _DAMAGE as error:
                    found = f"is damaged ({_short(error)})"
                    raise InputError(self.name, found, "a whole Parquet file") from error
            at += len(batch)
        return read

    def scan(self) -> tuple[dict[str, FloatArray], list[int], list[Fault]]:
        """As `Source.scan`: a Parquet file has no cells that are no numbers."""
        columns = self.read(self.names)
        return columns, list(range(1, self._file.rows + 1)), []

    def place(self, row: int) -> int:
        """Number of a row, from 1."""
        return row + 1


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
        raise InputError(name, found, f"at most {ceiling('parquet_ratio'):g} times (--max parquet_ratio=...)")


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:120]
