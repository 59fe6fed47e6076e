"""Binary files of loggers: written by the libraries of their formats, flight logs byte by byte as autopilots do."""

from __future__ import annotations

import struct
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


def _ulog(path: Path, formats: dict[str, str], topics: list[tuple[int, str]], data: list[bytes]) -> None:
    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message("B", bytes(40))
    out += b"".join(message("F", f"{name}:{fields}".encode()) for name, fields in formats.items())
    out += b"".join(
        message("A", struct.pack("<BH", multi, k) + name.encode()) for k, (multi, name) in enumerate(topics)
    )
    path.write_bytes(out + b"".join(message("D", one) for one in data))


def px4(path: Path, t: Truth) -> None:
    """sensor_gyro with its own temperature, microseconds since boot, float32."""
    fields = "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;"
    fields += "float x;float y;float z;float temperature;"
    rows = zip(t.time_s, np.radians(t.rate_dps), t.temperature_c, strict=True)
    data = [struct.pack("<HQQI4f", 0, round(s * 1e6) + 5_000_000, round(s * 1e6), 1, *r, c) for s, r, c in rows]
    _ulog(path, {"sensor_gyro": fields}, [(0, "sensor_gyro")], data)


def px4_two(path: Path, t: Truth) -> None:
    """Two gyros: the second is the one that is asked for; a topic that nobody needs."""
    fields = "uint64_t timestamp;float x;float y;float z;float temperature;"
    data = []
    for s, r, c in zip(t.time_s, np.radians(t.rate_dps), t.temperature_c, strict=True):
        data.append(struct.pack("<HQ4f", 0, round(s * 1e6), *(2 * r), c + 3))
        data.append(struct.pack("<HQ4f", 1, round(s * 1e6), *r, c))
        data.append(struct.pack("<HQf", 2, round(s * 1e6), 11.1))
    formats = {"sensor_gyro": fields, "battery_status": "uint64_t timestamp;float voltage_v;"}
    _ulog(path, formats, [(0, "sensor_gyro"), (1, "sensor_gyro"), (0, "battery_status")], data)


def _dataflash(path: Path, formats: list[tuple[int, str, str, str]], data: list[bytes]) -> None:
    sizes = {"Q": 8, "B": 1, "f": 4, "I": 4, "H": 2, "n": 4, "N": 16, "Z": 64, "d": 8}
    out = b""
    for kind, name, form, labels in [(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"), *formats]:
        length = 3 + sum(sizes[mark] for mark in form)
        out += b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name.encode(), form.encode(), labels.encode())
    path.write_bytes(out + b"".join(data))


def ardupilot(path: Path, t: Truth) -> None:
    labels = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"
    rows = zip(t.time_s, np.radians(t.rate_dps), t.temperature_c, strict=True)
    data = [
        b"\xa3\x95\x81" + struct.pack("<QB6fIIfBBHH", round(s * 1e6), 0, *r, 0.0, 0.0, -9.8, 0, 0, c, 1, 1, 1000, 1000)
        for s, r, c in rows
    ]
    _dataflash(path, [(129, "IMU", "QBffffffIIfBBHH", labels)], data)


def _bag(writer: Any, store: Any, t: Truth, imu_type: str, ros1: bool) -> None:
    imu = writer.add_connection("/imu/data_raw", imu_type, typestore=store)
    kinds = store.types
    warm = writer.add_connection("/imu/temperature", "sensor_msgs/msg/Temperature", typestore=store)

    def header(ns: int) -> Any:
        stamp = kinds["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        extra = {"seq": 0} if "seq" in kinds["std_msgs/msg/Header"].__dataclass_fields__ else {}
        return kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="imu", **extra)

    vector, quaternion = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Quaternion"]
    encode = store.serialize_ros1 if ros1 else store.serialize_cdr
    for s, r, c in zip(t.time_s, np.radians(t.rate_dps), t.temperature_c, strict=True):
        ns = _EPOCH_NS + round(s * 1e9)
        warmth = kinds["sensor_msgs/msg/Temperature"](header=header(ns), temperature=float(c), variance=0.0)
        writer.write(warm, ns, encode(warmth, "sensor_msgs/msg/Temperature"))
        message = kinds["sensor_msgs/msg/Imu"](
            header=header(ns),
            orientation=quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=np.zeros(9),
            angular_velocity=vector(x=float(r[0]), y=float(r[1]), z=float(r[2])),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=vector(x=0.0, y=0.0, z=9.8),
            linear_acceleration_covariance=np.zeros(9),
        )
        writer.write(imu, ns, encode(message, "sensor_msgs/msg/Imu"))


def ros1(path: Path, t: Truth) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    with Writer(path) as writer:
        _bag(writer, get_typestore(Stores.ROS1_NOETIC), t, "sensor_msgs/msg/Imu", True)


def ros2(path: Path, t: Truth) -> None:
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    with Writer(path, version=9) as writer:
        _bag(writer, get_typestore(Stores.ROS2_HUMBLE), t, "sensor_msgs/msg/Imu", False)


def mdf4(path: Path, t: Truth) -> None:
    from asammdf import MDF, Signal

    file = MDF(version="4.10")
    signals = [
        Signal(t.rate_dps[:, 0], t.time_s, name="GyroRate", unit="deg/s"),
        Signal(t.temperature_c, t.time_s, name="GyroTemp", unit="°C"),
    ]
    file.append(signals)
    file.save(path)
    file.close()


BINARY_CASES = [
    Case("MATLAB 5, vectors", "vectors.mat", mat_vectors),
    Case("MATLAB 5, a struct with units, a sample rate", "struct.mat", mat_struct, axes=True),
    Case("MATLAB 7.3", "new.mat", mat_73, needs="h5py"),
    Case("HDF5, units as attributes", "imu.h5", hdf5_attributes, axes=True, needs="h5py"),
    Case("HDF5, a table", "table.h5", hdf5_table, needs="h5py"),
    Case(
        "Parquet, stamps, units as metadata",
        "stamps.parquet",
        parquet_stamps,
        ("--column", "temperature=housing"),
        started=True,
    ),
    Case("Parquet, units in names", "names.parquet", parquet_names, axes=True),
    Case("TDMS, waveforms", "wave.tdms", tdms_waveform, needs="nptdms", started=True),
    Case("TDMS, a channel of stamps", "stamps.tdms", tdms_stamps, needs="nptdms", started=True),
    Case(
        "PX4 ULog",
        "flight.ulg",
        px4,
        axes=True,
        needs="pyulog",
        starts_at=5.0,
        tolerance=1e-4,
        temperature_tolerance=1e-5,
    ),
    Case(
        "PX4 ULog, one of two gyros",
        "two.ulg",
        px4_two,
        ("--table", "sensor_gyro[1]"),
        axes=True,
        needs="pyulog",
        tolerance=1e-4,
        temperature_tolerance=1e-5,
    ),
    Case(
        "ArduPilot DataFlash",
        "log.bin",
        ardupilot,
        axes=True,
        needs="pymavlink",
        tolerance=1e-4,
        temperature_tolerance=1e-5,
    ),
    Case("ROS 1 bag, temperature of another topic", "ros1.bag", ros1, axes=True, needs="rosbags", started=True),
    Case("ROS 2 bag", "ros2", ros2, axes=True, needs="rosbags", started=True),
    Case("MDF 4", "car.mf4", mdf4, needs="asammdf"),
]
