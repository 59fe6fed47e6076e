"""Select rows of a table: one column picks rows, another names the device that they are of."""

from __future__ import annotations

import shlex
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from ...common.errors import InputError, quoted
from ..csv_file import number_in
from ..devices import MAX_DEVICES, names_device
from ..tables import Chunk, Column, LoggerTable

_MAX_LISTED = 4
NO_DEVICE = "none"


@dataclass(frozen=True, slots=True)
class Where:
    """The rows in which a column holds one value, a number or a text."""

    column: str
    value: str

    @staticmethod
    def of(text: str) -> Where:
        """The condition that is written as `COLUMN == VALUE`.

        Raises:
            InputError: It is none.
        """
        column, equal, value = (part.strip().strip("\"'") for part in text.partition("=="))
        if not (column and equal and value):
            raise InputError("where", quoted(text), "COLUMN == VALUE, such as 'id == 3'")
        return Where(column, _canonical(value))

    def __str__(self) -> str:
        return f"{self.column} == {self.value}"

    def rows(self, values: Any) -> NDArray[np.bool_]:
        """Test which values of the column are the one."""
        names, codes = _coded(values)
        return codes == names.index(self.value) if self.value in names else np.zeros(len(codes), dtype=bool)


def device_column(table: LoggerTable, stated: str | None, taken: Collection[str]) -> Column | None:
    """The column that names the gyro of each row: as stated, else the first of such a name; None: there is none.

    Args:
        stated: Name of the column, or "none".
        taken: Columns that pick the rows or are measured; such a one names no gyro unless it is stated.
    """
    if stated is not None:
        return None if stated == NO_DEVICE else table.column(stated)
    for column in table.columns:
        if names_device(column.name) and column.kind != "stamp" and column.name not in taken:
            return column
    return None


class Device:
    """The gyro that the rows of a file are of, by the values of a column.

    Args:
        file: Name for messages.
        table: The table of the rows.
        column: The column; None: none names a gyro.
        stated: The user named the column: whatever it holds is a device.

    Attributes:
        name: The device; empty while there is none.
    """

    def __init__(self, file: str, table: LoggerTable, column: Column | None, *, stated: bool) -> None:
        self.name = ""
        self._file, self._table, self._column, self._stated = file, table, column, stated

    @property
    def names(self) -> list[str]:
        """Names of the columns that it reads."""
        return [self._column.name] if self._column is not None else []

    def look(self, chunk: Chunk) -> None:
        """Check the rows of a chunk.

        Raises:
            InputError: They are of several devices, or of another one than the rows before.
        """
        if self._column is None:
            return
        names, codes = _coded(chunk.columns[self._column.name])
        if not self._stated and not self.name and len(names) > MAX_DEVICES:
            self._column = None  # it counts, or says something else of the rows
            return
        if not names:
            return
        self.name = self.name or names[int(codes[np.argmax(codes >= 0)])]
        own = names.index(self.name) if self.name in names else -2
        other = (codes >= 0) & (codes != own)
        if other.any():
            at = int(np.argmax(other))
            every = [self.name, *(name for name in names if name != self.name)]
            raise several_devices(f"{self._file}, {self._table.place(chunk.row(at))}", self._column.name, every)


def several_devices(where: str, column: str, names: Sequence[str]) -> InputError:
    """The refusal of rows of several devices."""
    more = f" and {len(names) - _MAX_LISTED} more" if len(names) > _MAX_LISTED else ""
    found = f"column {column} names several devices: {', '.join(map(repr, names[:_MAX_LISTED]))}{more}"
    condition = shlex.quote(f"{column} == {names[0]}")
    expected = (
        f"the rows of one gyro in a data set: --set where={condition} picks them, "
        f"--column device={NO_DEVICE} if the column names no gyros"
    )
    return InputError(where, found, expected)


def _coded(values: Any) -> tuple[list[str], NDArray[np.int64]]:
    """Distinct values as they are compared, and of each row the number of its value; -1: it has none."""
    if isinstance(values, pa.Array):
        encoded = pc.dictionary_encode(values)
        texts = [_canonical(text) for text in encoded.dictionary.to_pylist()]
        codes = np.asarray(pc.fill_null(encoded.indices, -1).to_numpy(zero_copy_only=False), dtype=np.int64)
    else:
        numbers = np.asarray(values)
        distinct, inverse = np.unique(numbers[np.isfinite(numbers)], return_inverse=True)
        texts = [_canonical(str(value)) for value in distinct.tolist()]
        codes = np.full(len(numbers), -1, dtype=np.int64)
        codes[np.isfinite(numbers)] = inverse
    names = list(dict.fromkeys(text for text in texts if text))
    places = np.array([names.index(text) if text else -1 for text in texts] + [-1], dtype=np.int64)
    return names, places[codes]


def _canonical(text: str) -> str:
    """A number or a text as it is compared: `3`, `3.0` and `03` are one value."""
    text = text.strip()
    number = number_in(text)
    return text if number is None else f"{number:.17g}"
