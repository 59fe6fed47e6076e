"""Files of numpy: arrays by name (`.npz`), and one array (`.npy`), also one whose columns have names."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...common.inputs import need_memory
from ..tables import Column, LoggerFile, Part, grouped, numbers, part_of, rate_of

_MOST_COLUMNS = 64  # of a matrix that is split into columns: wider ones are pictures


def open_numpy(path: Path) -> LoggerFile:
    """A file of `numpy.savez` or `numpy.save`; arrays of objects are not unpacked, they may hold code.

    Raises:
        InputError: It is damaged, or holds no numeric vectors.
    """
    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                need_memory(float(sum(i.file_size for i in archive.infolist())), path.name, "its arrays")
            with np.load(path, allow_pickle=False) as archive:
                arrays = {name: archive[name] for name in archive.files}
        else:
            arrays = {"": np.load(path, allow_pickle=False)}
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        what = " ".join(str(error).split())[:100]
        raise InputError(path.name, f"cannot be read as a file of numpy ({what})", "arrays of numbers") from error
    columns: list[tuple[str, str, int, Column, Part]] = []
    rates: dict[str, tuple[float, str]] = {}
    units = {name: str(values) for name, values in arrays.items() if values.dtype.kind == "U" and values.ndim == 0}
    for name, values in arrays.items():
        if values.size == 1 and values.dtype.kind in "iuf":
            found = rate_of(name, float(values.reshape(-1)[0]))
            rates |= {"": found} if found else {}
        columns += [_entry(label, flat, units) for label, flat in _columns(name, values)]
    tables = grouped(columns, rates)
    if not tables:
        raise InputError(
            path.name, "no numeric vectors", "arrays of numbers: numpy.savez(file, time_s=..., rate_dps=...)"
        )
    return LoggerFile(path, "NumPy file", tables)


def _columns(name: str, values: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Vectors, fields of records, columns of matrices; times as seconds since the first."""
    if values.dtype.names:
        for field in values.dtype.names:
            yield from _columns(field, values[field])
    elif values.dtype.kind in "Mm" and values.ndim == 1:
        yield name, values.astype(f"{values.dtype.kind}8[ns]")
    elif values.dtype.kind in "iufb" and values.ndim == 1:
        yield name, numbers(values)
    elif values.dtype.kind in "iuf" and values.ndim == 2 and min(values.shape) <= _MOST_COLUMNS:
        tall = values if values.shape[0] >= values.shape[1] else values.T
        for k in range(tall.shape[1]):
            axis = f"_{'xyz'[k]}" if tall.shape[1] == 3 else f"_{k + 1}"
            yield (name + axis).lstrip("_"), numbers(tall[:, k])


def _entry(label: str, flat: np.ndarray, units: dict[str, str]) -> tuple[str, str, int, Column, Part]:
    """A column; its unit stands in a text beside it: `rate_unit`, `rate_units`."""
    base = label.removesuffix("_x").removesuffix("_y").removesuffix("_z")
    key = next((k for k in (f"{base}_unit", f"{base}_units") if k in units), None)
    if flat.dtype.kind == "M":
        column = Column(label, kind="stamp")
    elif flat.dtype.kind == "m":
        column, flat = Column(label, "ns", "the type of the array"), flat.astype(np.int64)
    else:
        column = Column(label, units[key] if key else None, f"{key} in the file" if key else "")
    return "", "", len(flat), column, part_of(flat)
