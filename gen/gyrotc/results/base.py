"""Parts that all JSON results share: types of fields, findings, the form on disk and its reading."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field

from .. import __version__
from ..common.errors import InputError, quoted, shortened
from ..common.inputs import checked, parse_json, read_input, read_json

if TYPE_CHECKING:
    from typing_extensions import Self


# Far above any figure; the product of two figures on a page still has a square root in float64.
_LARGEST = 1e300

Figure = Annotated[float, Field(ge=-_LARGEST, le=_LARGEST)] | None
"""Number, or null if it was not measured."""
Amount = Annotated[float, Field(ge=0.0, le=_LARGEST)]
Positive = Annotated[float, Field(gt=0.0, le=1e12)]
Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Axis = Annotated[str, Field(pattern="^[xyz]$")] | None
Numeric = Literal["f32", "q31"]
"""Arithmetic of a table: float32 or 32-bit fixed point."""
NUMERICS: tuple[Numeric, ...] = get_args(Numeric)
"""Arithmetics that a table may have, the default first."""

TABLE_BYTES = "read-only memory that the table takes in a program where pointers have 32 bits, bytes"
"""Meaning of the size of a table, in every result, on every page and in the header of the table."""

R = TypeVar("R", bound="Numbered")


class Part(BaseModel):
    """An object inside a result. Unknown fields are accepted when it is read, and dropped."""

    model_config = ConfigDict(
        frozen=True,
        extra="ignore",
        strict=True,
        allow_inf_nan=False,
        populate_by_name=True,
        protected_namespaces=(),
        defer_build=True,
    )

    @classmethod
    def of_object(cls, found: object, **others: Any) -> Self:
        """Make one from the attributes of an object that have the names of fields, and from further fields."""
        return cls(**{n: getattr(found, n) for n in cls.model_fields if n not in others}, **others)

    def content(self) -> dict[str, Any]:
        """Return the JSON object: the fields in their order, without those that were not set."""
        return self.model_dump(mode="json", by_alias=True, exclude_unset=True)


class Numbered(Part):
    """A file that states the name and number of its form."""

    schema_: Annotated[str, Field(alias="schema")]

    def model_post_init(self, _: Any) -> None:
        """Mark the schema as set, so that it is written."""
        self.model_fields_set.add("schema_")

    @classmethod
    def schema_id(cls) -> str:
        """Return name and number of the form, such as `gyrotc.limits/1`."""
        return str(cls.model_fields["schema_"].default)


class Result(Numbered):
    """A result, with the version of gyrotc that wrote it."""

    gyrotc_version: str = Field(description="version of gyrotc that wrote the result")


class UnitResult(Result):
    """A result of one gyro."""

    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="axis of the gyro; null if the recordings have one axis")


def read_result(path: Path, kind: type[R]) -> R:
    """Read a result that a command wrote.

    Raises:
        InputError: The file is missing or no JSON, has another schema, or a field has a wrong value.
    """
    where, expected = str(path), f"what gyrotc wrote as {path.name}"
    data = read_input(path, "result_mib", expected)
    content = parse_json(data, where, expected)
    try:
        return checked_result(content, kind, where, data)
    except InputError as error:
        raise refused_result(path, content, error) from error


def refused_result(path: Path, content: Any, error: InputError) -> InputError:
    """Return the refusal of a result; it names the program that wrote the result if that was not this one.

    Args:
        path: The file; a manifest beside it names the program.
        content: Its content, which names the version.
        error: Refusal of its content.
    """
    from .cache import program_of  # it looks at every file of the package

    written = _version_in(content)
    with suppress(InputError):
        manifest = read_json(path.parent / "manifest.json", "a manifest")
        program = manifest.get("program") if isinstance(manifest, dict) else None
        if isinstance(program, str) and program and program != program_of():
            written = f"{_version_in(manifest)} (program {program[:12]})".lstrip()
            here = f" (program {program_of()[:12]})"
            return _of_another(path, written, here, error)
    return error if written in ("", __version__) else _of_another(path, written, "", error)


def _version_in(content: Any) -> str:
    version = content.get("gyrotc_version") if isinstance(content, dict) else None
    return shortened(version) if isinstance(version, str) else ""


def _of_another(path: Path, written: str, here: str, error: InputError) -> InputError:
    found = f"was written by gyrotc {written}, and this is gyrotc {__version__}{here}, which finds: {error}"
    return InputError(str(path), found, "a result of this gyrotc: give the command that made it again")


def read_optional(path: Path, kind: type[R]) -> R | None:
    """Read a result that a command wrote; None if the file is absent. Raises as `read_result`."""
    return read_result(path, kind) if path.exists() or path.is_symlink() else None


def checked_result(content: Any, kind: type[R], where: str, text: bytes | None = None) -> R:
    """Return JSON content as a result; `text` is its source, for line numbers. Raises as `read_result`."""
    schema = kind.schema_id()
    if not isinstance(content, dict):
        raise InputError(where, "is not a JSON object", f"what gyrotc wrote ({schema})")
    if content.get("schema") != schema:
        raise InputError(f"{where}, field schema", quoted(content.get("schema")), repr(schema))
    return checked(kind, content, where, text)


ADVICE = {
    "coarse_rate": "Record the rate with more digits, in a finer range of the converter, or as pulses.",
    "coarse_temperature": "Record more digits of the temperature, or use a sensor with a finer resolution.",
    "coarse_time": "Number the rows instead of trusting the stamps: gyrotc import FILE --set time.rate_hz=R, or record "
    "finer stamps.",
    "constant_channel": "Look whether the sensor was connected; take the column out if it says nothing.",
    "counter_wrapped": "Add the range of the counter behind each such place, or store the counts with their sign.",
    "earth_rate_not_stated": 'Say in dataset.toml what was done about it: earth_rate = "removed", "none" or "compute".',
    "gaps": "Look at the logger (buffer, disk, cable) at these times. Blocks with fewer than half of their rows are "
    "left out by themselves.",
    "jump_in_temperature": "Look for a loose contact or a change of the sensor there; leave the stretch out by "
    "exclude, or cut the run by from_s and to_s.",
    "left_out": "Nothing, if it is meant so.",
    "mostly_holds": "Record ramps at several rates, up and down.",
    "no_temperature_information": "Record runs in a chamber, over the temperatures that the product will see.",
    "end_stop": "Look at the range of the sensor and of its converter, and at what the logger writes for a reading "
    "that it does not have.",
    "noise_changes": "Look for what disturbed the gyro then: motion, a supply, another mode or filter. Record the run "
    "again if most of it is disturbed.",
    "temperature_outliers": "Look for a loose contact of the temperature sensor or a garbled line.",
    "rate_outliers": "Look for what disturbed the gyro at these times; paste the exclude line into the run's [[run]] "
    "of dataset.toml to leave them out of every figure, too.",
    "row_periods_differ": "Nothing, if the logger was set so; else look which of the files has a wrong time unit.",
    "runs_contradict": "Compare serial, mounting, mode and software of this run with the others; leave out what is not "
    "the same gyro in the same state. gyrotc diagnose looks for turn-on offsets and ageing.",
    "same_recording_twice": "Keep one of the two.",
    "small_rates": 'Declare the unit: [units] rate = "deg/s" in dataset.toml.',
    "rate_held": "Record at the gyro's own rhythm, or keep every row of it once.",
    "shared_axes": "Look at the wiring of the channels and at the columns of the logger.",
    "stuck_rate": "Look at the logger and the gyro's data line there; leave the stretch out by exclude.",
    "stuck_temperature": "Look at the wiring of the temperature sensor; paste the exclude line.",
    "temperature_late": "Pair the files of this run anew and convert them again, or leave the run out.",
    "units_trusted": "Nothing, if the values are right as they are; else declare their unit.",
    "time_drifts": "Find out which clock is right. If the gyro's is: number the rows, gyrotc import FILE --set "
    "time.rate_hz=R.",
    "time_jumps": "Number the rows instead, gyrotc import FILE --set time.rate_hz=R, or cut the file there into two "
    "runs by to_s and from_s.",
    "time_since_epoch": "State power_on_s of the run, or subtract the time of power-on; gyrotc import does that.",
}
"""Advice on what to do next, by the id of a finding."""


class MarkedRows(Part):
    """Rows that a finding or a problem is about."""

    file: str = Field(description="name of the file in `dataset.toml`")
    rows: tuple[int, int] | None = Field(description="first and last row, counted from 1; null if not stated")
    span_s: tuple[float, float] | None = Field(
        description="times of the first and last row on the file's clock, s; null if not stated"
    )


class Estimate(Part):
    """A figure with its 95 % interval."""

    value: float = Field(description="estimated value")
    low: Figure = Field(description="lower end of the 95 % interval; null if there is none")
    high: Figure = Field(description="upper end of the 95 % interval; null if there is none")

    @classmethod
    def of(cls, found: tuple[float, float, float], **others: Any) -> Self:
        """Make one from the value and the ends of its interval."""
        return cls(value=found[0], low=found[1], high=found[2], **others)


class Size(Estimate):
    """Size of an effect with its unit."""

    unit: str = Field(description="unit of the value and of its interval")


class Finding(Part):
    """A fact that a person should know; fields that do not apply are absent."""

    id: str = Field(description="stable name of the finding")
    where: str = Field(default="data set", description="file with the start of the run and axes, or `data set`")
    text: str = Field(description="observation and its meaning, in words")
    next: str = Field(default="", description="next step; empty or absent if `text` says it")
    file: str | None = Field(
        default=None, description="file of the run; null if the finding is about the data set or the model"
    )
    from_s: Figure = Field(default=None, description="start of the run in its file, s; null means the whole file")
    axes: tuple[str, ...] = Field(default=(), description="axes that show the finding; empty means all that were read")
    time_s: Estimate | None = Field(default=None, description="time of the event on the file's clock, s")
    size: Size | None = Field(default=None, description="size of the event")
    leave_out_s: tuple[tuple[float, float], ...] = Field(
        default=(), description="times to leave out, from and to, s; empty if nothing has to be left out"
    )
    whole_run: bool = Field(default=False, description="true if the run has to be left out as a whole")
    exclude: str | None = Field(default=None, description="line of dataset.toml that leaves these times out")
    rows: tuple[MarkedRows, ...] = Field(default=(), description="first rows that the finding is about")
    evidence: dict[str, Any] = Field(default={}, description="figures that the finding rests on")

    def __str__(self) -> str:
        return f"{self.where}: {self.text}"
