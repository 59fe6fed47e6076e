"""What every JSON result has: frozen fields of known types, one form on disk, one way to be read back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from ..common.errors import InputError
from ..common.inputs import checked, read_json

if TYPE_CHECKING:
    from typing_extensions import Self

# Far above any figure, and products of two figures of pages still have a square root in float64
_LARGEST = 1e300

Figure = Annotated[float, Field(ge=-_LARGEST, le=_LARGEST)] | None
"""A number, or null where it was not measured."""
Amount = Annotated[float, Field(ge=0.0, le=_LARGEST)]
Positive = Annotated[float, Field(gt=0.0, le=1e12)]
Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Axis = Annotated[str, Field(pattern="^[xyz]$")] | None
Arithmetic = Literal["f32", "q31"]

R = TypeVar("R", bound="Numbered")


class Part(BaseModel):
    """An object inside a result. Fields that are not known are let through when one is read, and forgotten."""

    model_config = ConfigDict(
        frozen=True,
        extra="ignore",
        strict=True,
        allow_inf_nan=False,
        populate_by_name=True,
        protected_namespaces=(),
    )

    @classmethod
    def of_object(cls, found: object, **others: Any) -> Self:
        """From what a computation found: its attributes that have the names of fields, and the other fields."""
        return cls(**{n: getattr(found, n) for n in cls.model_fields if n not in others}, **others)

    def content(self) -> dict[str, Any]:
        """The JSON object: the fields in their order, without those that were not given."""
        return self.model_dump(mode="json", by_alias=True, exclude_unset=True)


class Numbered(Part):
    """A file with name and number of its form."""

    schema_: Annotated[str, Field(alias="schema")]

    def model_post_init(self, _: Any) -> None:
        """The schema is written although nobody has to name it."""
        self.model_fields_set.add("schema_")

    @classmethod
    def schema_id(cls) -> str:
        """Name and number of the form, such as `gyrotc.limits/1`."""
        return str(cls.model_fields["schema_"].default)


class Result(Numbered):
    """A whole result, with the version that wrote it."""

    gyrotc_version: str = Field(description="of the gyrotc that wrote it")


class UnitResult(Result):
    """A result of one gyro."""

    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where the recordings have one axis")


def read_result(path: Path, kind: type[R]) -> R:
    """A result that a command wrote.

    Raises:
        InputError: It is missing, is no JSON, has another schema, or a field of it is wrong.
    """
    return checked_result(read_json(path, f"what gyrotc wrote as {path.name}"), kind, str(path))


def read_optional(path: Path, kind: type[R]) -> R | None:
    """A result that a command wrote; None where the file is absent. Raises as `read_result`."""
    return read_result(path, kind) if path.exists() or path.is_symlink() else None


def checked_result(content: Any, kind: type[R], where: str) -> R:
    """JSON content as a result. Raises as `read_result`."""
    schema = kind.schema_id()
    if not isinstance(content, dict):
        raise InputError(where, "is not a JSON object", f"what gyrotc wrote ({schema})")
    if content.get("schema") != schema:
        raise InputError(f"{where}, field schema", repr(content.get("schema"))[:60], repr(schema))
    return checked(kind, content, where)
