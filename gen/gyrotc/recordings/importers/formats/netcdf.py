"""NetCDF files by xarray, which knows the conventions for times, fill values, scales and offsets (CF, 4.4 and 8.1)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
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


def open_netcdf(path: Path) -> LoggerFile:
    """A NetCDF file of version 3 or 4: variables over one dimension are columns of one table.

    Raises:
        InputError: xarray is not installed, the file is damaged, or holds nothing that can be read.
    """
    xarray = optional_library(path, "xarray", "netcdf", "a NetCDF file")
    with path.open("rb") as file:
        classic = file.read(3) == b"CDF"
    if not classic:
        optional_library(path, "h5netcdf", "netcdf", "a NetCDF 4 file")
    try:
        data = xarray.open_dataset(path, engine="scipy" if classic else "h5netcdf", decode_timedelta=True)
    except Exception as error:  # whatever a damaged file makes of the parser
        raise InputError(
            path.name, f"cannot be read as NetCDF ({short_reason(error)})", "a whole NetCDF file"
        ) from error
    entries = [entry for name in data.variables for entry in _vectors(str(name), data[name])]
    rates: dict[str, tuple[float, str]] = {}
    for key, value in data.attrs.items():
        if isinstance(value, int | float | np.number) and (found := rate_of(str(key), float(value))):
            rates = dict.fromkeys(map(str, data.sizes), found)
    tables, left = grouped(entries, rates)
    if not tables:
        raise InputError(path.name, "no numeric variables over a dimension", "variables over time")
    facts = {str(k).lower(): v for k, v in data.attrs.items() if isinstance(v, str)}
    return LoggerFile(path, "NetCDF file", tables, facts, close=data.close, unread=left)


def _vectors(name: str, variable: Any) -> Iterator[Vector | str]:
    """Yield the columns of a variable, or what keeps it from being read."""
    kind = variable.dtype.kind
    if kind not in "iufMm":
        yield unread(name, "no numbers")
        return
    if variable.ndim not in (1, 2):
        yield unread(name, f"{variable.ndim} dimensions" if variable.ndim else "one value")
        return
    group, rows = str(variable.dims[0]), variable.shape[0]
    unit = variable.attrs.get("units")
    if kind == "M":
        column = Column(name, "UTC", "the conventions of CF: no zone is UTC", kind="stamp")
    elif kind == "m":
        column = Column(name, "ns", "the conventions of CF")
    else:
        column = Column(name, str(unit) if unit is not None else None, "an attribute" if unit else "")
    if variable.ndim == 1:
        yield Vector(group, group, rows, column, _part(variable, None))
        return
    width = variable.shape[1]
    if kind in "Mm":
        yield unread(name, "a matrix of times")
        return
    if width > MAX_COLUMNS:
        yield unread(name, f"{width} columns, more than {MAX_COLUMNS}")
        return
    for k in range(width):
        label = f"{name}_{'xyz'[k]}" if width == 3 else f"{name}_{k + 1}"
        yield Vector(group, group, rows, Column(label, column.unit, column.why), _part(variable, k))


def _part(variable: Any, index: int | None) -> ReadPart:
    def read(first: int, last: int) -> Any:
        values = variable[first:last] if index is None else variable[first:last, index]
        array = np.asarray(values.values)
        if array.dtype.kind == "m":
            return array.astype("m8[ns]").astype(np.int64)
        return array.astype("M8[ns]") if array.dtype.kind == "M" else numbers(array)

    return read


_BEGINS = (b"CDF\x01", b"CDF\x02", b"CDF\x05", b"\x89HDF\r\n\x1a\n")
FORMAT = Format(open_netcdf, _BEGINS, endings=(".nc", ".nc4", ".cdf"))
