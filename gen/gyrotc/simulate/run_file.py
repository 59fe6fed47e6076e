"""The file of a simulated run, written chunk by chunk."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from ..recordings.importers.rows import FileFormat
from ..results.files import create
from .rows import RecordingPart

_RATE_DECIMALS = 9  # deg/h: far below the noise of any row
_DECIMALS = 6  # s, C: far below the resolution of any logger


class SimulatedRunFile:
    """The file of one run while it is written.

    Rates are stamped with the start of their row. Pulses are counts since the last row, stamped with the end
    of theirs; a first row starts the clock.
    """

    def __init__(
        self,
        path: Path,
        format: FileFormat,
        *,
        row_s: float,
        pulse_weight_arcsec: float | None,
        channels: Sequence[str] = (),
    ) -> None:
        self._row_s = row_s
        self._weight = pulse_weight_arcsec
        self._started = False
        value = ("rate_dph", pa.float64()) if pulse_weight_arcsec is None else ("pulses", pa.int64())
        floats = [(name, pa.float64()) for name in channels]
        self._schema = pa.schema([("time_s", pa.float64()), ("temperature_c", pa.float64()), value, *floats])
        self._writer: _Writer
        self._sink = create(path)
        if format == "csv":
            self._sink.write((",".join(self._schema.names) + "\n").encode("utf-8"))
            plain = pyarrow.csv.WriteOptions(include_header=False, quoting_style="none")
            self._writer = pyarrow.csv.CSVWriter(self._sink, self._schema, write_options=plain)
        else:
            self._writer = pyarrow.parquet.ParquetWriter(self._sink, self._schema, use_dictionary=False)

    def write(self, chunk: RecordingPart) -> None:
        """Append rows."""
        columns = [chunk.temperature_c, *chunk.channels.values()]
        rounded = [np.round(column, _DECIMALS) for column in columns]
        time_s: NDArray[Any] = chunk.time_s
        value: NDArray[Any]
        if self._weight is None:
            value = np.round(np.diff(chunk.edge_arcsec) / self._row_s, _RATE_DECIMALS)
        else:
            value = np.diff(np.floor(chunk.edge_arcsec / self._weight).astype(np.int64))
            time_s = time_s + self._row_s
            if not self._started:
                time_s, value = np.append(0.0, time_s), np.append(0, value)
                rounded = [np.append(column[0], column) for column in rounded]
        self._started = True
        arrays = [np.round(time_s, _DECIMALS), rounded[0], value, *rounded[1:]]
        self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema))

    def __enter__(self) -> SimulatedRunFile:
        return self

    def __exit__(self, *error: object) -> None:
        self._writer.close()
        self._sink.close()


class _Writer(Protocol):
    def write_table(self, table: pa.Table) -> None: ...
    def close(self) -> None: ...
