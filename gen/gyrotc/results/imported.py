"""`gyrotc import --json`: what was made of a logger's files."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from .base import Axis, Count, Part, Result

__all__ = ["ImportedFile", "ImportedFiles", "OriginalFile"]


class OriginalFile(Part):
    """The logger's file that a run was made of, as `[source]` of `dataset.toml` names it."""

    file: str = Field(description="its name")
    sha256: str = Field(description="of its contents")
    bytes: Count = Field(description="its size, bytes")
    imported_by: str = Field(description="gyrotc with its version")
    map: str = Field(description="file of the map that read it")
    run: str = Field(description="file of the run")


class ImportedFile(Part):
    """A run that was written."""

    file: str = Field(description="as in `dataset.toml`")
    rows: Count = Field(description="rows that were taken")
    left_out: dict[str, Count] = Field(description="rows that were not, by the reason")
    trusted: tuple[str, ...] = Field(
        description="what values look like that contradicts their unit, but was taken (`--trust-units`)"
    )
    source: OriginalFile = Field(description="the original")


class ImportedFiles(Result):
    """What was made of a logger's files."""

    schema_: Annotated[Literal["gyrotc.import/1"], Field(alias="schema")] = "gyrotc.import/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null: an import is of all axes")
    map: dict[str, Any] = Field(description="the map that was kept; its keys: docs/import.md, section 5")
    runs: tuple[ImportedFile, ...] = Field(description="every run, in the order of the files")
