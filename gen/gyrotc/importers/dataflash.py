"""DataFlash logs of ArduPilot (`pymavlink`): inertial sensors, each instance a table, in their units."""

from __future__ import annotations

from array import array
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .arrays import ArrayTable, part_of
from .tables import Column, LoggerFile, Table, library

__all__ = ["open_dataflash"]

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
    reader = library("pymavlink.DFReader", "dataflash", "an ArduPilot log")
    read: dict[str, dict[str, array[float]]] = {}
    stated: dict[str, dict[str, str]] = {}
    log = None
    try:
        log = reader.DFReader_binary(str(path), zero_time_base=True)
        while (message := log.recv_match(type=list(_MESSAGES))) is not None:
            kind = message.get_type()
            instance = getattr(message, "I", {"IMU2": 1, "IMU3": 2}.get(kind, 0))
            columns = read.setdefault(f"{kind}[{instance}]", {})
            fields = [name for name in message.get_fieldnames() if name in _FIELDS]
            if not columns:
                stated[f"{kind}[{instance}]"] = _stated(message, fields)
            for name in fields:
                columns.setdefault(name, array("d")).append(float(getattr(message, name)))
    except Exception as error:  # whatever a damaged log makes of the parser
        what = " ".join(str(error).split())[:100]
        raise InputError(
            path.name, f"cannot be read as DataFlash log ({what})", "a whole ArduPilot log"
        ) from error
    finally:
        if log is not None and hasattr(log, "close"):
            log.close()
    tables = tuple(_table(name, columns, stated[name]) for name, columns in read.items())
    if not tables:
        raise InputError(path.name, "no message IMU", "a log with LOG_BITMASK that has the IMU")
    return LoggerFile(path, "ArduPilot DataFlash log", tables, since_power_on=True)


def _stated(message: Any, fields: list[str]) -> dict[str, str]:
    """Units that the log states itself (messages FMTU and UNIT)."""
    format_ = getattr(message, "fmt", None)
    getter = getattr(format_, "get_unit", None)
    found = {name: getter(name) for name in fields} if getter is not None else {}
    return {name: unit for name, unit in found.items() if unit}


def _table(name: str, columns: dict[str, array[float]], stated: dict[str, str]) -> Table:
    rows = min(len(values) for values in columns.values())
    arrays = {column: np.frombuffer(values)[:rows] for column, values in columns.items()}
    described = tuple(
        Column(
            column,
            _FIELDS[column],
            "the log's own units" if stated.get(column) else "ArduPilot's definition of the message",
        )
        for column in arrays
    )
    return ArrayTable(
        name, described, rows=rows, parts={column: part_of(values) for column, values in arrays.items()}
    )
