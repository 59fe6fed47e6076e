"""HDF5 files, MATLAB 7.3 among them, by `h5py`, part by part."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ....common.errors import InputError
from ...tables import Column, LoggerFile, ReadPart, grouped, numbers, optional_library, rate_of
from ..format import Format

_UNIT_KEYS = ("unit", "units", "Unit", "Units", "UNITS", "unit_string")
_MOST_COLUMNS = 64  # of a two-dimensional set that is split into columns: wider ones are pictures


def open_hdf5(path: Path) -> LoggerFile:
    """An HDF5 file: vectors, columns of matrices, tables; units from the attributes.

    Raises:
        InputError: h5py is not installed, the file is damaged, or holds nothing that can be read.
    """
    h5py = optional_library(path, "h5py", "hdf5", "an HDF5 or MATLAB 7.3 file")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        what = " ".join(str(error).split())[:100]
        raise InputError(path.name, f"cannot be read as HDF5 ({what})", "a whole HDF5 file") from error
    columns: list[tuple[str, str, int, Column, ReadPart]] = []
    rates: dict[str, tuple[float, str]] = {}

    matlab = False

    def visit(name: str, node: Any) -> None:
        nonlocal matlab
        matlab = matlab or ("/" not in name and "MATLAB_class" in node.attrs)
        if isinstance(node, h5py.Dataset):
            _refuse_elsewhere(path, name, node)
        if not isinstance(node, h5py.Dataset) or name.startswith("#"):
            return
        group = name.rpartition("/")[0]
        if node.size == 1 and node.dtype.kind in "iuf":
            found = rate_of(name, float(np.asarray(node).reshape(-1)[0]))
            rates.update({group: found} if found else {})
        columns.extend(_set_columns(name, group, node))
        rates.update({group: found} if (found := _stated_rate(node)) else {})

    try:
        file.visititems(visit)
        rates.update({"": found} if (found := _stated_rate(file)) else {})
    except InputError:
        file.close()
        raise
    except (KeyError, OSError, RuntimeError, TypeError, ValueError) as error:
        file.close()
        what = " ".join(str(error).split())[:100]
        raise InputError(path.name, f"is damaged ({what})", "a whole HDF5 file") from error
    tables = grouped(columns, rates)
    if not tables:
        raise InputError(path.name, "no numeric vectors", "vectors, matrices or tables of numbers")
    facts = {str(k).lower(): _text(v) for k, v in file.attrs.items() if isinstance(v, str | bytes)}
    return LoggerFile(path, "MATLAB 7.3 file" if matlab else "HDF5 file", tables, facts, close=file.close)


def _refuse_elsewhere(path: Path, name: str, node: Any) -> None:
    """Values that lie in other files are not read: a file of others may name any file of the user, or a pipe.

    Links to other files need no test, `visititems` does not follow them.
    """
    if node.is_virtual or node.external:
        found = "has its values in other files"
        raise InputError(f"{path.name}, {name}", found, "values in the file itself (h5repack makes it so)")


def _set_columns(name: str, group: str, node: Any) -> Iterator[tuple[str, str, int, Column, ReadPart]]:
    last = name.rpartition("/")[2]
    if node.dtype.names:
        for field in node.dtype.names:
            if node.dtype[field].kind in "iuf" and node.dtype[field].shape == ():
                unit = _field_unit(node, field)
                column = Column(field, unit, "an attribute" if unit else "")
                yield name, name, node.shape[0], column, _part_of_field(node, field)
        return
    if node.dtype.kind not in "iuf" or node.ndim not in (1, 2) or node.attrs.get("MATLAB_class") == b"char":
        return
    unit = next((_text(node.attrs[k]) for k in _UNIT_KEYS if k in node.attrs), None)
    why = "an attribute" if unit else ""
    if node.ndim == 1:
        yield group, group, node.shape[0], Column(last, unit, why), _part_of(node, None, True)
        return
    tall = node.shape[0] >= node.shape[1]
    width, rows = min(node.shape), max(node.shape)
    for k in range(width) if width <= _MOST_COLUMNS else ():
        label = last if width == 1 else f"{last}_{'xyz'[k]}" if width == 3 else f"{last}_{k + 1}"
        yield group, group, rows, Column(label, unit, why), _part_of(node, k, tall)


def _part_of_field(node: Any, field: str) -> ReadPart:
    return lambda a, b: numbers(node[a:b][field])


def _part_of(node: Any, index: int | None, tall: bool) -> ReadPart:
    """Reads a vector, a column of a matrix, or a row of one that lies on its side (as MATLAB stores it)."""
    if index is None:
        return lambda a, b: numbers(node[a:b])
    return lambda a, b: numbers(node[a:b, index] if tall else node[index, a:b])


def _stated_rate(node: Any) -> tuple[float, str] | None:
    """Rows per second that an attribute states."""
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
