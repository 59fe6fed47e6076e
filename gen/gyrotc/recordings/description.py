"""`dataset.toml`: what it may say, what columns and numbers of recordings must fulfil, and where problems go."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta, timezone
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
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

from ..common.arrays import FloatArray
from ..common.errors import InputError, quoted, shortened
from ..common.inputs import PLAUSIBLE_C, found_and_expected, near_field, read_toml, refuse_above
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
        """Keep a problem, and by its text the rows that it is about.

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
UNKNOWN_SERIAL = "unknown"  # stands for a serial that is refused, so that the rest can be looked at
_ATTEMPTS = 3  # a field taken out can bring another error to light
_SERIAL = re.compile(r"[A-Za-z0-9._-]{1,64}")
_SERIAL_FORM = "1 to 64 of the characters A-Z a-z 0-9 . _ -, at least one of them a letter or digit"


def check_serial(serial: str) -> str:
    """Check a serial and return it.

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


def not_yet(instant: datetime) -> bool:
    """Test whether an instant is after today in every zone: a clock that was wrong."""
    return instant > datetime.now(timezone.utc) + timedelta(days=1)


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
    value = value if value.tzinfo else value.replace(tzinfo=timezone.utc)
    if not_yet(value):
        raise PydanticCustomError("started", "a date and time that is not after today; leave it out if it is unknown")
    return value


def json_value(value: object) -> object:
    """Free values in JSON types; dates become ISO 8601 text."""
    if isinstance(value, dict):
        return {str(key): json_value(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [json_value(inner) for inner in value]
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    if isinstance(value, float) and not abs(value) < float("inf"):
        raise PydanticCustomError("meta", "text, whole numbers, finite numbers, dates, lists or tables")
    return value


_A_DAY = "a day in ISO 8601, not after today, such as 2026-03-07"


def stated_day(value: object) -> str:
    """Return a stated day as ISO 8601 text, which may go on with a time.

    Raises:
        ValueError: It is no day of the calendar, or it has not come yet.
    """
    text = value.isoformat() if isinstance(value, date) else value
    if not isinstance(text, str) or not re.match(r"\d{4}-\d{2}-\d{2}(T|$)", text):
        raise ValueError(_A_DAY)
    try:
        day = datetime.fromisoformat(text).date()
    except ValueError:
        raise ValueError(_A_DAY) from None
    if day > date.today():
        raise ValueError(_A_DAY)
    return text


def in_order(calibrated_on: str | None, issued: str | None) -> None:
    """Refuse a certificate that is older than its calibration.

    Raises:
        ValueError: It is.
    """
    if calibrated_on is not None and issued is not None and issued[:10] < calibrated_on[:10]:
        raise ValueError(f"issued on the day of the calibration ({calibrated_on[:10]}) or later, not {issued[:10]}")


def _free_facts(value: object) -> object:
    """Free values in JSON types; what must be a day is one."""
    found = json_value(value)
    if isinstance(found, dict):
        for name in ("calibrated_on", "issued"):
            if name in found:
                found[name] = _fact(name, found[name], stated_day)
        if "issued" in found:
            _fact("issued", found["issued"], lambda issued: in_order(found.get("calibrated_on"), issued))
    return found


def _fact(name: str, value: Any, check: Callable[[Any], Any]) -> Any:
    """Apply a check to a field of `[meta]`, whose errors name it."""
    try:
        return check(value)
    except ValueError as error:
        facts = {"name": name, "found": quoted(value), "expected": str(error)}
        raise PydanticCustomError("fact", "{expected}", facts) from None


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
Label = Annotated[str, Field(min_length=1, max_length=256)]
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

    time: Label = "time_s"
    temperature: Label = "temperature_c"
    rate: Label = "rate_dph"


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

    file: Annotated[Label, AfterValidator(_plain_name)]
    role: Literal["train", "exam"] = "train"
    environment: str = ""
    started: Instant | None = None
    power_on_s: PowerOn | None = None
    from_s: Seconds | None = None
    to_s: Seconds | None = None
    exclude: tuple[ExcludeEntry, ...] = ()
    axis_azimuth_deg: PerAxis | None = None
    axis_elevation_deg: PerAxis | None = None


class GyroFacts(_Part):
    """Facts of a gyro and its recording that `dataset.toml` and the import map of a logger have in common."""

    description: str = ""
    earth_rate: Literal["removed", "none", "compute"] | None = None
    latitude_deg: Annotated[float, Field(ge=-90.0, le=90.0)] | None = None
    pulse_weight_arcsec: Annotated[float, Field(gt=0.0, le=1e9)] | None = None
    units: dict[Label, Label] = {}
    meta: Annotated[dict[str, Any], BeforeValidator(_free_facts)] = {}
    noise: NoiseEntry | None = None


class Description(GyroFacts):
    """`dataset.toml`. Times in s on the file's clock; azimuth in deg clockwise from north, elevation up."""

    schema_: Annotated[Literal[1], Field(alias="schema")] = 1
    serial: Annotated[str, AfterValidator(check_serial)]
    latitude_sigma_deg: Level = 0.01
    axis_sigma_deg: Level = 0.1
    applied_table: Annotated[str, Field(pattern="^(none|[0-9a-f]{64})$")] = "none"
    applied_model: Annotated[str, Field(min_length=1, max_length=4096)] | None = None
    temperature_late_s: Annotated[float, Field(ge=-3600.0, le=3600.0)] = 0.0
    columns: Columns = Columns()
    trust_units: bool = False
    source: Sources = ()
    fit: dict[Label, Any] = {}
    run: Annotated[tuple[RunEntry, ...], Field(min_length=1)]


def parse_description(path: Path, problems: Problems) -> Description | None:
    """Read and check `dataset.toml`; every wrong field is a problem of its own.

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
    """Drop errors that follow from others: a wrong run does not count, and then there may be too few."""
    wrong_run = any(d["loc"][0] == "run" and len(d["loc"]) > 1 for d in details)
    return [d for d in details if not (wrong_run and d["type"] == "too_short" and d["loc"] == ("run",))]


def _dropped(content: dict[str, Any], detail: ErrorDetails) -> bool:
    """Take a wrong field out of the content, so that the rest can be checked; return False if that is impossible."""
    location = detail["loc"]
    if location[0] == "run":
        if len(location) < 3 or location[2] == "file":
            return False
        content["run"][location[1]].pop(location[2], None)
    elif location[0] == "serial":
        content["serial"] = UNKNOWN_SERIAL
    else:
        content.pop(str(location[0]), None)
    return True


def _tuples(value: Any) -> Any:
    """Return lists as tuples, which strict pydantic wants; free facts stay lists."""
    if isinstance(value, dict):
        return {k: v if k == "meta" else _tuples(v) for k, v in value.items()}
    return tuple(_tuples(v) for v in value) if isinstance(value, list) else value


def _wrong_field(detail: ErrorDetails, content: dict[str, Any]) -> InputError:
    where = _place(detail["loc"], content)
    kind = detail["type"]
    if kind == "missing":
        return InputError(where, "is missing", f"{detail['loc'][-1]} = ...")
    if kind == "extra_forbidden":
        return InputError(where, "is not known", near_field(Description, detail["loc"], "docs/recordings.md"))
    if kind == "fact":
        facts = detail["ctx"]
        return InputError(f"{where}.{facts['name']}", facts["found"], facts["expected"])
    if kind == "too_short":
        return InputError(where, "is empty", "at least one [[run]]")
    return InputError(where, *found_and_expected(detail))


def _place(location: tuple[int | str, ...], content: dict[str, Any]) -> str:
    """`dataset.toml, run 2 (run-02.csv), field role` for a location that pydantic gives."""
    parts = [FILE]
    rest = list(location)
    if len(rest) > 1 and rest[0] == "run" and isinstance(rest[1], int):
        run = content["run"][rest[1]]
        name = run.get("file") if isinstance(run, dict) else None
        parts.append(f"run {rest[1] + 1}" + (f" ({shortened(name)})" if isinstance(name, str) else ""))
        rest = rest[2:]
    names = [shortened(str(part)) for part in rest if not isinstance(part, str) or re.fullmatch(r"[\w -]+", part)]
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


PULSES = "pulses"
AXIS_OF_COLUMN = {"rate_x_dph": "x", "rate_y_dph": "y", "rate_z_dph": "z"}
_LONGEST_NAME = 64  # characters: fits a line of a page and of a terminal


@dataclass(frozen=True, slots=True)
class Layout:
    """Columns of one file by what they mean.

    Attributes:
        time: Name of the column of time, s.
        temperature: Name of the column of temperature, C.
        value: Name of the column of the rate (deg/h) or of pulses; empty where there are several axes.
        pulses: Whether `value` holds pulses.
        axes: Columns of rates by axis, deg/h; empty where there is one rate.
        channels: All other columns.
    """

    time: str
    temperature: str
    value: str
    pulses: bool
    axes: dict[str, str]
    channels: tuple[str, ...]

    def value_of(self, axis: str | None) -> str:
        """Name of the column that holds the rate or the pulses of an axis."""
        return self.value if axis is None else self.axes[axis]


def arrange(file: str, names: Sequence[str], columns: Columns, problems: Problems) -> Layout | None:
    """Find the meaning of the columns of a file; return None, and report problems, if they make no recording."""
    before = len(problems)
    _check_names(file, names, problems)
    for kind, name in (("time", columns.time), ("temperature", columns.temperature)):
        if name not in names:
            found = f"no column {name} among {_list(names)}"
            expected = f"the {kind} in {name}, or [columns] {kind} = ... (`gyrotc import` finds it)"
            problems.add(InputError(f"{file}, line 1", found, expected))
    axes = {axis: name for name, axis in AXIS_OF_COLUMN.items() if name in names and name != columns.rate}
    given = [columns.rate] * (columns.rate in names) + [PULSES] * (PULSES in names)
    given += [", ".join(axes.values())] * bool(axes)
    if len(given) > 1:
        problems.add(InputError(f"{file}, line 1", f"both {' and '.join(given)}", "one of them"))
    elif not given:
        found = f"no column {columns.rate} among {_list(names)}"
        expected = f"{columns.rate}, pulses, or rate_x_dph, rate_y_dph, rate_z_dph (`gyrotc import` finds it)"
        problems.add(InputError(f"{file}, line 1", found, expected))
    if len(problems) > before:
        return None
    used = {columns.time, columns.temperature, given[0], *axes.values()}
    return Layout(
        time=columns.time,
        temperature=columns.temperature,
        value="" if axes else given[0],
        pulses=given[0] == PULSES,
        axes=axes,
        channels=tuple(name for name in names if name not in used),
    )


def _check_names(file: str, names: Sequence[str], problems: Problems) -> None:
    for name, count in Counter(names).items():
        where = f"{file}, line 1, column {name or names.index(name) + 1}"
        if not name:
            problems.add(InputError(where, "has no name", "a name for every column"))
        elif count > 1:
            problems.add(InputError(where, f"is there {count} times", "every column once"))
        elif len(name) > _LONGEST_NAME or not name.isprintable():
            problems.add(InputError(where, "is no usable name", f"1 to {_LONGEST_NAME} printable characters"))


def _list(names: Sequence[str]) -> str:
    shown = ", ".join(names[:8])
    return shown if len(names) <= 8 else f"{shown} and {len(names) - 8} more"


MIN_ROWS = 10  # a file of fewer rows is a mistake, not a recording
_RATE_DPH = (-7.5e6, 7.5e6)  # a little above 2000 deg/s, the widest usual range; no table holds more
_TIME_S = (-1e10, 1e10)  # three hundred years: seconds of any epoch, not milliseconds or nanoseconds
# Comparisons with it let NaN and infinities be found without an array of their own
_LARGEST = float(np.finfo(np.float64).max)
_KELVIN = (183.15, 473.15)  # the plausible range, had it been given in kelvin


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a column: first row that has it, how many rows have it, what was found and expected."""

    row: int
    column: str
    rows: int
    found: str
    expected: str


def column_faults(columns: Mapping[str, FloatArray], layout: Layout) -> Iterator[Fault]:
    """Yield faults of the numbers of one file, at most one for each column and kind."""
    good_time = True
    for name, values in columns.items():
        if _lie_within(values, (-_LARGEST, _LARGEST)):
            continue
        good_time = good_time and name != layout.time
        wrong = ~np.isfinite(values) if name == layout.time else np.isinf(values)
        if wrong.any():
            yield _fault(name, wrong, values, "a finite number")
    time = columns[layout.time]
    if good_time:
        yield from _order(layout.time, time)
    yield from _within(layout.time, time, _TIME_S, "s")
    yield from _temperature(layout.temperature, columns[layout.temperature])
    if layout.pulses:
        pulses = columns[layout.value]
        wrong = np.isfinite(pulses) & (pulses != np.round(pulses))
        if wrong.any():
            yield _fault(layout.value, wrong, pulses, "whole counts since the last row")
    else:
        for name in layout.axes.values() or (layout.value,):
            yield from rate_faults(name, columns[name])


def rate_faults(name: str, rate: FloatArray) -> Iterator[Fault]:
    """Yield the faults of rates that no gyro has, deg/h; NaN passes."""
    yield from _within(name, rate, _RATE_DPH, "deg/h")


def _order(name: str, time: FloatArray) -> Iterator[Fault]:
    if np.all(time[1:] > time[:-1]):
        return
    step = np.diff(time)
    for wrong, what in ((step == 0.0, "repeated"), (step < 0.0, "going back")):
        if wrong.any():
            first = int(np.argmax(wrong)) + 1
            found = f"{what}: {time[first]:.10g} s after {time[first - 1]:.10g} s"
            expected = "times that strictly increase; `gyrotc import` of the file says what goes on"
            yield Fault(first, name, int(wrong.sum()), found, expected)


def _temperature(name: str, values: FloatArray) -> Iterator[Fault]:
    for fault in _within(name, values, PLAUSIBLE_C, "C"):
        likely = likely_temperature(values)
        word = {"K": "kelvin", "degF": "fahrenheit"}.get(likely or "", "")
        hint = "; nan in place of a failed reading"
        hint = f'; {word}? [units] temperature = "{likely}" in dataset.toml' if likely else hint
        yield Fault(fault.row, fault.column, fault.rows, fault.found, fault.expected + hint)


# A unit is wrong in all rows: fewer implausible temperatures are failed readings.
_MIN_SHARE = 0.02


def likely_temperature(values: FloatArray) -> str | None:
    """The unit in which temperatures beyond the plausible would all be plausible: "K", "degF" or None."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    if high <= PLAUSIBLE_C[1] or np.count_nonzero(finite > PLAUSIBLE_C[1]) < _MIN_SHARE * len(finite):
        return None
    if _KELVIN[0] <= low and high <= _KELVIN[1]:
        return "K"
    return "degF" if (high - 32.0) / 1.8 <= PLAUSIBLE_C[1] and (low - 32.0) / 1.8 >= PLAUSIBLE_C[0] else None


def _within(name: str, values: FloatArray, limits: tuple[float, float], unit: str) -> Iterator[Fault]:
    if _lie_within(values, limits):
        return
    wrong = np.isfinite(values) & ((values < limits[0]) | (values > limits[1]))
    if wrong.any():
        yield _fault(name, wrong, values, f"{limits[0]:g} ... {limits[1]:g} {unit}")


def _lie_within(values: FloatArray, limits: tuple[float, float]) -> bool:
    """Test whether all values are within limits, without arrays as long as the recording; NaN is not."""
    return len(values) == 0 or bool(limits[0] <= values.min() and values.max() <= limits[1])


def _fault(name: str, wrong: NDArray[np.bool_], values: FloatArray, expected: str) -> Fault:
    first = int(np.argmax(wrong))
    return Fault(first, name, int(wrong.sum()), f"{values[first]:.10g}", expected)
