"""Rows of a simulated run: means over whole cells, or parts of a cell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..common.arrays import FloatArray
from ..common.errors import InputError
from .angle_noise import bridge_arcsec, quantised
from .grid import CELL_S
from .record import SimulatedRecord

_CHUNK_ROWS = 200_000  # rows at once: 1.6 MB a column
_MAX_RATIO = 10_000  # rows a second or seconds a row: faster than any gyro is read, slower than any is logged


@dataclass(frozen=True, slots=True)
class RowLength:
    """Length of a row: `cells` cells a row, or `per_cell` rows a cell; one of both is 1."""

    cells: int
    per_cell: int

    @property
    def row_s(self) -> float:
        """Length of a row, s."""
        return CELL_S * self.cells / self.per_cell

    @classmethod
    def of(cls, row_s: float, raw_hz: float | None) -> RowLength:
        """Return the length of rows of `row_s` seconds, or of `raw_hz` rows a second if given.

        Raises:
            InputError: neither a whole number of seconds a row nor a whole number of rows a second.
        """
        given = f"{row_s:g} s" if raw_hz is None else f"{raw_hz:g} Hz"
        per_s = raw_hz if raw_hz is not None else 1.0 / row_s if row_s > 0.0 else 0.0
        per_cell = per_s * CELL_S
        if per_cell > 0.0:
            long, short = cls(round(1.0 / per_cell), 1), cls(1, round(per_cell))
            for ratio, made in ((1.0 / per_cell, long), (per_cell, short)):
                if 1 <= round(ratio) <= _MAX_RATIO and abs(ratio - round(ratio)) < 1e-9 * ratio:
                    return made
        raise InputError("row length", given, f"1 ... {_MAX_RATIO} whole seconds a row, or whole rows a second")


@dataclass(frozen=True, slots=True)
class RecordingPart:
    """Consecutive rows of a run.

    Attributes:
        time_s: Start of each row on the record's clock, s, shape (n,).
        temperature_c: Mean of the temperature readings in each row, C, shape (n,).
        channels: Mean of each auxiliary channel in each row, shape (n,).
        edge_arcsec: Angle read at the rows' edges, arcsec, shape (n + 1,).
    """

    time_s: FloatArray
    temperature_c: FloatArray
    channels: dict[str, FloatArray]
    edge_arcsec: FloatArray


def rows(record: SimulatedRecord, length: RowLength) -> Iterator[RecordingPart]:
    """Form the rows of a run, in chunks; a last row that is not full is left out."""
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
    """Return the mean of the readings in each row; in rows shorter than a cell, the last reading."""
    if length.per_cell > 1:
        return np.repeat(readings, length.per_cell)
    return np.asarray(readings.reshape(-1, length.cells).mean(axis=1))


class _Fine:
    """Angle at the edges of rows shorter than a cell; at the edges of cells it is that of the run."""

    def __init__(self, record: SimulatedRecord, parts: int) -> None:
        self._record = record
        self._parts = parts
        self._share = np.arange(1, parts) / parts
        self._bridges, self._phases = (np.random.default_rng(child) for child in record.seeds.spawn(2))

    def edges(self, start: int, stop: int) -> FloatArray:
        """Draw the angle at the edges of all rows from cell `start` to cell `stop`, arcsec."""
        record = self._record
        inner = self._smooth(start, stop)
        inner += bridge_arcsec(self._bridges, self._parts, record.white_arcsec[start:stop])
        if record.quantum_arcsec:
            inner = quantised(inner, record.quantum_arcsec, self._phases.random(inner.shape))
        edges = np.empty((stop - start) * self._parts + 1)
        edges[:: self._parts] = record.angle_arcsec[start : stop + 1]
        edges[:-1].reshape(-1, self._parts)[:, 1:] = inner
        return edges

    def _smooth(self, start: int, stop: int) -> FloatArray:
        """Return the angle with a bias linear in time and noise that grows evenly, shape (cells, parts − 1)."""
        record, share = self._record, self._share
        bias = record.bias_dph[start : stop + 1, None]
        bowed = 0.5 * CELL_S * (bias[1:] - bias[:-1]) * share * (share - 1.0)
        grown = record.rough_arcsec[start : stop + 1, None]
        return np.asarray(grown[:-1] + (grown[1:] - grown[:-1]) * share + bowed)
