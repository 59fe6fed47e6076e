"""TDMS files of LabVIEW (`nptdms`): units and rhythm from the properties of channels, read part by part."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from datetime import datetime, timedelta, timezone
from io import StringIO
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ....common.errors import InputError, short_reason
from ...tables import ArrayTable, Column, LoggerFile, LoggerTable, ReadPart, numbers, optional_library, unread
from ..format import Format

_UNIT_KEYS = ("unit_string", "NI_UnitDescription", "Unit", "unit", "units")


def open_tdms(path: Path) -> LoggerFile:
    """A TDMS file: each group a table, where its channels are of one length.

    Raises:
        InputError: nptdms is not installed, or the file is damaged.
    """
    nptdms = optional_library(path, "nptdms", "tdms", "a TDMS file")
    with ExitStack() as stack:
        said = stack.enter_context(_log(nptdms))
        stream = stack.enter_context(path.open("rb"))  # by its path the library would read the index file beside it
        try:
            file = nptdms.TdmsFile.open(stream)
            tables = tuple(table for group in file.groups() for table in _tables(group, path.name))
            left = tuple(entry for group in file.groups() for entry in _unread(group))
        except Exception as error:  # whatever a damaged file makes of the parser
            raise InputError(
                path.name, f"cannot be read as TDMS ({short_reason(error)})", "a whole TDMS file"
            ) from error
        if not tables:
            raise InputError(path.name, "no numeric channels", "a TDMS file with channels of numbers")
        facts = {str(k).lower(): str(v) for k, v in file.properties.items()}
        if _SHORT in said.getvalue():
            tables = tuple(replace(table, notes=(_CUT,)) for table in tables)
        opened = LoggerFile(path, "TDMS file", tables, facts, unread=left)
        return replace(opened, close=stack.pop_all().close)


# What the library logs of a file whose last segment states more than there is, and what that means.
_SHORT = "less data than expected"
_CUT = "the file ends within its last segment: the rows that it states behind are missing"


@contextmanager
def _log(nptdms: ModuleType) -> Iterator[StringIO]:
    """Collect what the library logs while a file is open, so that it is not printed."""
    handler = nptdms.log.log_manager.console_handler
    said = StringIO()
    before = handler.setStream(said)
    try:
        yield said
    finally:
        handler.setStream(before or sys.stderr)


def _tables(group: Any, file: str) -> Iterator[LoggerTable]:
    """A table for each rhythm of a group: channels of one length, one increment and one time of the first sample."""
    rhythms: dict[_Rhythm, list[Any]] = {}
    for channel in group.channels():
        if not _why_unread(channel):
            rhythms.setdefault(_rhythm(channel), []).append(channel)
    for rhythm, channels in rhythms.items():
        step = rhythm.increment_s
        rate = 1.0 / step if step and 0.0 < step < np.inf else None
        names = [channel.name for channel in channels]
        yield ArrayTable(
            group.name if len(rhythms) == 1 else f"{group.name} ({', '.join(names)})",
            tuple(column for channel in channels if (column := _column(channel)) is not None),
            rate,
            f"wf_increment = {step} s of {names[0]}" if rate else "",
            rhythm.started if rate else None,
            rows=rhythm.rows,
            parts={channel.name: _part(channel, file) for channel in channels},
        )


def _unread(group: Any) -> Iterator[str]:
    """Yield the channels that are in no table."""
    for channel in group.channels():
        if why := _why_unread(channel):
            yield unread(f"{group.name}/{channel.name}", why)


def _why_unread(channel: Any) -> str:
    if _column(channel) is None:
        return "no numbers"
    return "" if len(channel) > 1 else "one value" if len(channel) else "no values"


@dataclass(frozen=True, slots=True)
class _Rhythm:
    """Start and interval of the samples of a channel."""

    rows: int
    increment_s: float | None
    started: datetime | None


def _rhythm(channel: Any) -> _Rhythm:
    step = channel.properties.get("wf_increment")
    started = _instant(channel.properties.get("wf_start_time"))
    offset_s = float(channel.properties.get("wf_start_offset") or 0.0)
    if started is not None and np.isfinite(offset_s):
        started += timedelta(seconds=offset_s)
    return _Rhythm(len(channel), float(step) if step else None, started)


def _column(channel: Any) -> Column | None:
    kind = getattr(channel.dtype, "kind", "O")
    if kind == "M":
        return Column(channel.name, "UTC", kind="stamp")
    if kind not in "iuf":
        return None
    unit = next((str(channel.properties[k]) for k in _UNIT_KEYS if channel.properties.get(k)), None)
    return Column(channel.name, unit, "a property of the channel" if unit else "")


def _part(channel: Any, file: str) -> ReadPart:
    def part(first: int, last: int) -> Any:
        try:
            values = channel[first:last]
        except Exception as error:  # whatever a damaged file makes of the parser
            raise InputError(file, f"is damaged ({short_reason(error)})", "a whole TDMS file") from error
        return values.astype("datetime64[ns]") if getattr(values.dtype, "kind", "") == "M" else numbers(values)

    return part


def _instant(value: Any) -> datetime | None:
    if value is None:
        return None
    microseconds = int(np.datetime64(value, "us").astype(np.int64))
    return datetime.fromtimestamp(microseconds / 1e6, timezone.utc)


FORMAT = Format(open_tdms, (b"TDSm",), in_child=False)
