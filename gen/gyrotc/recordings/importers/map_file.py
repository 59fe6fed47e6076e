"""`map.toml`: how the files of one logger become a data set, kept so that the next file needs nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from ...common.inputs import read_toml, refused
from ..description import GyroFacts, dataset_toml
from ..tables import Column, LoggerTable
from .selection import Where

MAP_FILE = "map.toml"

Text = Annotated[str, Field(min_length=1, max_length=256)]
Texts = Annotated[tuple[Text, ...], BeforeValidator(lambda value: (value,) if isinstance(value, str) else tuple(value))]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ColumnMap(_Part):
    """`[columns]`: names in the logger's file; `time` may be two, a date and a time of day.

    `device` names the gyro of each row; "none": no column does.
    """

    device: Text | None = None
    time: Texts = ()
    temperature: Text | None = None
    rate: Text | None = None
    rate_x: Text | None = None
    rate_y: Text | None = None
    rate_z: Text | None = None
    pulses: Text | None = None

    def values(self) -> dict[str, str]:
        """Columns of measured values by role: rate, rate_x, rate_y, rate_z or pulses."""
        roles = ("rate", "rate_x", "rate_y", "rate_z", "pulses")
        return {role: getattr(self, role) for role in roles if getattr(self, role)}


class CsvMap(_Part):
    """`[csv]`: what is not recognised from the file itself; None where it is."""

    encoding: Text | None = None
    delimiter: Text | None = None
    decimal: Literal[".", ","] | None = None
    comment: Texts = ()
    header_line: Annotated[int, Field(ge=0, le=10_000)] | None = None
    units_line: Annotated[int, Field(ge=0, le=10_000)] | None = None
    missing: Texts = ()
    thousands: Annotated[str, Field(min_length=1, max_length=1)] | None = None

    def given(self) -> dict[str, Any]:
        """The keys that are stated."""
        return {key: value for key, value in self.model_dump().items() if value not in (None, ())}


class TimeMap(_Part):
    """`[time]`: form of date-time stamps, their zone, or rows per second where no column holds times.

    `leave_out_late`: rows whose time is not behind that of the row before are left out.
    """

    format: Text | None = None
    zone: Text | None = None
    rate_hz: Annotated[float, Field(gt=0.0, le=1e7)] | None = None
    leave_out_late: bool = False


class JoinMap(_Part):
    """`[[join]]`: another file with the temperature; a reading of it holds at most `tolerance_s`.

    `time`, `format` and `zone` say what is not recognised of its times.
    """

    file: Text
    tolerance_s: Annotated[float, Field(gt=0.0, le=1e6)]
    time: Texts = ()
    format: Text | None = None
    zone: Text | None = None


class Map(GyroFacts):
    """A map. What it states of the gyro goes to `dataset.toml`."""

    model_config = ConfigDict(strict=False)

    serial: Text | None = None
    table: Text | None = None
    where: Text | None = None
    hold: bool = False
    columns: ColumnMap = ColumnMap()
    channels: dict[Text, Text] | None = None
    csv: CsvMap = CsvMap()
    time: TimeMap = TimeMap()
    join: tuple[JoinMap, ...] = ()


def load_map(path: Path) -> Map:
    """Read an import map.

    Raises:
        InputError: It is no map; the field is named.
    """
    return checked_map(read_toml(path, "a map that gyrotc import wrote"), path.name)


def checked_map(content: Any, name: str) -> Map:
    """A map of what a file, or options, state.

    Raises:
        InputError: It is none; the field is named.
    """
    try:
        return Map.model_validate(content)
    except ValidationError as error:
        raise refused(error, lambda field: f"{name}, field {field}", Map, "docs/import.md") from error


def map_text(chosen: Map) -> str:
    """A map as TOML, without what is empty."""
    content = chosen.model_dump()
    joined = [{k: v for k, v in one.items() if v not in (None, ())} for one in content.pop("join")]
    head = {k: v for k, v in content.items() if not isinstance(v, dict) and v not in (None, "", False)}
    tables: dict[str, Any] = {}
    for name, table in content.items():
        if isinstance(table, dict):
            kept = {k: v for k, v in table.items() if v not in (None, (), False)}
            if kept or (name == "channels" and content["channels"] is not None):
                tables[name] = {k: v[0] if isinstance(v, tuple) and len(v) == 1 else v for k, v in kept.items()}
    return dataset_toml(head, tables | {"join": joined})


@dataclass(frozen=True, slots=True)
class Choice:
    """One column and what it is taken for.

    Attributes:
        role: "time", "temperature", "rate", "rate_x", ..., "pulses", or the name of a channel.
        table: The table that holds it.
        column: The column.
        unit: Its unit; None for stamps, pulses and channels without one.
        why: The reasons, in words.
    """

    role: str
    table: LoggerTable
    column: Column
    unit: str | None
    why: str

    @property
    def source(self) -> str:
        """The column as a map names it."""
        return f"{self.table.name}/{self.column.name}" if self.table.name else self.column.name


@dataclass(frozen=True, slots=True)
class ImportPlan:
    """Columns and rows that are read of a file.

    Attributes:
        main: The table with the rates; its rows are the rows of the run.
        time: Columns of time, one or two; none where rows are counted.
        temperature: The temperature; its table may be another one.
        values: Rates by axis, one rate, or pulses.
        channels: Auxiliary channels of the main table.
        rate_hz: Rows per second where rows are counted, with the reason in `why_rate`.
        where: The rows that are taken; None: all.
        device: Column that names the gyro of each row.
        left_out: Numeric columns of the main table that are not taken.
        texts: Its other columns that are not taken.
    """

    main: LoggerTable
    time: tuple[Choice, ...]
    temperature: Choice
    values: tuple[Choice, ...]
    channels: tuple[Choice, ...]
    rate_hz: float | None
    why_rate: str
    left_out: tuple[str, ...]
    where: Where | None = None
    device: Column | None = None
    texts: tuple[str, ...] = ()
