"""Measurement files of ASAM, MDF 3 and 4 (`asammdf`): channel groups with the units of their channels, part by part."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...common.errors import InputError
from ..tables import ArrayTable, Column, LoggerFile, LoggerTable, Part, library, numbers


def open_mdf(path: Path) -> LoggerFile:
    """A measurement file: each channel group a table, its master channel the time in s.

    Raises:
        InputError: asammdf is not installed, or the file is damaged.
    """
    asammdf = library(path, "asammdf", "mdf", "a measurement file of ASAM")
    try:
        file = asammdf.MDF(path)
        tables = tuple(t for k in range(len(file.groups)) if (t := _table(file, k)) is not None)
        started = file.header.start_time
    except Exception as error:  # whatever a damaged file makes of the parser
        what = " ".join(str(error).split())[:100]
        raise InputError(path.name, f"cannot be read as MDF ({what})", "a whole MDF file") from error
    if not tables:
        raise InputError(path.name, "no numeric channels", "a file with channels of numbers")
    return LoggerFile(path, f"MDF {file.version}", tables, {"started": str(started)}, close=file.close)


def _table(file: Any, index: int) -> LoggerTable | None:
    group = file.groups[index]
    rows = group.channel_group.cycles_nr
    master = file.masters_db.get(index)
    columns, parts = [], {}
    for k, channel in enumerate(group.channels):
        if k != master:
            values = file.get(channel.name, group=index, index=k, record_offset=0, record_count=1).samples
            if values.dtype.kind in "iuf" and values.ndim == 1:
                unit = channel.unit or None
                columns.append(Column(channel.name, unit, "the unit of the channel" if unit else ""))
                parts[channel.name] = _part(file, channel.name, index, k)
    if not columns or rows < 2:
        return None
    if master is not None:
        columns.insert(0, Column("time", "s", "the master channel of the group"))
        parts["time"] = _times(file, index)
    name = group.channel_group.acq_name or f"group {index}"
    return ArrayTable(name, tuple(columns), rows=rows, parts=parts)


def _part(file: Any, name: str, group: int, index: int) -> Part:
    def part(first: int, last: int) -> Any:
        signal = file.get(name, group=group, index=index, record_offset=first, record_count=last - first)
        return numbers(signal.samples)

    return part


def _times(file: Any, group: int) -> Part:
    return lambda first, last: numbers(file.get_master(group, record_offset=first, record_count=last - first))
