"""`manifest.json`: hashes and versions of what a build made."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from .base import Axis, Result
from .training import DeclaredUnits

__all__ = ["Manifest"]


class Manifest(Result):
    """What a certificate must be able to name of a build."""

    schema_: Annotated[Literal["gyrotc.manifest/1"], Field(alias="schema")] = "gyrotc.manifest/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where the recordings have one axis")
    model_hash: str = Field(description="hash of the model")
    refused: dict[str, str] = Field(description="arithmetics that were left out, with the reason")
    versions: dict[str, str] = Field(description="programs that it was made with")
    meta: dict[str, Any] = Field(description="`[meta]` of the data set")
    units: DeclaredUnits = Field(description="of the recordings")
    sources: tuple[Any, ...] = Field(description="`[source]` of recordings that were imported")
    program: str = Field(
        default="", description="SHA-256 of the program; empty: of a gyrotc that did not state it"
    )
    files: dict[str, str] = Field(description="SHA-256 of every file, by its path in the folder")
