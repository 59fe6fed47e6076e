"""The record that `emit` leaves in `c/`: which model, which options, the hash of every file.

`verify` makes the files again with the options that stand here, and then this record itself, so a changed record
does not pass either. docs/FORMAT.md, section 6.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..common.inputs import read_input, refused
from ..model import Model
from ..results.base import Axis, Numbered, Numeric
from ..results.json_text import json_text

RECORD = "emission.json"
SHARED_RUNTIME: Final = "../../runtime"
"""Folder of the runtime of a fleet, as the `c/` of one of its gyros names it."""


class Options(BaseModel):
    """Options of `emit`: arithmetics asked for by name (None: every one there is), where the map is shifted to 0.

    `runtime`: Folder of the runtime that many gyros share; None: `c/` is complete by itself.
    """

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore", allow_inf_nan=False)

    numeric: Annotated[tuple[Numeric, ...], Field(min_length=1, max_length=2)] | None = None
    zero_at_c: Annotated[float, Field(ge=-200.0, le=400.0)] | None = None
    runtime: Literal["../../runtime"] | None = None

    @property
    def text(self) -> str:
        """The options as they are typed, with a blank before each."""
        numeric = f" --numeric {','.join(self.numeric)}" if self.numeric is not None else ""
        return numeric + (f" --zero-at {self.zero_at_c!r}" if self.zero_at_c is not None else "")

    def shifted(self, model: Model) -> Model:
        """The model whose map the tables compute."""
        return model if self.zero_at_c is None else model.zeroed_at(self.zero_at_c)


class EmissionRecord(Numbered):
    """Record of the files that `emit` wrote into `c/`, a pure function of the model and the options."""

    schema_: Annotated[Literal["gyrotc.emission/1"], Field(alias="schema")] = "gyrotc.emission/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where there is one axis, and where several stand in one folder")
    model_hash: str | None = Field(default=None, description="hash of the model, where it is one")
    numeric: tuple[Numeric, ...] | None = Field(
        default=None, description="arithmetics asked for by `--numeric`, in their order, or null"
    )
    zero_at_c: float | None = Field(default=None, description="`--zero-at`, C, or null")
    runtime: str | None = Field(
        default=None, description="folder of `gtc.h`, `gtc_f32.c` and `gtc_q31.c`, from here; null: they are here"
    )
    axes: dict[str, str] = Field(
        default={}, description="where several axes stand in one folder: hash of each axis's model"
    )
    files: dict[str, str] = Field(description="SHA-256 of every other file, by name")


def record_text(model: Model, options: Options, files: Mapping[str, bytes]) -> bytes:
    """`c/emission.json` of one table."""
    record = EmissionRecord(
        serial=model.serial,
        axis=model.axis,
        model_hash=model.hash,
        numeric=options.numeric,
        zero_at_c=options.zero_at_c,
        runtime=options.runtime,
        files=_hashes(files),
    )
    return _text(record)


def joint_record_text(models: Mapping[str, Model], files: Mapping[str, bytes]) -> bytes:
    """`c/emission.json` where the tables of several axes stand beside one runtime."""
    first = next(iter(models.values()))
    axes = {axis: model.hash for axis, model in models.items()}
    return _text(EmissionRecord(serial=first.serial, axis=None, axes=axes, files=_hashes(files)))


def _hashes(files: Mapping[str, bytes]) -> dict[str, str]:
    return {name: hashlib.sha256(files[name]).hexdigest() for name in sorted(files)}


def _text(record: EmissionRecord) -> bytes:
    return json_text(record.content()).encode("ascii")


class _Stored(Options):
    """The part of a record that is accepted before `verify` has made it again: the options."""

    schema_: Annotated[Literal["gyrotc.emission/1"], Field(alias="schema")]


def read_options(c_folder: Path) -> Options:
    """The options with which a folder was emitted, as its record says.

    Raises:
        InputError: There is no record, or it is damaged.
    """
    path = c_folder / RECORD
    data = read_input(path, "result_mib", "a folder that emit wrote")
    try:
        found = _Stored.model_validate_json(data)
    except ValidationError as error:
        raise refused(error, lambda field: f"{path}, field {field}" if field else str(path), _Stored) from error
    return Options(numeric=found.numeric, zero_at_c=found.zero_at_c, runtime=found.runtime)
