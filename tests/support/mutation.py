"""Changes a file as damage, typing errors and malice do: bits, pieces, values, structure."""

from __future__ import annotations

import json
import re
from typing import Any, Literal

import numpy as np

Form = Literal["bytes", "text", "json", "toml"]
_WORDS = [
    "", "0", "-0", "1", "-1", "nan", "NaN", "inf", "-inf", "Infinity", "1e999", "-1e308", "1e-12", "1e-320", "1e12",
    "9" * 19, "9" * 400, "9" * 5000, "0x" + "f" * 5000, "1." + "3" * 5000, "true", "null", '""', "''", "[]", "{}",
    "[" * 3000, "{" * 3000, "[" * 40 + "]" * 40, '{"a":' * 2000, '"\\ud800"', '"\\u0000"', '"' + "x" * 70000 + '"',
    "../../../etc/passwd", '"/dev/zero"', "\x00", "\r", "\n", ",", ";", "\ufeff", "ÿ", "a." * 3000 + "b", "1979-05-27",
    "1979-05-27T07:32:00Z", "9999-12-31T23:59:59-23:59", "'''", '"""', "=", "#", "[[run]]", "[a]",
]  # fmt: skip
_VALUES: list[Any] = [
    None, True, False, 0, -1, 1, 2**31, 2**63, 2**64, 10**400, 1e307, -1e308, 1e-320, 1e-12, 0.5, "", "x", "x" * 70000,
    "\x00", "../..", "/dev/zero", "é\u202e", [], {}, [[]], [None], [1e308] * 3, {"a": {}}, [[1, 2], [3]],
]  # fmt: skip
_TOKEN = re.compile(r"[-+\w.]+|\"[^\"\n]*\"|'[^'\n]*'")


def mutated(data: bytes, form: Form, rng: np.random.Generator) -> bytes:
    """One to three changes, seldom more."""
    for _ in range(int(rng.choice([1, 1, 1, 2, 3, 8]))):
        if form == "json" and rng.random() < 0.7:
            data = _in_structure(data, rng)
        elif form != "bytes" and rng.random() < 0.7:
            data = _in_words(data, rng)
        else:
            data = _in_bytes(data, rng)
    return data


def _in_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    if not data:
        return bytes(rng.integers(0, 256, 20, dtype=np.uint8))
    a, b = sorted(int(k) for k in rng.integers(0, len(data) + 1, 2))
    if rng.random() < 0.6:
        b = min(b, a + int(rng.integers(1, 16)))
    kind = int(rng.integers(7))
    changed = bytearray(data)
    if kind == 0:
        for k in rng.integers(0, len(data), int(rng.integers(1, 9))):
            changed[int(k)] ^= 1 << int(rng.integers(8))
        return bytes(changed)
    if kind == 1:
        return data[:a]
    if kind == 2:
        return data[:a] + data[b:]
    if kind == 3:
        return data[:b] + data[a:b] * int(rng.integers(1, 5)) + data[b:]
    if kind == 4:
        return data[:a] + bytes(rng.integers(0, 256, b - a, dtype=np.uint8)) + data[b:]
    if kind == 5:
        return data[:a] + bytes([int(rng.choice([0, 255, 127, 13, 10]))]) * (b - a) + data[b:]
    changed[a:b] = reversed(changed[a:b])
    return bytes(changed)


def _in_words(data: bytes, rng: np.random.Generator) -> bytes:
    text = data.decode("utf-8", "surrogateescape")
    tokens = list(_TOKEN.finditer(text))
    if not tokens:
        return data + _WORDS[int(rng.integers(len(_WORDS)))].encode("utf-8", "surrogatepass")
    one = tokens[int(rng.integers(len(tokens)))]
    lines = text.split("\n")
    kind = int(rng.integers(5))
    if kind < 3:
        word = _WORDS[int(rng.integers(len(_WORDS)))]
        if kind == 2:
            word = tokens[int(rng.integers(len(tokens)))][0]
        text = text[: one.start()] + word + text[one.end() :]
    elif kind == 3:
        k, m = rng.integers(0, len(lines), 2)
        lines[int(k)], lines[int(m)] = lines[int(m)], lines[int(k)]
        text = "\n".join(lines)
    else:
        k = int(rng.integers(len(lines)))
        lines[k : k + 1] = [lines[k]] * int(rng.choice([0, 2]))
        text = "\n".join(lines)
    return text.encode("utf-8", "surrogateescape")


def _in_structure(data: bytes, rng: np.random.Generator) -> bytes:
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):  # no longer JSON, or a number that Python does not read
        return _in_words(data, rng)
    places = list(_places(content, 0))
    if not places:
        return _in_words(data, rng)
    holder, key = places[int(rng.integers(len(places)))]
    kind = int(rng.integers(4))
    if kind == 0:
        del holder[key]
    elif kind == 1:
        other, at = places[int(rng.integers(len(places)))]
        holder[key] = json.loads(json.dumps(other[at]))
    elif kind == 2 and isinstance(holder[key], float | int) and abs(holder[key]) < 1e308:
        holder[key] = holder[key] * float(rng.choice([-1.0, 0.0, 1e-12, 1e12, 1e300, np.nan]))
    else:
        holder[key] = _VALUES[int(rng.integers(len(_VALUES)))]
    return json.dumps(content).encode("utf-8", "surrogatepass")


def _places(value: Any, depth: int) -> Any:
    if depth > 30:
        return
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield value, key
        yield from _places(inner, depth + 1)
