"""Files of spreadsheets and analysis tools: written by the libraries that people use for them."""

from __future__ import annotations

import gzip
from datetime import timedelta
from pathlib import Path

from logger_files import START, Case, Truth


def excel(path: Path, t: Truth) -> None:
    """Two sheets: notes, then a title, a header with units, stamps as cells of their own type."""
    import openpyxl

    book = openpyxl.Workbook()
    book.active.title = "Notes"
    book.active.append(["chamber 3", "run of the morning"])
    sheet = book.create_sheet("Log")
    sheet.append(["Date", "Temp [°C]", "Rate [°/h]"])
    for s, c, r in zip(t.time_s, t.temperature_c, t.rate_dph[:, 0], strict=True):
        stamp = START.replace(tzinfo=None) + timedelta(seconds=float(s))
        sheet.append([stamp, float(c), float(r)])
    book.save(path)


def csv_gz(path: Path, t: Truth) -> None:
    with gzip.open(path, "wt", encoding="utf-8") as file:
        file.write("time_s;temperature_degC;rate_dps\n")
        for s, c, r in zip(t.time_s, t.temperature_c, t.rate_dps[:, 0], strict=True):
            file.write(f"{float(s)!r};{float(c)!r};{float(r)!r}\n".replace(".", ","))


def netcdf(path: Path, t: Truth) -> None:
    """Times as CF has them, a packed temperature with scale, offset and fill value, a rate over two dimensions."""
    import xarray as xr

    since = f"seconds since {START:%Y-%m-%d %H:%M:%S}"
    data = xr.Dataset(
        {
            "temperature": ("time", t.temperature_c, {"units": "degC"}),
            "gyro": (("time", "axis"), t.rate_dps, {"units": "deg/s"}),
        },
        coords={"time": ("time", t.time_s, {"units": since, "standard_name": "time"})},
    )
    packed = {"dtype": "i4", "scale_factor": 1e-6, "add_offset": 20.0, "_FillValue": -(2**31)}
    data.to_netcdf(path, engine="h5netcdf", encoding={"temperature": packed})


def netcdf_3(path: Path, t: Truth) -> None:
    import xarray as xr

    data = xr.Dataset(
        {
            "temperature": ("row", t.temperature_c, {"units": "degC"}),
            "rate": ("row", t.rate_dph[:, 0], {"units": "deg/h"}),
            "time": ("row", t.time_s * 1e3, {"units": "milliseconds since 2026-03-01T08:00:00"}),
        }
    )
    data.to_netcdf(path, engine="scipy")


ANALYSIS_CASES = [
    Case("Excel, a sheet of stamps behind one of notes", "book.xlsx", excel, time_tolerance=1e-3),
    Case("CSV packed by gzip, decimal commas", "log.csv.gz", csv_gz),
    Case(
        "NetCDF 4, times and packing of CF", "run.nc", netcdf, axes=True, started=True,
        temperature_tolerance=1e-6,
    ),
    Case("NetCDF 3, milliseconds of CF", "old.nc", netcdf_3, started=True),
]  # fmt: skip
