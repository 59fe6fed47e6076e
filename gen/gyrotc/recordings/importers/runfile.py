"""One run of an imported data set on disk: Parquet (exact numbers, few bytes, read without parsing) or CSV."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from ...store.opening import create

__all__ = ["Format", "RunFile"]

Format = Literal["csv", "parquet"]
_GROUP_ROWS = 2**20  # of a row group: Arrow's own default


class RunFile:
    """Rows written chunk by chunk.

    Args:
        path: The file.
        format: Its form.
        names: Columns; `pulses` are whole numbers.
    """

    def __init__(self, path: Path, format: Format, names: Sequence[str]) -> None:
        types = [(name, pa.int64() if name == "pulses" else pa.float64()) for name in names]
        self._schema = pa.schema(types)
        self._sink = create(path)
        self._writer: Any
        if format == "csv":
            self._sink.write((",".join(names) + "\n").encode())
            plain = pyarrow.csv.WriteOptions(include_header=False, quoting_style="none")
            self._writer = pyarrow.csv.CSVWriter(self._sink, self._schema, write_options=plain)
        else:
            self._writer = pyarrow.parquet.ParquetWriter(
                self._sink, self._schema, use_dictionary=False, compression="zstd", store_schema=False
            )

    def write(self, columns: dict[str, NDArray[np.float64]]) -> None:
        """Appends rows."""
        arrays = [pa.array(columns[field.name]).cast(field.type) for field in self._schema]
        table = pa.Table.from_arrays(arrays, schema=self._schema)
        if isinstance(self._writer, pyarrow.parquet.ParquetWriter):
            self._writer.write_table(table, row_group_size=_GROUP_ROWS)
        else:
            self._writer.write_table(table)

    def __enter__(self) -> RunFile:
        return self

    def __exit__(self, *error: object) -> None:
        self._writer.close()
        self._sink.close()
