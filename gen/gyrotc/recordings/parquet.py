"""Parquet files, read batch by batch in this process, and recordings of a data set in them.

Damaged files of numbers make pyarrow fail cleanly. A few bytes of text may unpack to gigabytes, as a dictionary holds
each text once; so columns of text stay dictionaries while they are read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..common.arrays import FloatArray, numpy_of
from ..common.errors import InputError, short_reason
from ..common.inputs import ceiling, need_memory, open_input, refuse_above
from .csv_file import LONGEST_NUMBER
from .description import Fault
from .sources import Source
from .tables import CHUNK_ROWS

# Without a buffer the whole column of a row group is read at once, bytes of a column.
_BUFFER_BYTES = 2**20
# Which any host has: below it no ratio of packing is asked about, bytes.
_HARMLESS_BYTES = 2**26
# The values of a file are in memory twice while they are checked.
_COPIES = 2.0
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
                name, f"cannot be read as Parquet ({short_reason(error)})", "a whole Parquet file"
            ) from error
        refuse_above("columns", len(self.schema), name, "columns")
        refuse_above("rows", self.rows, name, "rows")
        _refuse_bomb(name, self.size, max(unpacked, 8 * self.rows * len(self.schema)))

    def batches(self, columns: Sequence[str], most: int = CHUNK_ROWS) -> Iterator[pa.RecordBatch]:
        """Yield batches of columns, at most `most` rows each.

        Raises:
            InputError: The file is damaged, or a text is longer than any that is a number or a stamp.
        """
        opened, _ = open_input(self.path, self.name, "a Parquet file")
        texts = [field.name for field in self.schema if is_text(field.type)]
        at = 0
        with opened:
            try:
                with pq.ParquetFile(opened, pre_buffer=False, buffer_size=_BUFFER_BYTES, read_dictionary=texts) as file:
                    for batch in file.iter_batches(most, columns=list(columns), use_threads=False):
                        at += len(batch)
                        yield _with_texts(self.name, batch)
                if at != self.rows:
                    raise ValueError(f"{at} rows instead of {self.rows}")
            except _DAMAGE as error:
                found = f"is damaged ({short_reason(error)})"
                raise InputError(self.name, found, "a whole Parquet file") from error


def is_text(kind: pa.DataType) -> bool:
    """Test whether values of a type of Arrow are texts."""
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def _with_texts(name: str, batch: pa.RecordBatch) -> pa.RecordBatch:
    """A batch with texts in place of dictionaries.

    Raises:
        InputError: A text is longer than a cell may be.
    """
    for k, field in enumerate(batch.schema):
        if pa.types.is_dictionary(field.type):
            column = batch.column(k)
            longest = max((len(text or "") for text in column.dictionary.to_pylist()), default=0)
            if longest > LONGEST_NUMBER:
                found = f"a text of {longest} characters"
                raise InputError(f"{name}, column {field.name}", found, f"at most {LONGEST_NUMBER} in a cell")
            batch = batch.set_column(k, pa.field(field.name, pa.string()), column.cast(pa.string()))
    return batch


def _unpacked(metadata: pq.FileMetaData) -> int:
    """Return the bytes of all pages once unpacked, as the file states them.

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


class ParquetFile(Source):
    """One recording of a data set.

    Args:
        name: Name in messages.
        path: Where it is.

    Raises:
        InputError: It cannot be read, is no Parquet, unpacks to more than is allowed, or a column holds no numbers.
    """

    row_unit = "row"

    def __init__(self, name: str, path: Path) -> None:
        self.name, self.path = name, path
        self._batches = ParquetBatches(name, path)
        for field in self._batches.schema:
            if not (pa.types.is_integer(field.type) or pa.types.is_floating(field.type)):
                expected = "numbers; `gyrotc import` reads stamps and more"
                raise InputError(f"{name}, column {field.name}", f"holds {field.type}", expected)
        self.names = tuple(self._batches.schema.names)
        self.size = self._batches.size
        try:
            self.keep_as_read()
        except OSError as error:
            raise InputError(name, f"cannot be read ({error.strerror})", "a whole Parquet file") from error

    def read(self, columns: Sequence[str]) -> dict[str, FloatArray]:
        """Read columns batch by batch, never None; see `Source.read`."""
        rows = self._batches.rows
        need_memory(_COPIES * 8.0 * rows * len(columns), self.name, f"{rows} rows of {len(columns)} columns")
        read = {column: np.empty(rows) for column in columns}
        at = 0
        for batch in self._batches.batches(columns):
            end = at + len(batch)
            if end > rows or set(batch.schema.names) != set(columns):
                raise InputError(self.name, "has other rows than it states", "a whole Parquet file")
            for name, values in zip(batch.schema.names, batch.columns, strict=True):
                read[name][at:end] = numpy_of(values)
            at = end
        return read

    def scan(self) -> tuple[dict[str, FloatArray], list[int], list[Fault]]:
        """Read all columns, since no cell of a Parquet file can be anything but a number; see `Source.scan`."""
        columns = self.read(self.names)
        return columns, list(range(1, self._batches.rows + 1)), []

    def place(self, row: int) -> int:
        """Number of a row, from 1."""
        return row + 1
