"""`dataset.toml`: what it may say, what must agree between it and the recordings, and where problems go."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import date, datetime, time, timezone
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from ..common.errors import InputError
from ..common.inputs import read_toml, refuse_above
from ..common.texts import toml_key, toml_value
from .records import Mark


class Problems:
    """Problems found so far.

    Args:
        collect: False: `add` raises what it is given.
    """

    def __init__(self, *, collect: bool) -> None:
        self._collect = collect
        self.found: list[InputError] = []
        self.marks: dict[str, tuple[Mark, ...]] = {}

    def add(self, problem: InputError, *marks: Mark) -> None:
        """Keeps the problem, and by its text the rows that it is about.

        Raises:
            InputError: The problem itself, if problems are not collected.
        """
        if not self._collect:
            raise problem
        self.found.append(problem)
        self.marks[str(problem)] = marks

    def __len__(self) -> int:
        return len(self.found)


FILE = "dataset.toml"
_ATTEMPTS = 3  # a field taken out can bring another error to light
_SERIAL = re.compile(r"[A-Za-z0-9._-]{1,64}")
_SERIAL_FORM = "1 to 64 of the characters A-Z a-z 0-9 . _ -, at least one of them a letter or digit"


def check_serial(serial: str) -> str:
    """Checks a serial and returns it.

    Raises:
        ValueError: It is no legal serial; the message says what is expected.
    """
    if not _SERIAL.fullmatch(serial) or not re.search(r"[A-Za-z0-9]", serial):
        raise PydanticCustomError("serial", "{form}", {"form": _SERIAL_FORM})
    return serial


def _plain_name(name: str) -> str:
    """The name in one spelling, so that one file has one name."""
    path = Path(name)
    if path.is_absolute() or ".." in path.parts or "\x00" in name or "\\" in name:
        raise PydanticCustomError("file", "a file inside the folder of the data set")
    if path.suffix.lower() not in (".csv", ".parquet"):
        raise PydanticCustomError("file", "a name that ends in .csv or .parquet")
    return path.as_posix()


def _instant(value: object) -> object:
    """TOML date-time, TOML date or ISO 8601 text; without an offset it is taken as UTC."""
    expected = PydanticCustomError("started", "a date and time such as 2026-03-01T08:00:00Z")
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(re.sub(r"[Zz]$", "+00:00", value.strip()))
        except ValueError:
            raise expected from None
    if isinstance(value, date) and not isinstance(value, datetime):
        value = datetime.combine(value, time())
    if not isinstance(value, datetime):
        raise expected
    return value if value.tzinfo else value.replace(tzinfo=timezone.utc)


def _json_value(value: object) -> object:
    """Free values in JSON types; dates become ISO 8601 text."""
    if isinstance(value, dict):
        return {str(key): _json_value(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_json_value(inner) for inner in value]
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    if isinstance(value, float) and not abs(value) < float("inf"):
        raise PydanticCustomError("meta", "text, whole numbers, finite numbers, dates, lists or tables")
    return value


def _one_error(expected: str) -> WrapValidator:
    """One error for a field of several types, instead of one for each type."""

    def validate(value: object, handler: ValidatorFunctionWrapHandler) -> object:
        try:
            return handler(value)
        except ValidationError:
            raise PydanticCustomError("choice", "{expected}", {"expected": expected}) from None

    return WrapValidator(validate)


Seconds = Annotated[float, Field(ge=-1e10, le=1e10)]
PowerOn = Annotated[Seconds | Literal["unknown"], _one_error('a number of seconds or "unknown"')]
Name = Annotated[str, Field(min_length=1, max_length=256)]
Level = Annotated[float, Field(ge=0.0, le=7.5e6)]
PerAxis = Annotated[
    float | dict[Literal["x", "y", "z"], float],
    _one_error("an angle in deg, or for three axes {x = 0.0, y = 90.0, z = 0.0}"),
]
Instant = Annotated[datetime, BeforeValidator(_instant)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class Columns(_Part):
    """Names of the columns."""

    time: Name = "time_s"
    temperature: Name = "temperature_c"
    rate: Name = "rate_dph"


class NoiseEntry(_Part):
    """`[noise]`: what the unit is declared to have."""

    arw_deg_per_sqrt_h: Level | None = None
    bias_instability_dph: Level | None = None
    rate_random_walk_dph_per_sqrt_h: Level | None = None
    quantum_arcsec: Level | None = None


class SourceEntry(_Part):
    """`[source]`: the logger's file that a run was imported from."""

    file: str
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    bytes: Annotated[int, Field(ge=0)]
    imported_by: str
    map: str
    run: str = ""


Sources = Annotated[
    tuple[SourceEntry, ...], BeforeValidator(lambda value: (value,) if isinstance(value, dict) else value)
]


class ExcludeEntry(_Part):
    """A stretch of a run that does not count."""

    from_s: Seconds
    to_s: Seconds
    reason: str = ""


class RunEntry(_Part):
    """One `[[run]]`."""

    file: Annotated[Name, AfterValidator(_plain_name)]
    role: Literal["train", "exam"] = "train"
    environment: str = ""
    started: Instant | None = None
    power_on_s: PowerOn = 0.0
    from_s: Seconds | None = None
    to_s: Seconds | None = None
    exclude: tuple[ExcludeEntry, ...] = ()
    axis_azimuth_deg: PerAxis | None = None
    axis_elevation_deg: PerAxis | None = None


class Description(_Part):
    """`dataset.toml`. Times in s on the file's clock; azimuth in deg clockwise from north, elevation up."""

    schema_: Annotated[Literal[1], Field(alias="schema")] = 1
    serial: Annotated[str, AfterValidator(check_serial)]
    description: str = ""
    earth_rate: Literal["removed", "none", "compute"] | None = None
    latitude_deg: Annotated[float, Field(ge=-90.0, le=90.0)] | None = None
    latitude_sigma_deg: Level = 0.01
    axis_sigma_deg: Level = 0.1
    applied_table: Annotated[str, Field(pattern="^(none|[0-9a-f]{64})$")] = "none"
    pulse_weight_arcsec: Annotated[float, Field(gt=0.0, le=1e9)] | None = None
    temperature_late_s: Annotated[float, Field(ge=-3600.0, le=3600.0)] = 0.0
    columns: Columns = Columns()
    units: dict[Name, Name] = {}
    trust_units: bool = False
    source: Sources = ()
    meta: Annotated[dict[str, Any], BeforeValidator(_json_value)] = {}
    noise: NoiseEntry | None = None
    run: Annotated[tuple[RunEntry, ...], Field(min_length=1)]


def parse_description(path: Path, problems: Problems) -> Description | None:
    """Reads and checks `dataset.toml`; every wrong field is a problem of its own.

    Returns:
        The description; where fields were wrong, what remains without them; None if nothing usable remains.
    """
    try:
        content = read_toml(path, "a TOML file", FILE)
        runs = content.get("run")
        refuse_above("runs", len(runs) if isinstance(runs, list) else 0, FILE, "runs")
    except InputError as error:
        problems.add(error)
        return None
    if "schema" not in content:
        problems.add(InputError(f"{FILE}, field schema", "is missing", "schema = 1"))
        content["schema"] = 1
    for _ in range(_ATTEMPTS):
        try:
            return Description.model_validate(_tuples(content))
        except ValidationError as error:
            details = _causes(error.errors())
            for detail in details:
                problems.add(_wrong_field(detail, content))
            if not all(_dropped(content, detail) for detail in details):
                return None
    return None


def _causes(details: list[ErrorDetails]) -> list[ErrorDetails]:
    """Without what only follows: a wrong run does not count, and then there may be too few."""
    wrong_run = any(d["loc"][0] == "run" and len(d["loc"]) > 1 for d in details)
    return [d for d in details if not (wrong_run and d["type"] == "too_short" and d["loc"] == ("run",))]


def _dropped(content: dict[str, Any], detail: ErrorDetails) -> bool:
    """Takes a wrong field out of the content so that the rest can be looked at; False if that cannot be."""
    location = detail["loc"]
    if location[0] == "run":
        if len(location) < 3 or location[2] == "file":
            return False
        content["run"][location[1]].pop(location[2], None)
    elif location[0] == "serial":
        content["serial"] = "unknown"
    else:
        content.pop(str(location[0]), None)
    return True


def _tuples(value: Any) -> Any:
    """Lists as tuples, which is what strict pydantic wants; free facts stay lists."""
    if isinstance(value, dict):
        return {k: v if k == "meta" else _tuples(v) for k, v in value.items()}
    return tuple(_tuples(v) for v in value) if isinstance(value, list) else value


def _wrong_field(detail: ErrorDetails, content: dict[str, Any]) -> InputError:
    where = _place(detail["loc"], content)
    kind = detail["type"]
    if kind == "missing":
        return InputError(where, "is missing", f"{detail['loc'][-1]} = ...")
    if kind == "extra_forbidden":
        return InputError(where, "is not known", "a field named in docs/recordings.md (a typing error?)")
    if kind == "too_short":
        return InputError(where, "is empty", "at least one [[run]]")
    expected = re.sub(r"^Input should be |^Value error, ", "", detail["msg"])
    return InputError(where, _shown(detail["input"]), expected)


def _shown(value: object) -> str:
    text = repr(value) if not isinstance(value, dict | tuple) else type(value).__name__
    return text if len(text) <= 80 else text[:77] + "..."


def _place(location: tuple[int | str, ...], content: dict[str, Any]) -> str:
    """`dataset.toml, run 2 (run-02.csv), field role` for a location that pydantic gives."""
    parts = [FILE]
    rest = list(location)
    if len(rest) > 1 and rest[0] == "run" and isinstance(rest[1], int):
        run = content["run"][rest[1]]
        name = run.get("file") if isinstance(run, dict) else None
        parts.append(f"run {rest[1] + 1}" + (f" ({name})" if isinstance(name, str) else ""))
        rest = rest[2:]
    names = [str(part) for part in rest if not isinstance(part, str) or re.fullmatch(r"[\w -]+", part)]
    if names:
        parts.append("field " + ".".join(names))
    return ", ".join(parts)


def dataset_toml(head: Mapping[str, Any], tables: Mapping[str, Any], runs: Sequence[Mapping[str, Any]] = ()) -> str:
    """`dataset.toml` as text: keys of the head, tables of plain values (a list: one table each), then the runs."""
    lines = [*_pairs(head)]
    for name, table in tables.items():
        for one in table if isinstance(table, list | tuple) else ():
            lines += ["", f"[[{toml_key(name)}]]", *_pairs(one)]
        if isinstance(table, Mapping):
            lines += ["", f"[{toml_key(name)}]", *_pairs(table)]
    for run in runs:
        lines += ["", "[[run]]", *_pairs(run)]
    return "\n".join(lines) + "\n"


def _pairs(table: Mapping[str, Any]) -> list[str]:
    return [f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items()]


def exclude_line(spans_s: Iterable[tuple[float, float]], reason: str) -> str:
    """The line of a run's entry that leaves spans of its file out, from and to in s, ready to paste."""
    return f"exclude = {toml_value([{'from_s': a, 'to_s': b, 'reason': reason} for a, b in spans_s])}"
