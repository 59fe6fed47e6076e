"""MATLAB files of versions 4 to 7 by `scipy.io`; those of 7.3 are HDF5.

Variables are read whole: the format keeps each compressed in one piece, and none may exceed 2 GB.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ....common.errors import InputError
from ....common.inputs import need_memory
from ...tables import Column, LoggerFile, ReadPart, grouped, numbers, part_of, rate_of
from ..format import Format
from .hdf5 import open_hdf5

_NUMBER_BYTES = 8  # of a float64, the widest number that is read
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
    import scipy.io

    declared = sum(_NUMBER_BYTES * math.prod(shape) for _, shape, _ in scipy.io.whosmat(path))
    need_memory(2.0 * declared, path.name, "its variables")


def _leaves(name: str, value: Any, deep: int) -> Iterator[tuple[str, Any]]:
    """Fields of structs under their full names."""
    if hasattr(value, "_fieldnames") and deep:
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


FORMAT = Format(open_mat, (b"MATLAB 5.0",), endings=(".mat",), nameable=True)
