"""What every JSON result has: frozen fields of known types, one form on disk, one way to be read back.

And what stands beside results in a folder: its marker, and a map on a grid.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypedDict, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from ..common.errors import InputError
from ..common.inputs import checked, read_json

if TYPE_CHECKING:
    from typing_extensions import Self, Unpack


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


class MapOfAxis(Part):
    """The static map of one axis at the points of a grid."""

    axis: Axis = Field(description="null where the recordings have one axis")
    model_hash: str = Field(description="of its model, shifted as its tables are (`emit --zero-at`)")
    temperature_c: tuple[float, ...] = Field(description="n temperatures, ascending, C")
    slope_c_per_min: tuple[float, ...] = Field(
        description="m rates of temperature, ascending, C/min; 0 is one of them where the envelope holds it"
    )
    bias_dph: tuple[tuple[float, ...], ...] = Field(
        description="n rows of m: the bias to be subtracted at each temperature and rate, deg/h"
    )
    linear_rms_dph: Amount = Field(
        description="RMS of what interpolation (bilinear, of values in float32) loses against the map, deg/h"
    )
    linear_largest_dph: Amount = Field(description="the most that it loses")
    terms: tuple[str, ...] = Field(description="ids of terms of the model, which no static map holds")


class MapOnGrid(Result):
    """The correction of a gyro as a table that any program reads."""

    schema_: Annotated[Literal["gyrotc.map/1"], Field(alias="schema")] = "gyrotc.map/1"
    serial: str = Field(description="gyro serial")
    axis: None = Field(description="each map has its own")
    units: dict[str, str] = Field(description="of every quantity of a map")
    maps: tuple[MapOfAxis, ...] = Field(description="one for each axis")


class MarkerFields(TypedDict, total=False):
    """Fields of a marker that a job changes."""

    kind: str
    command: str
    serial: str | None
    axis: str | None
    files: dict[str, str]
    parts: tuple[str, ...]
    pending: dict[str, dict[str, str]]
    unfinished: bool
    left_out: dict[str, str]


class Marker(Result):
    """What in a folder is gyrotc's."""

    schema_: Annotated[Literal["gyrotc.result/1"], Field(alias="schema")] = "gyrotc.result/1"
    kind: str = Field(
        description="`result` (build, fit, emit, verify, evaluate, sign), `diagnosis`, `plan`, `comparison`, "
        "`data set` (simulate, import), `fleet`, `trace` (traces outside a result)"
    )
    command: str = Field(description="that wrote the folder last")
    serial: str | None = Field(description="gyro serial; null where the folder is not of one gyro")
    axis: Axis = Field(description="null where it is not of one axis")
    files: dict[str, str] = Field(
        description="SHA-256 of every file that gyrotc wrote, by its path in the folder with `/`; without the marker "
        "itself and those of parts"
    )
    parts: tuple[str, ...] = Field(
        description="paths of folders inside with a marker of their own (an axis, the diagnosis of `build --extend`)"
    )
    pending: dict[str, dict[str, str]] = Field(
        default={},
        description="only while entries of the folder are replaced one by one, or after such a job was killed: the "
        "files that each entry will have. An entry is then whole as in `files` or whole as here",
    )
    unfinished: bool = Field(
        default=False,
        description="true in folders named `.<name>.gyrotc-part-<8 digits>` alone, which a job is writing "
        "or died writing",
    )
    left_out: dict[str, str] = Field(
        default={},
        description="SHA-256 of files that follow from the others and are not kept, by path: in a gyro's folder of a "
        "fleet the answers to the vectors; `gyrotc catalogue --export` makes them",
    )

    def content(self) -> dict[str, Any]:
        """The JSON object; files and parts by name, the last three fields only where they say something."""
        found = super().content()
        found |= {"files": dict(sorted(self.files.items())), "parts": sorted(self.parts)}
        rare = ("pending", "unfinished", "left_out")
        return {name: value for name, value in found.items() if value or name not in rare}

    def but(self, **changed: Unpack[MarkerFields]) -> Marker:
        """The same marker with other values in some fields."""
        return self.model_copy(update=dict(changed))

    def known(self, name: str) -> set[str]:
        """SHA-256 that a file of this path may have."""
        later = self.pending.get(name.split("/", 1)[0], {})
        return {table[name] for table in (self.files, later) if name in table}

    def entries(self) -> set[str]:
        """Names in the folder itself that are gyrotc's."""
        names = {name.split("/", 1)[0] for name in (*self.files, *self.parts)}
        return names | {entry for entry, files in self.pending.items() if files}
