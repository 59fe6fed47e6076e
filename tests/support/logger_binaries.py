"""Binary files of loggers, written by the libraries of their formats."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
from logger_files import START, Case, Truth

_EPOCH_NS = 1_772_352_000_000_000_000  # START


def mat_vectors(path: Path, t: Truth) -> None:
    names = {"time_ms": t.time_s * 1e3, "temp_K": t.temperature_c + 273.15, "gyro_dps": t.rate_dps[:, 0]}
    scipy.io.savemat(path, names, do_compression=True)


def mat_struct(path: Path, t: Truth) -> None:
    """A struct with units beside, a matrix of three axes, a sample rate."""
    units = {"gyro": "rad/s", "temperature": "degC"}
    log = {"gyro": np.radians(t.rate_dps), "temperature": t.temperature_c, "units": units, "Fs": 0.1}
    scipy.io.savemat(path, {"log": log})


def mat_73(path: Path, t: Truth) -> None:
    """As MATLAB lays it out: HDF5 behind 512 bytes, every array with its rows as columns."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (
            ("time_s", t.time_s),
            ("temperature_degC", t.temperature_c),
            ("rate_dph", t.rate_dph[:, 0]),
        ):
            one = file.create_dataset(name, data=values[None, :])
            one.attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Sun Mar 1 08:00:00 2026 HDF5 schema 1.00 .")


def hdf5_attributes(path: Path, t: Truth) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs["serial"] = "FOG-9"
        group = file.create_group("imu")
        for name, values, unit in (
            ("time", np.round(t.time_s * 1e6).astype(np.int64), "us"),
            ("gyro", t.rate_dps * 1e3, "mdeg/s"),
            ("temperature", t.temperature_c + 273.15, "K"),
        ):
            group.create_dataset(name, data=values, chunks=True).attrs["units"] = unit


def hdf5_table(path: Path, t: Truth) -> None:
    import h5py

    table = np.empty(len(t.time_s), dtype=[("t_s", "f8"), ("temp_c", "f8"), ("rate_dps", "f8"), ("n", "i4")])
    table["t_s"], table["temp_c"], table["rate_dps"] = t.time_s, t.temperature_c, t.rate_dps[:, 0]
    with h5py.File(path, "w") as file:
        file["log/samples"] = table


def parquet_stamps(path: Path, t: Truth) -> None:
    stamps = pa.array(_EPOCH_NS + np.round(t.time_s * 1e9).astype(np.int64)).cast(pa.timestamp("ns", "UTC"))
    fields = [
        pa.field("time", stamps.type),
        pa.field("housing", pa.float64(), metadata={"unit": "K"}),
        pa.field("rate", pa.float64(), metadata={"unit": "deg/s"}),
    ]
    columns = [stamps, pa.array(t.temperature_c + 273.15), pa.array(t.rate_dps[:, 0])]
    pq.write_table(pa.Table.from_arrays(columns, schema=pa.schema(fields)), path)


def parquet_names(path: Path, t: Truth) -> None:
    axes = {f"gyro_{a}_rad_s": np.radians(t.rate_dps[:, k]) for k, a in enumerate("xyz")}
    pq.write_table(
        pa.table({"timestamp_us": np.round(t.time_s * 1e6).astype(np.int64), "imu_temp_c": t.temperature_c} | axes),
        path,
    )


def _tdms(path: Path, channels: dict[str, tuple[Any, dict[str, Any]]]) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("Chamber", n, v, properties=p) for n, (v, p) in channels.items()])


def tdms_waveform(path: Path, t: Truth) -> None:
    wave = {"wf_increment": 10.0, "wf_start_time": np.datetime64(START.replace(tzinfo=None), "us")}
    gyro = (t.rate_dps[:, 0], wave | {"unit_string": "deg/s"})
    _tdms(path, {"Gyro": gyro, "Temperature": (t.temperature_c, wave | {"unit_string": "°C"})})


def tdms_stamps(path: Path, t: Truth) -> None:
    stamps = np.datetime64(START.replace(tzinfo=None), "us") + np.round(t.time_s * 1e6).astype("timedelta64[us]")
    _tdms(
        path,
        {
            "Time": (stamps, {}),
            "Gyro": (t.rate_dph[:, 0], {"NI_UnitDescription": "deg/h"}),
            "Temperature": (t.temperature_c + 273.15, {"NI_UnitDescription": "K"}),
        },
    )


def hdf5_two_gyros(path: Path, t: Truth) -> None:
    """Two groups that both hold a gyro, of which the second is wanted."""
    import h5py

    with h5py.File(path, "w") as file:
        for name, rate_dps, temperature_c in (
            ("gyro_1", 2.0 * t.rate_dps, t.temperature_c + 3.0),
            ("gyro_2", t.rate_dps, t.temperature_c),
        ):
            for column, values, unit in (("time", t.time_s, "s"), ("rate", rate_dps, "deg/s")):
                file.create_dataset(f"{name}/{column}", data=values).attrs["units"] = unit
            file.create_dataset(f"{name}/temperature", data=temperature_c).attrs["units"] = "degC"


def hdf5_thermometer(path: Path, t: Truth) -> None:
    """The temperature in a group of its own, with its own times."""
    import h5py

    with h5py.File(path, "w") as file:
        for name, values, unit in (
            ("imu/time", t.time_s, "s"),
            ("imu/rate", t.rate_dps, "deg/s"),
            ("thermometer/time", t.time_s, "s"),
            ("thermometer/temperature", t.temperature_c, "degC"),
        ):
            file.create_dataset(name, data=values).attrs["units"] = unit


BINARY_CASES = [
    Case("MATLAB 5, vectors", "vectors.mat", mat_vectors),
    Case("MATLAB 5, a struct with units, a sample rate", "struct.mat", mat_struct, axes=True),
    Case("MATLAB 7.3", "new.mat", mat_73),
    Case("HDF5, units as attributes", "imu.h5", hdf5_attributes, axes=True),
    Case("HDF5, a table", "table.h5", hdf5_table),
    Case("HDF5, one of two gyros", "two.h5", hdf5_two_gyros, ("--set", "table=gyro_2"), axes=True),
    Case("HDF5, temperature of another group", "apart.h5", hdf5_thermometer, axes=True),
    Case(
        "Parquet, stamps, units as metadata",
        "stamps.parquet",
        parquet_stamps,
        ("--column", "temperature=housing"),
        started=True,
    ),
    Case("Parquet, units in names", "names.parquet", parquet_names, axes=True),
    Case("TDMS, waveforms", "wave.tdms", tdms_waveform, started=True),
    Case("TDMS, a channel of stamps", "stamps.tdms", tdms_stamps, started=True),
]
