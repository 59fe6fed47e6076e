"""Parquet: recordings of numbers, which a process of its own reads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.inputs import need_memory, open_input, refuse_above
from .files import Source
from .parser_process import Parser, open_confined
from .tables import LoggerTable
from .values import Fault

_PARSER = Parser(".importers.parquet", "open_numbers", "pyarrow.parquet")
_COPIES = 2.0  # of the columns while they are checked


class ParquetFile(Source):
    """One recording.

    Args:
        name: Name in messages.
        path: Where it is.

    Raises:
        InputError: It cannot be read, is no Parquet, unpacks to more than is allowed, or a column holds no numbers.
    """

    row_unit = "row"

    def __init__(self, name: str, path: Path) -> None:
        self.name, self.path = name, path
        opened, self.size = open_input(path, name, "a Parquet file")
        opened.close()
        refuse_above("recording_mib", self.size / 2**20, name, "MiB")
        with self._opened() as table:
            self.names = tuple(column.name for column in table.columns)
            self._rows = table.rows
        try:
            self.keep_as_read()
        except OSError as error:
            raise InputError(name, f"cannot be read ({error.strerror})", "a whole Parquet file") from error

    @contextmanager
    def _opened(self) -> Iterator[LoggerTable]:
        """Its rows; what is refused of it is refused by its name."""
        try:
            with closing(open_confined(_PARSER, self.path)) as file:
                yield file.tables[0]
        except InputError as error:
            where = self.name + error.where.removeprefix(self.path.name)
            raise InputError(where, error.found, error.expected) from error

    def read(self, columns: Sequence[str]) -> dict[str, FloatArray]:
        """As `Source.read`, part by part; never None."""
        what = f"{self._rows} rows of {len(columns)} columns"
        need_memory(_COPIES * 8.0 * self._rows * len(columns), self.name, what)
        read = {column: np.empty(self._rows) for column in columns}
        at = 0
        with self._opened() as table:
            for chunk in table.chunks(columns):
                end = at + len(chunk)
                if end > self._rows or set(chunk.columns) != set(columns):
                    raise InputError(self.name, "has other rows than it states", "a whole Parquet file")
                for name, values in chunk.columns.items():
                    read[name][at:end] = values
                at = end
        if at != self._rows:
            raise InputError(self.name, f"has {at} rows, and states {self._rows}", "a whole Parquet file")
        return read

    def scan(self) -> tuple[dict[str, FloatArray], list[int], list[Fault]]:
        """As `Source.scan`: a Parquet file has no cells that are no numbers."""
        columns = self.read(self.names)
        return columns, list(range(1, self._rows + 1)), []

    def place(self, row: int) -> int:
        """Number of a row, from 1."""
        return row + 1
