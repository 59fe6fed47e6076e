"""Parquet recordings, read row group by row group."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.inputs import ceiling, need_memory, open_input, refuse_above
from .files import Source
from .values import Fault

__all__ = ["ParquetFile"]

_BATCH_ROWS = 2**16  # of a read: half a MiB a column
_HARMLESS_BYTES = 2**26  # 64 MiB, which any host has: below it no ratio of packing is asked about
_COPIES = 2.0  # of the columns while they are checked
_DAMAGE = (pa.ArrowException, OSError, ValueError, MemoryError, OverflowError)  # of whatever pyarrow meets


class ParquetFile(Source):
    """One Parquet file.

    Args:
        name: Name in messages.
        path: Where it is.

    Raises:
        InputError: It cannot be read, is no Parquet, or has a column that holds no numbers.
    """

    row_unit = "row"

    def __init__(self, name: str, path: Path) -> None:
        self.name = name
        self.path = path
        opened, self.size = open_input(path, name, "a Parquet file")
        refuse_above("recording_mib", self.size / 2**20, name, "MiB")
        try:
            with opened, pq.ParquetFile(opened) as file:
                metadata, schema = file.metadata, file.schema_arrow
                self._n_rows = metadata.num_rows
                unpacked = _unpacked(metadata)
            self.keep_as_read()
        except _DAMAGE as error:
            raise InputError(
                name, f"cannot be read as Parquet ({_short(error)})", "a whole Parquet file"
            ) from error
        self.names = tuple(schema.names)
        refuse_above("columns", len(self.names), name, "columns")
        refuse_above("rows", self._n_rows, name, "rows")
        _refuse_bomb(name, self.size, max(unpacked, 8 * self._n_rows * len(self.names)))
        for field in schema:
            if not (pa.types.is_integer(field.type) or pa.types.is_floating(field.type)):
                raise InputError(
                    f"{name}, column {field.name}",
                    f"holds {field.type}",
                    "numbers; `gyrotc import` reads stamps and more",
                )

    def read(self, columns: Sequence[str]) -> dict[str, FloatArray]:
        """As `Source.read`, row group by row group; never None."""
        at = 0
        need_memory(
            _COPIES * 8.0 * self._n_rows * len(columns),
            self.name,
            f"{self._n_rows} rows of {len(columns)} columns",
        )
        opened, _ = open_input(self.path, self.name, "a Parquet file")
        try:
            read = {column: np.empty(self._n_rows) for column in columns}
            with opened, pq.ParquetFile(opened, pre_buffer=False) as file:
                for batch in file.iter_batches(_BATCH_ROWS, columns=list(columns), use_threads=False):
                    for name, values in zip(batch.schema.names, batch.columns, strict=True):
                        read[name][at : at + len(batch)] = values.to_numpy(zero_copy_only=False)
                    at += len(batch)
            if at != self._n_rows:
                raise ValueError(f"{at} rows instead of {self._n_rows}")
        except _DAMAGE as error:
            raise InputError(self.name, f"is damaged ({_short(error)})", "a whole Parquet file") from error
        return read

    def scan(self) -> tuple[dict[str, FloatArray], list[int], list[Fault]]:
        """As `Source.scan`: a Parquet file has no cells that are no numbers."""
        columns = self.read(self.names)
        return columns, list(range(1, self._n_rows + 1)), []

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
