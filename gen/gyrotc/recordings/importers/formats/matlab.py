"""MATLAB files of versions 4 to 7 by `scipy.io`; those of 7.3 are HDF5.

Variables are read whole: the format keeps each compressed in one piece, and none may exceed 2 GB.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....common.errors import InputError, short_reason
from ....common.inputs import need_memory
from ...tables import MAX_COLUMNS, Column, LoggerFile, Vector, grouped, numbers, part_of, rate_of, unread
from ..format import Format
from .hdf5 import open_hdf5

_NUMBER_BYTES = 8  # of a float64, the widest number that is read
_IN_FILE = "{} in the file"  # why a column has its unit
_DEEPEST = 4  # structures within one another: deeper ones are no tables


def open_mat(path: Path) -> LoggerFile:
    """A MATLAB file: numeric vectors, columns of matrices, fields of structs.

    Raises:
        InputError: It is damaged, or holds nothing that can be read.
    """
    import scipy.io

    try:
        _need_memory(path)
        content = scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        return open_hdf5(path)
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes of the parser
        raise InputError(
            path.name, f"cannot be read as MATLAB file ({short_reason(error)})", "a whole .mat file"
        ) from error
    entries: list[Vector | str] = []
    rates: dict[str, tuple[float, str]] = {}
    units: dict[str, str] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            for full, leaf in _leaves(name, value, _DEEPEST):
                if isinstance(leaf, str):
                    units[full] = leaf
                elif isinstance(leaf, np.ndarray):
                    entries += _vectors(full, leaf)
                elif np.isscalar(leaf) and isinstance(leaf, int | float | np.number):
                    found = rate_of(full, float(leaf))
                    rates |= {"": found} if found else {}
                    entries += [] if found else [unread(full, "one value")]
                else:
                    entries.append(unread(full, f"a {type(leaf).__name__} of MATLAB"))
    entries = [_with_unit(one, units) if isinstance(one, Vector) else one for one in entries]
    known = {one.column.why for one in entries if isinstance(one, Vector)}
    texts = [unread(name, "text") for name in units if _IN_FILE.format(name) not in known]
    tables, left = grouped([*entries, *texts], rates)
    if not tables:
        hint = "arrays: in MATLAB, save('file.mat', '-struct', 'S') of plain vectors, or a timetable by table2struct"
        raise InputError(path.name, f"no numeric vectors (there is {', '.join(left[:6]) or 'nothing'})", hint)
    return LoggerFile(path, "MATLAB file", tables, unread=left)


def _need_memory(path: Path) -> None:
    """Refuse variables that take more memory than allowed, by their sizes; a few packed bytes may be gigabytes.

    A variable is unpacked, then made an array, so it is there twice for a moment.
    """
    import scipy.io

    declared = sum(_NUMBER_BYTES * math.prod(shape) for _, shape, _ in scipy.io.whosmat(path))
    need_memory(2.0 * declared, path.name, "its variables")


def _leaves(name: str, value: Any, deep: int) -> Iterator[tuple[str, Any]]:
    """Yield the fields of structs under their full names."""
    if hasattr(value, "_fieldnames") and deep:
        for field in value._fieldnames:
            yield from _leaves(f"{name}.{field}", getattr(value, field), deep - 1)
    else:
        yield name, value


def _vectors(name: str, values: np.ndarray) -> Iterator[Vector | str]:
    """Yield the columns of an array, or what keeps it from being read."""
    if values.dtype.kind not in "iufb":
        yield unread(name, "no numbers")
        return
    if values.ndim not in (1, 2):
        yield unread(name, f"{values.ndim} dimensions")
        return
    if values.ndim == 1:
        flat = numbers(values)
        yield Vector("", "", len(flat), Column(name), part_of(flat))
        return
    tall = values if values.shape[0] >= values.shape[1] else values.T
    if tall.shape[1] > MAX_COLUMNS:
        yield unread(name, f"{tall.shape[1]} columns, more than {MAX_COLUMNS}")
        return
    for k in range(tall.shape[1]):
        axis = f"_{'xyz'[k]}" if tall.shape[1] == 3 else f"_{k + 1}"
        flat = numbers(tall[:, k])
        yield Vector("", "", len(flat), Column(name + axis), part_of(flat))


def _with_unit(vector: Vector, units: dict[str, str]) -> Vector:
    """Return a vector with the unit that a text beside it states: `rate_unit`, `units.rate`, `rate.unit`."""
    column = vector.column
    base = column.name.removesuffix("_x").removesuffix("_y").removesuffix("_z")
    head, _, last = base.rpartition(".")
    keys = [f"{base}_unit", f"{base}_units", f"units.{base}", f"unit.{base}", f"{head}.units.{last}"]
    keys += [f"{head}.unit", f"{head}.units", f"{base}.unit", f"{head}.Units"]
    key = next((k for k in keys if k in units), None)
    if key is None:
        return vector
    return replace(vector, column=Column(column.name, units[key], _IN_FILE.format(key)))


FORMAT = Format(open_mat, (b"MATLAB 5.0",), endings=(".mat",), nameable=True)
