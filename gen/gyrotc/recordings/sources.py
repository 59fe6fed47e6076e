"""Files of rows as they were when they were opened, known by their hash; those that were read last stay in memory."""

from __future__ import annotations

import hashlib
import io
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path
from threading import Lock

from ..common.arrays import FloatArray, give_back
from ..common.errors import InputError
from ..common.inputs import open_input
from .description import Fault

BLOCK_BYTES = 2**21
"""Bytes that are read at once: bounds memory; a table's whole lines are parsed together."""
_KEPT_BYTES = 2**25  # of columns in memory: forty runs of the paper's size


class Prefix(io.RawIOBase):
    """The first `size` bytes of a file."""

    def __init__(self, path: Path, size: int) -> None:
        self._file, _ = open_input(path, path.name, "a recording")
        self._left = size

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        count: int = self._file.readinto(memoryview(buffer)[: self._left])  # type: ignore[attr-defined]
        self._left -= count
        return count

    def close(self) -> None:
        self._file.close()
        super().close()


class _LastRead:
    """Columns of the files that were read last, `_KEPT_BYTES` at most."""

    def __init__(self) -> None:
        self._kept: OrderedDict[Source, dict[str, FloatArray]] = OrderedDict()
        self._size = 0
        self._lock = Lock()

    def of(self, file: Source) -> dict[str, FloatArray]:
        with self._lock:
            return self._kept.get(file, {})

    def keep(self, file: Source, columns: dict[str, FloatArray]) -> None:
        for values in columns.values():
            values.flags.writeable = False
        with self._lock:
            self._size += _bytes(columns) - _bytes(self._kept.pop(file, {}))
            self._kept[file] = columns
            while self._size > _KEPT_BYTES:
                self._size -= _bytes(self._kept.popitem(last=False)[1])


def _bytes(columns: dict[str, FloatArray]) -> int:
    """Return the bytes of whole arrays in memory; columns may be parts of larger ones."""
    return sum((values if values.base is None else values.base).nbytes for values in columns.values())


_last_read = _LastRead()


class Source(ABC):
    """One file of rows.

    Attributes:
        name: Name in messages.
        path: Where it is.
        size: Number of bytes that are read.
        sha256: Of these bytes, hexadecimal.
        names: Names of the columns.
        torn: Text of an unfinished last line that is left out, empty if there is none.
        row_unit: What `place` counts: "line" or "row".
    """

    name: str
    path: Path
    size: int
    sha256: str
    names: tuple[str, ...]
    torn: str = ""
    row_unit: str

    @abstractmethod
    def read(self, columns: Sequence[str]) -> dict[str, FloatArray] | None:
        """Read columns as float64, NaN for a missing value; None if only `scan` can read the file.

        Raises:
            InputError: The file is damaged.
        """

    @abstractmethod
    def scan(self) -> tuple[dict[str, FloatArray], list[int], list[Fault]]:
        """Read what can be read of a file that `read` cannot make numbers of.

        Returns:
            All columns of the rows that are whole (NaN where a cell is no number), the place of each row, and
            the faults, with a place in `Fault.row`.
        """

    @abstractmethod
    def place(self, row: int) -> int:
        """Place of a row (0 is the first) in the file: number of its line, or of the row counted from 1."""

    def columns(self, names: Sequence[str]) -> dict[str, FloatArray] | None:
        """Read columns, not to be written to. Small files are kept: a job asks for them three times."""
        kept = _last_read.of(self)
        if not all(name in kept for name in names):
            if self.size > _KEPT_BYTES:
                give_back()
            found = self.read(names)
            if found is None:
                return None
            _last_read.keep(self, found)
            kept = found
        return {name: kept[name] for name in names}

    def keep_as_read(self) -> None:
        """Set `sha256`; `check_unchanged` refers to the file as it is now."""
        self.sha256 = self._hash()
        self._stamp = self._stat()

    def check_unchanged(self) -> None:
        """A file that has only grown counts as unchanged.

        Raises:
            InputError: The bytes that were read have been changed.
        """
        if self._stat() != self._stamp and self._hash() != self.sha256:
            raise InputError(self.name, "was changed while it was in use", "a recording that stays as it is")

    def _stat(self) -> tuple[int, int]:
        stat = self.path.stat()
        return stat.st_size, stat.st_mtime_ns

    def _hash(self) -> str:
        digest = hashlib.sha256()
        with Prefix(self.path, self.size) as prefix:
            while block := prefix.read(BLOCK_BYTES):
                digest.update(block)
        return digest.hexdigest()
