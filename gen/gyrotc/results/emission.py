"""The result of `gyrotc emit --json`: which tables were written."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Arithmetic, Axis, Count, Part, Result

__all__ = ["Emitted", "EmittedTable"]


class EmittedTable(Part):
    """Size and error bound of one table."""

    numeric: Arithmetic = Field(description="its arithmetic")
    table_bytes: Count = Field(description="size of the table, bytes (section 3)")
    error_bound_dph: float = Field(description="largest error of the map for any input, deg/h")


class Emitted(Result):
    """Tables that were written."""

    schema_: Annotated[Literal["gyrotc.emit/1"], Field(alias="schema")] = "gyrotc.emit/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where the recordings have one axis")
    id: str = Field(description="id of the table, part of every emitted name")
    tables: tuple[EmittedTable, ...] = Field(description="one for each arithmetic")
    refused: dict[str, str] = Field(description="arithmetics that were left out, with the reason")
