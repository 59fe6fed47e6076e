"""The record that `emit` leaves in `c/`: of which model, with which options, and the hash of every file.

`verify` makes the files again with the options that stand here, and then this record itself, so a changed record
does not pass either. It is also what a signature covers (docs/signing.md). docs/FORMAT.md, section 6.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..errors import InputError
from ..inputs import read_input
from ..model import Model
from ..outputs import json_text
from ..reference.table import Numeric

__all__ = ["BESIDES", "RECORD", "SIGNATURE", "Options", "joint_record_text", "read_options", "record_text"]

RECORD = "emission.json"
SIGNATURE = "emission.json.sig"
#: Names in `c/` that gyrotc writes but does not make from the model: a signature, and the marker of a result.
BESIDES = frozenset({SIGNATURE, ".gyrotc-result.json"})
_SCHEMA = "gyrotc.emission/1"


class Options(BaseModel):
    """Options of `emit`: arithmetics asked for by name (None: every one there is), where the map is shifted to 0."""

    model_config = ConfigDict(frozen=True, strict=True, extra="ignore", allow_inf_nan=False)

    numeric: Annotated[tuple[Numeric, ...], Field(min_length=1, max_length=2)] | None = None
    zero_at_c: Annotated[float, Field(ge=-200.0, le=400.0)] | None = None

    @property
    def text(self) -> str:
        """As they are typed, with a blank before each."""
        numeric = f" --numeric {','.join(self.numeric)}" if self.numeric is not None else ""
        return numeric + (f" --zero-at {self.zero_at_c!r}" if self.zero_at_c is not None else "")

    def shifted(self, model: Model) -> Model:
        """The model whose map the tables compute."""
        return model if self.zero_at_c is None else model.zeroed_at(self.zero_at_c)


class _Record(Options):
    schema_: Annotated[Literal["gyrotc.emission/1"], Field(alias="schema")]


def record_text(model: Model, options: Options, files: Mapping[str, bytes]) -> bytes:
    """`c/emission.json` of one table."""
    return _text(model, files, model.axis, model_hash=model.hash, **options.model_dump(mode="json"))


def joint_record_text(models: Mapping[str, Model], files: Mapping[str, bytes]) -> bytes:
    """`c/emission.json` where the tables of several axes stand beside one runtime."""
    first = next(iter(models.values()))
    return _text(first, files, None, axes={axis: model.hash for axis, model in models.items()})


def _text(model: Model, files: Mapping[str, bytes], axis: str | None, **facts: Any) -> bytes:
    content = {
        "schema": _SCHEMA,
        "serial": model.serial,
        "axis": axis,
        **facts,
        "files": {name: hashlib.sha256(files[name]).hexdigest() for name in sorted(files)},
    }
    return json_text(content).encode("ascii")


def read_options(c_folder: Path) -> Options:
    """The options with which a folder was emitted, as its record says.

    Raises:
        InputError: There is no record, or it is damaged.
    """
    path = c_folder / RECORD
    data = read_input(path, "result_mib", "a folder that emit wrote")
    try:
        found = _Record.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"])
        where = f"{path}, field {field}" if field else str(path)
        raise InputError(where, f"is damaged ({first['msg']})", "the record that emit wrote") from error
    return Options(numeric=found.numeric, zero_at_c=found.zero_at_c)
