"""The JSON that gyrotc writes: one text for one content, and the canonical form for hashes."""

from __future__ import annotations

import functools
import hashlib
import json
from typing import Any

_NESTED = (dict, list, tuple)
_SERIES = 32  # numbers; a longer list stands in one line: a third of its bytes were line ends and blanks


def json_text(content: Any) -> str:
    """Return the text of a JSON file: one blank for each level, long lists of numbers in one line, a final line end.

    Raises:
        ValueError: A number is not finite.
    """
    return _text(content, 0) + "\n"


def _text(content: Any, level: int) -> str:
    """Return what `json.dumps(content, indent=1)` gives, but for series, in a tenth of its time.

    A list or object without lists or objects inside is written in one go, with line ends for blanks.
    """
    if not isinstance(content, _NESTED) or not content:
        return _encoder(level).encode(content)
    inner = content.values() if isinstance(content, dict) else content
    kinds = set(map(type, inner))  # few, however many numbers there are
    line, last = "\n" + " " * (level + 1), "\n" + " " * level
    if not any(issubclass(kind, _NESTED) for kind in kinds):
        if len(content) > _SERIES and not isinstance(content, dict) and not any(issubclass(k, str) for k in kinds):
            return _line().encode(content)
        text = _encoder(level).encode(content)
        return text[0] + line + text[1:-1] + last + text[-1]
    if not isinstance(content, dict):
        return "[" + line + ("," + line).join(_text(part, level + 1) for part in content) + last + "]"
    if not all(isinstance(key, str) for key in content):
        raise TypeError("a key of an object is text")
    parts = (f"{_encoder(0).encode(key)}: {_text(part, level + 1)}" for key, part in content.items())
    return "{" + line + ("," + line).join(parts) + last + "}"


@functools.cache
def _encoder(level: int) -> json.JSONEncoder:
    """Return an encoder of lists and objects of plain values, one a line."""
    return json.JSONEncoder(allow_nan=False, separators=(",\n" + " " * (level + 1), ": "))


@functools.cache
def _line() -> json.JSONEncoder:
    return json.JSONEncoder(allow_nan=False, separators=(",", ":"))


def canonical_json(content: Any) -> bytes:
    """Return the text that a hash is taken of: sorted keys, no blanks, ASCII.

    Raises:
        ValueError: A number is not finite.
    """
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False).encode("ascii")


def digest_of(content: Any) -> str:
    """SHA-256 of the canonical form, hexadecimal. Raises as that."""
    return hashlib.sha256(canonical_json(content)).hexdigest()
