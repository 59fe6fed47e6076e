"""JSON that one command wrote and another reads back: the fields that are used, and their types.

Files lie on disks and pass through hands; what is not as it was written is refused by field, not met half-way
through a page. Fields that nothing reads are let through.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from ..errors import InputError
from . import checked, read_json

__all__ = ["KINDS", "Kind", "checked_result", "read_result"]


class _Stored(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)


class _Diagnosis(_Stored):
    verdict: str
    text: str
    causes: list[dict[str, Any]]
    considered: list[dict[str, Any]]
    extended: dict[str, Any] | None
    pictures: list[str] = []


Kind = Literal["diagnose"]

KINDS: dict[Kind, tuple[type[BaseModel], str | None]] = {
    "diagnose": (_Diagnosis, "gyrotc.diagnose/1"),
}
"""Fields and schema of every kind."""


def read_result(path: Path, kind: Kind, *, optional: bool = False) -> dict[str, Any]:
    """A JSON object that a command wrote; {} for an optional one that is absent.

    Raises:
        InputError: It is missing, is no JSON, has another schema, or a field that is used is wrong.
    """
    if optional and not path.exists() and not path.is_symlink():
        return {}
    return checked_result(read_json(path, f"what gyrotc wrote as {path.name}"), kind, str(path))


def checked_result(content: Any, kind: Kind, where: str) -> dict[str, Any]:
    """The object itself, looked through. Raises as `read_result`."""
    fields, schema = KINDS[kind]
    if not isinstance(content, dict):
        raise InputError(where, "is not a JSON object", f"what gyrotc wrote ({schema})")
    if content.get("schema") != schema:
        raise InputError(f"{where}, field schema", repr(content.get("schema"))[:60], repr(schema))
    checked(fields, content, where)
    return content
