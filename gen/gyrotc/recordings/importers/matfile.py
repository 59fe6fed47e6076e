"""HDF5 and MATLAB files: those of MATLAB 4 to 7 by `scipy.io`, all others by `h5py`, part by part.

Variables of MATLAB 4 to 7 are read whole: the format keeps each compressed in one piece, and none may exceed 2 GB.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from ...common.errors import InputError
from ...common.inputs import need_memory
from ..tables import Column, LoggerFile, ReadPart, grouped, numbers, optional_library, part_of, rate_of

_NUMBER_BYTES = 8  # of a float64, the widest number that is read
_DEEPEST = 4  # structures within one another: deeper ones are no tables


def open_mat(path: Path) -> LoggerFile:
    """A MATLAB file: numeric vectors, columns of matrices, fields of structs.

    Raises:
        InputError: It is damaged, or holds nothing that can be read.
    """
    try:
        _need_memory(path)
        content = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        from .matfile import open_hdf5

        return open_hdf5(path)
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes of the parser
        what = " ".join(str(error).split())[:100]
        raise InputError(path.name, f"cannot be read as MATLAB file ({what})", "a whole .mat file") from error
    columns: list[tuple[str, str, int, Column, ReadPart]] = []
    rates: dict[str, tuple[float, str]] = {}
    units: dict[str, str] = {}
    opaque: list[str] = []
    for name, value in content.items():
        if not name.startswith("__"):
            for full, leaf in _leaves(name, value, _DEEPEST):
                if isinstance(leaf, str):
                    units[full] = leaf
                elif isinstance(leaf, np.ndarray) and leaf.dtype.kind in "iufb" and leaf.ndim in (1, 2):
                    columns += list(_columns(full, leaf))
                elif np.isscalar(leaf) and isinstance(leaf, int | float | np.number):
                    found = rate_of(full, float(leaf))
                    rates |= {"": found} if found else {}
                else:
                    opaque.append(full)
    tables = grouped([_with_unit(c, units) for c in columns], rates)
    if not tables:
        hint = "arrays: in MATLAB, save('file.mat', '-struct', 'S') of plain vectors, or a timetable by table2struct"
        raise InputError(path.name, f"no numeric vectors (there is {', '.join(opaque[:6]) or 'nothing'})", hint)
    return LoggerFile(path, "MATLAB file", tables)


def _need_memory(path: Path) -> None:
    """Refuses variables that take more memory than is allowed, by their sizes; a few packed bytes may be gigabytes.

    A variable is unpacked, then made an array, so it is there twice for a moment.
    """
    declared = sum(_NUMBER_BYTES * math.prod(shape) for _, shape, _ in scipy.io.whosmat(path))
    need_memory(2.0 * declared, path.name, "its variables")


def _leaves(name: str, value: Any, deep: int) -> Iterator[tuple[str, Any]]:
    """Fields of structs under their full names."""
    if isinstance(value, scipy.io.matlab.mat_struct) and deep:
        for field in value._fieldnames:
            yield from _leaves(f"{name}.{field}", getattr(value, field), deep - 1)
    else:
        yield name, value


def _columns(name: str, values: np.ndarray) -> Iterator[tuple[str, str, int, Column, ReadPart]]:
    if values.ndim == 1:
        flat = numbers(values)
        yield "", "", len(flat), Column(name), part_of(flat)
        return
    tall = values if values.shape[0] >= values.shape[1] else values.T
    if tall.shape[1] > 64:
        return
    for k in range(tall.shape[1]):
        axis = f"_{'xyz'[k]}" if tall.shape[1] == 3 else f"_{k + 1}"
        flat = numbers(tall[:, k])
        yield "", "", len(flat), Column(name + axis), part_of(flat)


def _with_unit(
    entry: tuple[str, str, int, Column, ReadPart], units: dict[str, str]
) -> tuple[str, str, int, Column, ReadPart]:
    """The unit that a text beside a vector states: `rate_unit`, `units.rate`, `rate.unit`."""
    group, table, rows, column, part = entry
    base = column.name.removesuffix("_x").removesuffix("_y").removesuffix("_z")
    head, _, last = base.rpartition(".")
    keys = [f"{base}_unit", f"{base}_units", f"units.{base}", f"unit.{base}", f"{head}.units.{last}"]
    keys += [f"{head}.unit", f"{head}.units", f"{base}.unit", f"{head}.Units"]
    key = next((k for k in keys if k in units), None)
    if key is not None:
        column = Column(column.name, units[key], f"{key} in the file")
    return group, table, rows, column, part


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
