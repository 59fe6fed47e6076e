"""Feather files and other files of Arrow: batch by batch, with the units and types that Parquet files have."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow as pa
import pyarrow.feather

from ...common.errors import InputError
from .parquet import column_of, values_of
from .tables import CHUNK_ROWS, Chunk, LoggerFile, LoggerTable

_SAMPLE_ROWS = 20  # enough to distinguish text that is a date, a number or a hexadecimal count


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
    columns = tuple(one for field_ in table.schema if (one := column_of(field_, sample)) is not None)
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
            values = {name: values_of(_flat(part.column(name))) for name in wanted}
            yield Chunk(values, first, (first + len(part)) / self.rows)


def _flat(column: pa.ChunkedArray) -> pa.Array:
    return column.chunk(0) if column.num_chunks == 1 else pa.concat_arrays(column.chunks)
