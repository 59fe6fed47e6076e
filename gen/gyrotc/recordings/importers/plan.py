"""What is read of a file: the columns with their roles, units and reasons."""

from __future__ import annotations

from dataclasses import dataclass

from .tables import Column, LoggerTable

__all__ = ["Choice", "ImportPlan"]


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
    """What is read of a file.

    Attributes:
        main: The table with the rates; its rows are the rows of the run.
        time: Columns of time, one or two; none where rows are counted.
        temperature: The temperature; its table may be another one.
        values: Rates by axis, one rate, or pulses.
        channels: Auxiliary channels of the main table.
        rate_hz: Rows per second where rows are counted, with the reason in `why_rate`.
        left_out: Numeric columns of the main table that are not taken.
    """

    main: LoggerTable
    time: tuple[Choice, ...]
    temperature: Choice
    values: tuple[Choice, ...]
    channels: tuple[Choice, ...]
    rate_hz: float | None
    why_rate: str
    left_out: tuple[str, ...]
