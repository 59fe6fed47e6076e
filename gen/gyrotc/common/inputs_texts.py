"""TOML and JSON of others: read within ceilings, with nothing in them that later code could stumble over."""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from .ceilings import ceiling
from .errors import InputError
from .opening import read_input

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["checked", "parse_json", "parse_toml", "read_json", "read_toml"]

T = TypeVar("T")

_LONGEST_INTEGER = 64  # bits, signed; TOML v1.0.0, "Integer"
_SHOWN = 60  # characters of what is refused: half a line of a terminal
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
        content = json.loads(text, parse_constant=_refuse_constant, parse_float=_finite)
    except RecursionError as error:
        deepest = int(ceiling("nesting"))
        raise InputError(where, "is nested too deep", f"at most {deepest} levels") from error
    except ValueError as error:
        raise InputError(where, f"is not JSON ({error})", expected) from error
    _look_through(content, where)
    return content


def checked(kind: type[T], content: Any, where: str) -> T:
    """What JSON content says, as a pydantic model or another type, every field of the type that it should have.

    Raises:
        InputError: A field is missing or of another type; the message names it.
    """
    try:
        # JSON has no tuples: validated in JSON mode, so that lists pass and texts for numbers do not.
        return TypeAdapter(kind).validate_json(json.dumps(content))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(str(part) for part in first["loc"])
        place = f"{where}, field {field}" if field else where
        if first["type"] == "missing":
            raise InputError(place, "is missing") from error
        raise InputError(place, _short(first["input"]), first["msg"].removeprefix("Value error, ")) from error


def _decoded(data: bytes, where: str, expected: str) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{where}, line {line}", f"no UTF-8 text ({error.reason})", expected) from error


def _refuse_constant(text: str) -> float:
    raise ValueError(f"{text} is not a finite number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:_SHOWN]} is not a finite number")
    return value


def _look_through(content: Any, where: str) -> None:
    """Refuses what is nested too deep, integers of more than 64 bits, and text that is no Unicode."""
    deepest = int(ceiling("nesting"))
    levels: list[Any] = [content]
    for depth in range(deepest + 2):
        below: list[Any] = []
        for value in levels:
            if type(value) is float:  # most are
                continue
            if isinstance(value, dict):
                for key, inner in value.items():
                    _look_at(key, where)
                    below.append(inner)
            elif isinstance(value, list):
                below.extend(value)
            else:
                _look_at(value, where)
        levels = below
        if not levels:
            return
        if depth > deepest:
            break
    raise InputError(where, "is nested too deep", f"at most {deepest} levels (--max nesting=...)")


def _look_at(value: Any, where: str) -> None:
    if isinstance(value, str):
        if not value.isascii() and any("\ud800" <= c <= "\udfff" for c in value):
            raise InputError(where, "half a surrogate pair in a text", "Unicode text")
    elif isinstance(value, int) and value.bit_length() >= _LONGEST_INTEGER:
        raise InputError(where, f"a whole number of {value.bit_length()} bits", "at most 64 with its sign")


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."
