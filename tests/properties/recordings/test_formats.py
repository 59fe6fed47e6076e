"""The same numbers in every format of files, in pieces of any length, are the same rows."""

from __future__ import annotations

import gzip
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
import xarray
from conftest import run_gyrotc
from drawn import examples
from gyrotc import load
from hypothesis import given
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter
from numpy.typing import NDArray
from recordings import csv_text

Table = Mapping[str, NDArray[np.float64]]
UNITS = {"time_s": "s", "temperature_c": "degC", "rate_dph": "deg/h", "supply_v": "V"}


def _csv(path: Path, table: Table) -> None:
    path.write_text(csv_text(table), "utf-8")


def _german(path: Path, table: Table) -> None:
    path.write_text(csv_text(table).replace(",", ";").replace(".", ","), "utf-8")


def _packed(path: Path, table: Table) -> None:
    path.write_bytes(gzip.compress(csv_text(table).encode()))


def _parquet(path: Path, table: Table) -> None:
    pq.write_table(pa.table(dict(table)), path, row_group_size=7)


def _matlab(path: Path, table: Table) -> None:
    scipy.io.savemat(path, dict(table))


def _hdf5(path: Path, table: Table) -> None:
    with h5py.File(path, "w") as file:
        for name, values in table.items():
            file.create_dataset(name, data=values, chunks=(5,)).attrs["units"] = UNITS[name]


def _netcdf(path: Path, table: Table) -> None:
    xarray.Dataset({name: ("row", values) for name, values in table.items()}).to_netcdf(path, engine="h5netcdf")


def _tdms(path: Path, table: Table) -> None:
    with TdmsWriter(path) as writer:
        for part in (slice(None, 11), slice(11, None)):
            writer.write_segment([ChannelObject("log", name, values[part]) for name, values in table.items()])


def _excel(path: Path, table: Table) -> None:
    book = openpyxl.Workbook()
    book.active.append(list(table))
    for row in zip(*table.values(), strict=True):
        book.active.append([float(value) for value in row])
    book.save(path)


FORMATS: dict[str, tuple[str, Callable[[Path, Table], None]]] = {
    "CSV": ("a.csv", _csv),
    "CSV with semicolons and decimal commas": ("a.csv", _german),
    "CSV, packed": ("a.csv.gz", _packed),
    "Parquet": ("a.parquet", _parquet),
    "MATLAB": ("a.mat", _matlab),
    "HDF5": ("a.h5", _hdf5),
    "NetCDF": ("a.nc", _netcdf),
    "TDMS": ("a.tdms", _tdms),
    "Excel": ("a.xlsx", _excel),
}


@st.composite
def tables(draw: st.DrawFn) -> Table:
    """Draw 20 to 60 rows with every digit of a float64 in use."""
    n = draw(st.integers(20, 60))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    step_s = draw(st.sampled_from([0.01, 0.1, 1.0, 10.0, 60.0]))
    start_s = draw(st.sampled_from([0.0, -3600.0, 1e5, 0.1]))
    return {
        "time_s": start_s + step_s * np.arange(n),
        "temperature_c": 20.0 + rng.uniform(-0.01, 0.01, n).cumsum(),
        "rate_dph": draw(st.floats(-100.0, 100.0)) + rng.normal(0.0, 0.1, n),
        "supply_v": rng.uniform(4.9, 5.1, n),
    }


@pytest.mark.parametrize("name", FORMATS)
@examples(4, shrink=False)
@given(table=tables())
def test_every_format_of_the_same_numbers_gives_the_same_rows(name: str, table: Table) -> None:
    file, write = FORMATS[name]
    with TemporaryDirectory() as folder:
        path, out = Path(folder) / file, Path(folder) / "R-1"
        write(path, table)
        done = run_gyrotc("import", path, "--out", out, "--trust-units")
        assert done.returncode == 0, done.stderr
        rows = load(out).runs[0].rows()
    found = {"time_s": rows.time_s, "temperature_c": rows.temperature_c, "rate_dph": rows.rate_dph, **rows.channels}
    assert list(found) == list(table)
    rounding = 1e-15 if name == "Excel" else 0.0  # openpyxl writes 16 digits
    for column, values in table.items():
        np.testing.assert_allclose(found[column], values, rtol=rounding, atol=0.0, err_msg=column)
