"""DataFlash logs of ArduPilot (`pymavlink`): inertial sensors, each instance a table, in their units."""

from __future__ import annotations

from array import array
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from ...common.errors import InputError
from ..tables import ArrayTable, Column, LoggerFile, LoggerTable, library, part_of

_MESSAGES = ("IMU", "GYR", "IMU2", "IMU3")
_FIELDS: dict[str, str] = {
    "GyrX": "rad/s", "GyrY": "rad/s", "GyrZ": "rad/s", "T": "degC", "TimeUS": "us", "SampleUS": "us", "TimeMS": "ms",
}  # fmt: skip
"""Fields that are read, with the units of ArduPilot's log messages (https://ardupilot.org/copter/docs/logmessages.html)."""


def open_dataflash(path: Path) -> LoggerFile:
    """A DataFlash log. What is read of it lies in memory whole: about 48 bytes a row.

    Raises:
        InputError: pymavlink is not installed, or the log is damaged.
    """
    reader = library(path, "pymavlink.DFReader", "dataflash", "an ArduPilot log")
    try:
        with redirect_stdout(StringIO()):  # pymavlink tells of damage on stdout
            read = _read(reader, path)
    except Exception as error:  # whatever a damaged log makes of the parser
        what = " ".join(str(error).split())[:100]
        expected = "a whole ArduPilot log"
        raise InputError(path.name, f"cannot be read as DataFlash log ({what})", expected) from error
    tables = tuple(_table(name, columns) for name, columns in read.items())
    if not tables:
        raise InputError(path.name, "no message IMU", "a log with LOG_BITMASK that has the IMU")
    return LoggerFile(path, "ArduPilot DataFlash log", tables, since_power_on=True)


def _read(reader: Any, path: Path) -> dict[str, dict[str, array[float]]]:
    """Fields of the messages, by message with its instance."""
    read: dict[str, dict[str, array[float]]] = {}
    log = reader.DFReader_binary(str(path), zero_time_base=True)
    try:
        while (message := log.recv_match(type=list(_MESSAGES))) is not None:
            kind = message.get_type()
            instance = getattr(message, "I", {"IMU2": 1, "IMU3": 2}.get(kind, 0))
            columns = read.setdefault(f"{kind}[{instance}]", {})
            for name in message.get_fieldnames():
                if name in _FIELDS:
                    columns.setdefault(name, array("d")).append(float(getattr(message, name)))
    finally:
        if hasattr(log, "close"):
            log.close()
    return read


def _table(name: str, columns: dict[str, array[float]]) -> LoggerTable:
    rows = min(len(values) for values in columns.values())
    arrays = {column: np.frombuffer(values)[:rows] for column, values in columns.items()}
    described = tuple(Column(column, _FIELDS[column], "ArduPilot's definition of the message") for column in arrays)
    parts = {column: part_of(values) for column, values in arrays.items()}
    return ArrayTable(name, described, rows=rows, parts=parts)
