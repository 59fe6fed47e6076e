"""Files that somebody else may have written: opened as regular files, within limits, refused in one clear message.

A user moves one of the limits by `gyrotc --max NAME=VALUE` or by the environment: `GYROTC_MAX="NAME=VALUE NAME=VALUE"`.
The option writes the environment, so that the processes of a fleet see it too.
"""

from __future__ import annotations

import codecs
import difflib
import functools
import json
import math
import os
import re
import stat
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO, Literal, TypeVar, cast, get_args, get_origin

from annotated_types import Interval

from .errors import InputError, quoted, shortened

if TYPE_CHECKING:
    from pydantic import TypeAdapter, ValidationError
    from pydantic_core import ErrorDetails


ENVIRONMENT = "GYROTC_MAX"


@dataclass(frozen=True, slots=True)
class Ceiling:
    """A ceiling: its default and what it is of."""

    default: float
    meaning: str
    movable: bool = False


CEILINGS: dict[str, Ceiling] = {
    "memory_gib": Ceiling(4.0, "memory that the rows of one recording, or its blocks, may take, GiB", movable=True),
    "recording_mib": Ceiling(8192.0, "size of one recording, trace or noise file, MiB", movable=True),
    "rows": Ceiling(1e9, "rows of one recording"),
    "columns": Ceiling(256.0, "columns of one recording", movable=True),
    "parquet_ratio": Ceiling(250.0, "size of a Parquet file once unpacked over its size, above 64 MiB"),
    "parser_s": Ceiling(20.0, "processor time of the reader of a logger's file for each 8 MiB of it, s", movable=True),
    "text_mib": Ceiling(4.0, "size of a dataset.toml, manifest, scenario, limits file or model.json, MiB"),
    "result_mib": Ceiling(32.0, "size of a JSON result, truth.json, picture or board log, MiB"),
    "nesting": Ceiling(32.0, "depth of tables and lists within one another in TOML and JSON"),
    "runs": Ceiling(2000.0, "runs of one data set"),
    "units": Ceiling(100_000.0, "gyros of one fleet"),
}
"""All ceilings by name; a user moves those of memory, size, columns and time, and the others protect these."""

MOVABLE = tuple(name for name, one in CEILINGS.items() if one.movable)


def ceiling(name: str) -> float:
    """The ceiling in force.

    Raises:
        InputError: The environment names an unknown one, or no number above 0.
    """
    return _moved(os.environ.get(ENVIRONMENT, "")).get(name, CEILINGS[name].default)


def set_ceilings(texts: Iterable[str]) -> None:
    """Move ceilings, each given as `NAME=VALUE`, for this process and those that it starts.

    Raises:
        InputError: An unknown name, or no number above 0.
    """
    joined = " ".join([os.environ.get(ENVIRONMENT, ""), *texts]).strip()
    _moved(joined)
    if joined:
        os.environ[ENVIRONMENT] = joined


@functools.lru_cache(maxsize=8)
def _moved(text: str) -> dict[str, float]:
    moved = {}
    for part in text.replace(",", " ").split():
        name, _, value = part.partition("=")
        where = f"--max or {ENVIRONMENT}, {name}"
        if name not in MOVABLE:
            raise InputError(where, "is not known", f"one of {', '.join(MOVABLE)}")
        try:
            moved[name] = float(value)
        except ValueError:
            moved[name] = math.nan
        if not 0.0 < moved[name] < math.inf:
            raise InputError(where, quoted(value), "a number above 0")
    return moved


def refuse_above(name: str, value: float, where: str, unit: str) -> None:
    """Raise `InputError` if `value` (in the ceiling's own measure) is above the ceiling `name`.

    Raises:
        InputError: It is.
    """
    most = ceiling(name)
    if value > most:
        remedy = f" (--max {name}=...)" if CEILINGS[name].movable else ""
        raise InputError(where, f"{value:.10g} {unit}", f"at most {most:.10g}{remedy}")


def need_memory(octets: float, where: str, why: str) -> None:
    """Check the memory that is about to be taken.

    Raises:
        InputError: More than the ceiling `memory_gib` would be needed.
    """
    refuse_above("memory_gib", octets / 2**30, where, f"GiB of memory for {why}")


_KINDS = (
    (stat.S_ISDIR, "is a folder"),
    (stat.S_ISFIFO, "is a pipe"),
    (stat.S_ISSOCK, "is a socket"),
    (stat.S_ISCHR, "is a device"),
    (stat.S_ISBLK, "is a device"),
)


def open_input(path: Path, where: str, expected: str) -> tuple[BinaryIO, int]:
    """Open a regular file (or a link to one) for reading, unbuffered.

    Anything else is not even opened: a pipe without a writer would wait for ever, and a device has no end.

    Args:
        path: The file.
        where: Its name in messages.
        expected: What it should be.

    Returns:
        The open file and its size, bytes. Reading stops there: what grows meanwhile, and what the kernel makes up
        under a size of 0 (`/proc/kmsg`), is not read.

    Raises:
        InputError: It does not exist, cannot be opened, or is no regular file.
    """
    try:
        _refuse_special(path.stat(), where, expected)
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
        try:
            facts = os.fstat(handle)  # of what was really opened
            _refuse_special(facts, where, expected)
            os.set_blocking(handle, True)
            return os.fdopen(handle, "rb", buffering=0), facts.st_size
        except BaseException:
            os.close(handle)
            raise
    except FileNotFoundError:
        raise InputError(where, "does not exist", expected) from None
    except (OSError, ValueError) as error:  # ValueError: a NUL byte in the name
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(where, f"cannot be read ({reason})", expected) from error


def _refuse_special(facts: os.stat_result, where: str, expected: str) -> None:
    if not stat.S_ISREG(facts.st_mode):
        found = next((text for is_one, text in _KINDS if is_one(facts.st_mode)), "is no regular file")
        raise InputError(where, found, expected)


def read_input(path: Path, ceiling_name: str, expected: str, where: str | None = None) -> bytes:
    """All bytes of a file.

    Args:
        path: The file.
        ceiling_name: Ceiling of its size, in MiB.
        expected: What it should be.
        where: Its name in messages; default the path.

    Raises:
        InputError: As `open_input`; or it is larger than the ceiling.
    """
    where = where or str(path)
    file, size = open_input(path, where, expected)
    with file:
        if size == 0:
            raise InputError(where, "is empty", expected)
        refuse_above(ceiling_name, size / 2**20, where, "MiB")
        parts = []
        try:
            while size > 0 and (part := file.read(size)):
                parts.append(part)
                size -= len(part)
        except OSError as error:
            raise InputError(where, f"cannot be read ({error.strerror})", expected) from error
    return b"".join(parts)


if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


T = TypeVar("T")

_LONGEST_INTEGER = 64  # bits, signed; TOML v1.0.0, "Integer"
# A key of more parts than tables may be nested costs the parser the square of their number.
_LONG_KEY = r"""(?<![\w-])(?:(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){%d}"""


def read_toml(path: Path, expected: str, where: str | None = None) -> dict[str, Any]:
    """A TOML file of at most `text_mib`.

    Raises:
        InputError: It cannot be read, is no TOML, is nested too deep, or holds a number of more than 64 bits.
    """
    return parse_toml(read_input(path, "text_mib", expected, where), where or str(path), expected)


def parse_toml(data: bytes, where: str, expected: str) -> dict[str, Any]:
    """The content of TOML text in UTF-8, with or without byte order mark. Raises as `read_toml`."""
    text = _decoded(data, where, expected)
    deepest = int(ceiling("nesting"))
    long_key = re.search(_LONG_KEY % (deepest + 1), text)
    if long_key:
        line = text.count("\n", 0, long_key.start()) + 1
        raise InputError(f"{where}, line {line}", "a key of too many parts", f"at most {deepest}")
    try:
        content: dict[str, Any] = tomllib.loads(text)
    except RecursionError as error:
        raise InputError(where, "is nested too deep", f"at most {deepest} levels") from error
    except ValueError as error:  # also of integers with thousands of digits
        raise InputError(where, f"no TOML: {error}", expected) from error
    _look_through(content, where)
    return content


def read_json(path: Path, expected: str, *, ceiling_name: str = "result_mib") -> Any:
    """A JSON file.

    Raises:
        InputError: It cannot be read, is no JSON, is nested too deep, or holds NaN, an infinity, an integer of more
            than 64 bits or half a surrogate pair.
    """
    return parse_json(read_input(path, ceiling_name, expected), str(path), expected)


def parse_json(data: bytes, where: str, expected: str) -> Any:
    """The content of JSON text in UTF-8. Raises as `read_json`."""
    text = _decoded(data, where, expected)
    try:
        content = json.loads(text, parse_constant=_refuse_constant)
    except RecursionError as error:
        deepest = int(ceiling("nesting"))
        raise InputError(where, "is nested too deep", f"at most {deepest} levels") from error
    except ValueError as error:
        raise InputError(where, f"is not JSON ({error})", expected) from error
    _look_through(content, where, finite=True)
    return content


def checked(kind: type[T], content: Any, where: str, text: bytes | None = None) -> T:
    """Validate JSON content as a pydantic model or another type; every field has the type that it should have.

    Args:
        text: What the content was parsed from, where it is known: it need not be written again.

    Raises:
        InputError: A field is missing or of another type; the message names it.
    """
    from pydantic import ValidationError  # half of the time that `gyrotc --help` may take

    try:
        # JSON has no tuples: validated in JSON mode, so that lists pass and texts for numbers do not.
        json_text = json.dumps(content) if text is None else text.removeprefix(codecs.BOM_UTF8)
        found: T = _adapter(cast("Any", kind)).validate_json(json_text)
        return found
    except ValidationError as error:
        raise refused(error, lambda field: f"{where}, field {field}" if field else where, kind) from error


@functools.cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


def refused(error: ValidationError, place: Callable[[str], str], kind: Any = None, page: str = "") -> InputError:
    """Return one message for what pydantic refuses.

    Args:
        error: What pydantic refuses.
        place: Function that says where a field stands; an empty name is the whole.
        kind: The type that was expected, which has the names of fields.
        page: The page that has all names; empty: none has.
    """
    first = error.errors(include_url=False)[0]
    where = place(".".join(shortened(str(part)) for part in first["loc"]))
    if first["type"] == "missing":
        return InputError(where, "is missing", _only_value(kind, first["loc"]))
    if first["type"] == "extra_forbidden":
        return InputError(where, "is not known", near_field(kind, first["loc"], page))
    return InputError(where, *found_and_expected(first))


# By pydantic's names of errors; what is in braces is the limit that the error carries.
_EXPECTATIONS = {
    "string_type": "a text",
    "string_too_short": "a text of at least {min_length} characters",
    "string_too_long": "a text of at most {max_length} characters",
    "string_pattern_mismatch": "a text of the form {pattern}",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "none_required": "nothing here",
    "list_type": "a list",
    "tuple_type": "a list",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
    "dict_type": "a table of names and values",
    "model_type": "a table of names and values",
    "model_attributes_type": "a table of names and values",
    "dataclass_type": "a table of names and values",
}


def found_and_expected(detail: ErrorDetails) -> tuple[str, str]:
    """Return what stands in a place that pydantic refuses, and what should, for readers who write no Python."""
    value, message = detail["input"], detail["msg"]
    known = _EXPECTATIONS.get(detail["type"])
    expected = known.format(**detail.get("ctx", {})) if known else message.removeprefix("Input should be ")
    if not isinstance(value, dict | list | tuple):
        return quoted(value), expected.removeprefix("Value error, ")
    if known is None and expected == message:  # of several fields together
        return message.removeprefix("Value error, "), ""
    return "a table" if isinstance(value, dict) else "a list", expected


def near_field(kind: Any, location: Sequence[str | int], page: str = "") -> str:
    """Return what is expected in the place of a field that is not known: the name that is nearest to it, and the page.

    Args:
        kind: The pydantic model that has the fields; None: it is not known.
        location: Where the field stands, from the whole of it on.
        page: The page that has all names; empty: none has.
    """
    near = difflib.get_close_matches(str(location[-1]), _fields_beside(kind, location), 1)
    return " or ".join((*near, *([f"a field named in {page}"] if page else [])))


def _only_value(kind: Any, location: Sequence[str | int]) -> str:
    """Return the line that states a field which has one legal value; empty where it has several."""
    field = _fields_beside(kind, location).get(str(location[-1]))
    values = get_args(field.annotation) if field is not None and get_origin(field.annotation) is Literal else ()
    return f"{location[-1]} = {values[0]!r}" if len(values) == 1 else ""


def _fields_beside(kind: Any, location: Sequence[str | int]) -> dict[str, Any]:
    """Return the fields, by their names in files, of the pydantic model in which a place lies; none if not known."""
    here = kind
    for part in location[:-1]:
        field = _fields_of(here).get(str(part))
        if field is not None:
            here = _model_in(field.annotation)
    return _fields_of(here)


def _fields_of(kind: Any) -> dict[str, Any]:
    return {one.alias or name: one for name, one in getattr(kind, "model_fields", {}).items()}


def _model_in(annotation: Any) -> Any:
    """Return the pydantic model that an annotation holds, also inside a tuple, a dict or a union; None without one."""
    if hasattr(annotation, "model_fields"):
        return annotation
    return next((found for found in map(_model_in, get_args(annotation)) if found is not None), None)


def _decoded(data: bytes, where: str, expected: str) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{where}, line {line}", f"no UTF-8 text ({error.reason})", expected) from error


def _refuse_constant(text: str) -> float:
    raise ValueError(f"{text} is not a finite number")


def _look_through(content: Any, where: str, *, finite: bool = False) -> None:
    """Refuse content that is nested too deep, integers of more than 64 bits, and text that is no Unicode.

    `finite`: also infinities, which a number with a large exponent becomes.
    """
    deepest = int(ceiling("nesting"))
    levels: list[Any] = [content]
    for depth in range(deepest + 2):
        below: list[Any] = []
        for value in levels:
            if type(value) is float:  # most are
                if finite and math.isinf(value):
                    raise InputError(where, f"is not JSON ({value} is not a finite number)")
            elif isinstance(value, dict):
                for key, inner in value.items():
                    _look_at(key, where)
                    below.append(inner)
            elif isinstance(value, list):
                numbers = set(map(type, value)) == {float} and all(map(math.isfinite, value))
                below.extend(value[:1] if numbers else value)  # one of them says how deep they are
            else:
                _look_at(value, where)
        levels = below
        if not levels:
            return
        if depth > deepest:
            break
    raise InputError(where, "is nested too deep", f"at most {deepest} levels")


def _look_at(value: Any, where: str) -> None:
    if isinstance(value, str):
        if not value.isascii() and any("\ud800" <= c <= "\udfff" for c in value):
            raise InputError(where, "half a surrogate pair in a text", "Unicode text")
    elif isinstance(value, int) and value.bit_length() >= _LONGEST_INTEGER:
        raise InputError(where, f"a whole number of {value.bit_length()} bits", "at most 64 with its sign")


MOST_CENTERS = 512
"""What a table holds: libc/gtc_limits.inl."""
MOST_HELD = 100_000
"""Blocks for which a temperature or the reading of a channel is held."""
PLAUSIBLE_C = (-90.0, 200.0)
"""Temperatures that the target accepts, C: docs/numerics.md, section 1; libc/gtc_num_f32.h."""
BlockLength = Annotated[float, Interval(gt=0.0, le=3600.0)]
"""Of a block, s."""
AverageLength = Annotated[float, Interval(gt=0.0, le=1e6)]
"""Of the means of which RMS figures are taken, s."""


def runtime_folders() -> tuple[Path, Path]:
    """Folders `include` and `libc` of the runtime: in the installed package, else in the source tree.

    Raises:
        InputError: They are in neither place.
    """
    here = Path(__file__).resolve().parents[1]
    for root in (here / "runtime", here.parents[1]):
        if (root / "include" / "gtc.h").is_file():
            return root / "include", root / "libc"
    raise InputError(str(here), "the C runtime is missing", "folders include and libc")
