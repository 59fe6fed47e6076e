"""The rows that a recorder writes of a simulated run, written in chunks.

Physics and noise live on a grid of one second; rows are whole numbers of seconds, or a whole number of rows a
second. Any row length therefore shows the same angle and the same temperature readings.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..store.files import create
from . import noise
from .instrument import SimulatedRecord
from .noise import CELL_S

__all__ = ["Format", "RecordingPart", "RowLength", "SimulatedRunFile", "rows"]

_CHUNK_ROWS = 200_000  # at once: 1.6 MB a column
_MOST = 10_000  # rows a second or seconds a row: faster than any gyro is read, slower than any is logged


@dataclass(frozen=True, slots=True)
class RowLength:
    """Length of a row: `cells` cells a row, or `per_cell` rows a cell; one of both is 1."""

    cells: int
    per_cell: int

    @property
    def row_s(self) -> float:
        """Seconds a row."""
        return CELL_S * self.cells / self.per_cell

    @classmethod
    def of(cls, row_s: float, raw_hz: float | None) -> RowLength:
        """Rows of `row_s`, or `raw_hz` rows a second if given.

        Raises:
            InputError: neither a whole number of seconds a row nor a whole number of rows a second.
        """
        given = f"{row_s:g} s" if raw_hz is None else f"{raw_hz:g} Hz"
        per_s = raw_hz if raw_hz is not None else 1.0 / row_s if row_s > 0.0 else 0.0
        per_cell = per_s * CELL_S
        if per_cell > 0.0:
            long, short = cls(round(1.0 / per_cell), 1), cls(1, round(per_cell))
            for ratio, made in ((1.0 / per_cell, long), (per_cell, short)):
                if 1 <= round(ratio) <= _MOST and abs(ratio - round(ratio)) < 1e-9 * ratio:
                    return made
        raise InputError("row length", given, f"1 ... {_MOST} whole seconds a row, or whole rows a second")


@dataclass(frozen=True, slots=True)
class RecordingPart:
    """Consecutive rows.

    Attributes:
        time_s: Start of each row on the record's clock, s, shape (n,).
        temperature_c: Mean of the temperature readings in each row, C, shape (n,).
        channels: Samples of the auxiliary channels, likewise.
        edge_arcsec: Angle read at the rows' edges, arcsec, shape (n + 1,).
    """

    time_s: FloatArray
    temperature_c: FloatArray
    channels: dict[str, FloatArray]
    edge_arcsec: FloatArray


def rows(record: SimulatedRecord, length: RowLength) -> Iterator[RecordingPart]:
    """The rows of a record, in chunks; a last row that is not full is left out."""
    fine = _Fine(record, length.per_cell)
    whole = len(record.reading_c) - len(record.reading_c) % length.cells
    step = max(1, _CHUNK_ROWS // length.per_cell) * length.cells
    for start in range(0, whole, step):
        stop = min(start + step, whole)
        first = start * length.per_cell // length.cells
        count = (stop - start) * length.per_cell // length.cells
        edges = record.angle_arcsec[start : stop + 1 : length.cells]
        yield RecordingPart(
            time_s=length.row_s * np.arange(first, first + count, dtype=np.float64),
            temperature_c=_held(record.reading_c[start:stop], length),
            channels={name: _held(values[start:stop], length) for name, values in record.channels.items()},
            edge_arcsec=edges if length.per_cell == 1 else fine.edges(start, stop),
        )


def _held(readings: FloatArray, length: RowLength) -> FloatArray:
    """Mean of the readings in each row; in rows shorter than a cell, the last reading."""
    if length.per_cell > 1:
        return np.repeat(readings, length.per_cell)
    return np.asarray(readings.reshape(-1, length.cells).mean(axis=1))


class _Fine:
    """Angle at the edges of rows shorter than a cell; at full seconds it is the record's own."""

    def __init__(self, record: SimulatedRecord, parts: int) -> None:
        self._record = record
        self._parts = parts
        self._share = np.arange(1, parts) / parts
        self._bridges, self._phases = (np.random.default_rng(child) for child in record.seeds.spawn(2))

    def edges(self, start: int, stop: int) -> FloatArray:
        """Angle at the edges of all rows from cell `start` to cell `stop`, arcsec."""
        record = self._record
        inner = self._smooth(start, stop)
        inner += noise.bridge_arcsec(self._bridges, self._parts, record.white_arcsec[start:stop])
        if record.quantum_arcsec:
            inner = noise.quantised(inner, record.quantum_arcsec, self._phases.random(inner.shape))
        edges = np.empty((stop - start) * self._parts + 1)
        edges[:: self._parts] = record.angle_arcsec[start : stop + 1]
        edges[:-1].reshape(-1, self._parts)[:, 1:] = inner
        return edges

    def _smooth(self, start: int, stop: int) -> FloatArray:
        """Bias linear within the cell, noise grown evenly, shape (cells, parts − 1)."""
        record, share = self._record, self._share
        bias = record.bias_dph[start : stop + 1, None]
        bowed = 0.5 * CELL_S * (bias[1:] - bias[:-1]) * share * (share - 1.0)
        grown = record.rough_arcsec[start : stop + 1, None]
        return np.asarray(grown[:-1] + (grown[1:] - grown[:-1]) * share + bowed)


Format = Literal["csv", "parquet"]
_RATE_DECIMALS = 9  # deg/h: far below the noise of any row
_DECIMALS = 6  # s, C: far below the resolution of any logger


class _Writer(Protocol):
    def write_table(self, table: pa.Table) -> None: ...
    def close(self) -> None: ...


class SimulatedRunFile:
    """One run on disk, written chunk by chunk.

    Rates are stamped with the start of their row. Pulses are counts since the last row, stamped with the end
    of theirs; a first row starts the clock.
    """

    def __init__(
        self,
        path: Path,
        format: Format,
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
        """Appends rows."""
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
