"""HDF5 files, MATLAB 7.3 among them, by `h5py`, part by part."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ....common.errors import InputError, short_reason
from ...tables import (
    MAX_COLUMNS,
    Column,
    LoggerFile,
    ReadPart,
    Vector,
    grouped,
    numbers,
    optional_library,
    rate_of,
    unread,
)
from ..format import Format

_UNIT_KEYS = ("unit", "units", "Unit", "Units", "UNITS", "unit_string")


def open_hdf5(path: Path) -> LoggerFile:
    """An HDF5 file: vectors, columns of matrices, tables; units from the attributes.

    Raises:
        InputError: h5py is not installed, the file is damaged, or holds nothing that can be read.
    """
    h5py = optional_library(path, "h5py", "hdf5", "an HDF5 or MATLAB 7.3 file")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise InputError(path.name, f"cannot be read as HDF5 ({short_reason(error)})", "a whole HDF5 file") from error
    try:
        contents = _Contents(h5py, path)
        contents.read(file)
    except InputError:
        file.close()
        raise
    except (KeyError, OSError, RuntimeError, TypeError, ValueError) as error:
        file.close()
        raise InputError(path.name, f"is damaged ({short_reason(error)})", "a whole HDF5 file") from error
    tables, left = grouped(contents.entries, contents.rates)
    if not tables:
        raise InputError(path.name, "no numeric vectors", "vectors, matrices or tables of numbers")
    facts = {str(k).lower(): _text(v) for k, v in file.attrs.items() if isinstance(v, str | bytes)}
    form = "MATLAB 7.3 file" if contents.matlab else "HDF5 file"
    return LoggerFile(path, form, tables, facts, close=file.close, unread=left)


class _Contents:
    """Contents of a file.

    Attributes:
        entries: Its columns, and what is not read.
        rates: Rows per second by group, with the reason.
        matlab: MATLAB wrote it.
    """

    def __init__(self, h5py: ModuleType, path: Path) -> None:
        self._h5py, self._path = h5py, path
        self.entries: list[Vector | str] = []
        self.rates: dict[str, tuple[float, str]] = {}
        self.matlab = False

    def read(self, file: Any) -> None:
        """Visit every group and data set. Links are not followed: they may lead anywhere."""
        self._links(file, "")
        file.visititems(self._visit)
        self._add_rate("", _stated_rate(file))

    def _visit(self, name: str, node: Any) -> None:
        self.matlab = self.matlab or ("/" not in name and "MATLAB_class" in node.attrs)
        is_data = isinstance(node, self._h5py.Dataset)
        if is_data:
            _refuse_elsewhere(self._path, name, node)
        if name.startswith("#"):
            return
        if isinstance(node, self._h5py.Group):
            self._links(node, f"{name}/")
        if not is_data:
            return
        group = name.rpartition("/")[0]
        if node.size == 1 and node.dtype.kind in "iuf":
            found = rate_of(name, float(np.asarray(node).reshape(-1)[0]))
            self._add_rate(group, found)
            self.entries += [] if found else [unread(name, "one value")]
        else:
            self.entries += _vectors(name, group, node)
        self._add_rate(group, _stated_rate(node))

    def _links(self, node: Any, above: str) -> None:
        for name in node:
            if not isinstance(node.get(name, getlink=True), self._h5py.HardLink):
                self.entries.append(unread(f"{above}{name}", "a link"))

    def _add_rate(self, group: str, found: tuple[float, str] | None) -> None:
        if found:
            self.rates[group] = found


def _refuse_elsewhere(path: Path, name: str, node: Any) -> None:
    """Refuse values that lie in other files: a file from elsewhere may name any file of the user, or a pipe.

    Links to other files need no test, `visititems` does not follow them.
    """
    if node.is_virtual or node.external:
        found = "has its values in other files"
        raise InputError(f"{path.name}, {name}", found, "values in the file itself (h5repack makes it so)")


def _vectors(name: str, group: str, node: Any) -> Iterator[Vector | str]:
    """Yield the columns of a data set, and what of it is not read."""
    last = name.rpartition("/")[2]
    if node.dtype.names and node.ndim == 1:
        for field in node.dtype.names:
            if node.dtype[field].kind in "iuf" and node.dtype[field].shape == ():
                unit = _field_unit(node, field)
                column = Column(field, unit, "an attribute" if unit else "")
                yield Vector(name, name, node.shape[0], column, _part_of_field(node, field))
            else:
                yield unread(f"{name}/{field}", "no numbers")
        return
    if node.dtype.kind not in "iuf" or node.attrs.get("MATLAB_class") == b"char":
        yield unread(name, "no numbers")
        return
    if node.ndim not in (1, 2):
        yield unread(name, f"{node.ndim} dimensions")
        return
    unit = next((_text(node.attrs[k]) for k in _UNIT_KEYS if k in node.attrs), None)
    why = "an attribute" if unit else ""
    if node.ndim == 1:
        yield Vector(group, group, node.shape[0], Column(last, unit, why), _part_of(node, None, True))
        return
    tall = node.shape[0] >= node.shape[1]
    width, rows = min(node.shape), max(node.shape)
    if width > MAX_COLUMNS:
        yield unread(name, f"{width} columns, more than {MAX_COLUMNS}")
        return
    for k in range(width):
        label = last if width == 1 else f"{last}_{'xyz'[k]}" if width == 3 else f"{last}_{k + 1}"
        yield Vector(group, group, rows, Column(label, unit, why), _part_of(node, k, tall))


def _part_of_field(node: Any, field: str) -> ReadPart:
    return lambda a, b: numbers(node[a:b][field])


def _part_of(node: Any, index: int | None, tall: bool) -> ReadPart:
    """Return the reader of a vector, of a column of a matrix, or of a row of a transposed one (as MATLAB stores it)."""
    if index is None:
        return lambda a, b: numbers(node[a:b])
    return lambda a, b: numbers(node[a:b, index] if tall else node[index, a:b])


def _stated_rate(node: Any) -> tuple[float, str] | None:
    """Return the rows per second that an attribute states."""
    for key, value in node.attrs.items():
        if isinstance(value, int | float | np.number) and (found := rate_of(key, float(value))):
            return found
    return None


def _field_unit(node: Any, field: str) -> str | None:
    for key in (f"{field}_unit", f"{field}_units", f"FIELD_{field}_UNITS"):
        if key in node.attrs:
            return _text(node.attrs[key])
    return None


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray):
        value = value.reshape(-1)[0] if value.size else ""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


FORMAT = Format(open_hdf5, (b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3"))
