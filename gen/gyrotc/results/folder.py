"""What stands beside results in a folder: its marker, and a map on a grid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal, TypedDict

from pydantic import Field

from .base import Amount, Axis, Part, Result

if TYPE_CHECKING:
    from typing_extensions import Unpack


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
