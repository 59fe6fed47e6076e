"""ULog files of PX4 (`pyulog`): topics with gyros and temperatures, in the units that PX4's message definitions fix."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...common.errors import InputError
from ..tables import ArrayTable, Column, LoggerFile, LoggerTable, library, numbers, part_of

_WHY = "PX4's definition of the message"
_UNITS: dict[str, dict[str, str]] = {
    "sensor_gyro": {"x": "rad/s", "y": "rad/s", "z": "rad/s", "temperature": "degC"},
    "sensor_gyro_fifo": {},
    "sensor_combined": {
        "gyro_rad[0]": "rad/s",
        "gyro_rad[1]": "rad/s",
        "gyro_rad[2]": "rad/s",
        "baro_temp_celcius": "degC",
    },
    "sensor_accel": {"temperature": "degC"},
    "sensor_baro": {"temperature": "degC"},
    "vehicle_imu_status": {"temperature_gyro": "degC", "temperature_accel": "degC"},
    "vehicle_angular_velocity": {"xyz[0]": "rad/s", "xyz[1]": "rad/s", "xyz[2]": "rad/s"},
}
"""Units of fields, of https://docs.px4.io/main/en/msg_docs/; times are microseconds since boot."""
_AXES = {"gyro_rad[0]": "gyro_rad_x", "gyro_rad[1]": "gyro_rad_y", "gyro_rad[2]": "gyro_rad_z"}
_NOT_RAW = ("vehicle_angular_velocity",)  # filtered and corrected


def open_ulog(path: Path) -> LoggerFile:
    """A ULog file. The topics that are read lie in memory whole; the others are skipped.

    Raises:
        InputError: pyulog is not installed, or the file is damaged.
    """
    pyulog = library(path, "pyulog", "ulog", "a PX4 log")
    try:
        with path.open("rb") as file:
            log = pyulog.ULog(file, [name for name in _UNITS if name not in _NOT_RAW], True)
    except Exception as error:  # whatever a damaged file makes of the parser
        what = " ".join(str(error).split())[:100]
        raise InputError(path.name, f"cannot be read as ULog ({what})", "a whole PX4 log") from error
    topics = sorted(log.data_list, key=lambda d: (d.name, d.multi_id))
    gyros = {d.multi_id for d in topics if d.name == "sensor_gyro"}
    tables: list[LoggerTable] = [_table(topic) for topic in topics if not (topic.name == "sensor_combined" and gyros)]
    if not tables:
        raise InputError(
            path.name, "no topic sensor_gyro or sensor_combined", "a log with SDLOG_PROFILE that has raw sensors"
        )
    facts = {str(k).lower(): str(v) for k, v in log.msg_info_dict.items() if isinstance(v, str | int)}
    return LoggerFile(path, "PX4 ULog", tuple(tables), facts, since_power_on=True)


def _table(topic: Any) -> LoggerTable:
    units = _UNITS[topic.name]
    columns, parts = ([Column("timestamp", "us", _WHY)], {"timestamp": part_of(numbers(topic.data["timestamp"]))})
    for name, values in topic.data.items():
        label = _AXES.get(name, name)
        if name != "timestamp" and "timestamp" not in name and values.dtype.kind in "iuf":
            unit = units.get(name)
            columns.append(Column(label, unit, _WHY if unit else ""))
            parts[label] = part_of(numbers(values))
    rows = len(topic.data["timestamp"])
    return ArrayTable(f"{topic.name}[{topic.multi_id}]", tuple(columns), rows=rows, parts=parts)
