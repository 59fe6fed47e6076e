"""docs/results/summary.json: the figures that pages of docs/ quote, by campaign. Pages are made from it alone."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ..store.files import write_atomically

_FILE = Path("results/summary.json")
_WIDTH = 500  # of a line: most records are shorter


def recorded(docs: Path, name: str) -> Any:
    """What a campaign left; None: nothing."""
    path = docs / _FILE
    return json.loads(path.read_text("utf-8")).get(name) if path.exists() else None


def keep(docs: Path, name: str, record: Any) -> None:
    """Replaces what the campaign left before; everything else stays."""
    path = docs / _FILE
    before = json.loads(path.read_text("utf-8")) if path.exists() else {}
    path.parent.mkdir(parents=True, exist_ok=True)
    whole = dict(sorted({**before, name: record}.items()))
    write_atomically(path, "{\n" + ",\n".join(_campaign(*one) for one in whole.items()) + "\n}\n")


def _campaign(name: str, record: Any) -> str:
    return "\n".join(_lines(record, " ", f"{json.dumps(name)}: "))


def shortened(record: Any, section: Callable[[Any], str]) -> Any:
    """A record whose numbers have as few significant digits, three at least, as give the same section."""
    text = section(record)
    digits = range(3, 18)  # with 17 a float64 is itself
    return next(short for n in digits if section(short := rounded(record, n)) == text)


def rounded(value: Any, digits: int) -> Any:
    """A record with its numbers to so many significant digits."""
    if isinstance(value, dict):
        return {key: rounded(inner, digits) for key, inner in value.items()}
    if isinstance(value, list):
        return [rounded(inner, digits) for inner in value]
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value


def _lines(value: Any, indent: str, before: str = "", after: str = "") -> Iterator[str]:
    """JSON, each line of which holds as many entries as fit."""
    flat = json.dumps(value, ensure_ascii=False)
    if len(indent + before + flat + after) <= _WIDTH or not value or not isinstance(value, (dict, list)):
        yield indent + before + flat + after
        return
    brackets = "{}" if isinstance(value, dict) else "[]"
    yield indent + before + brackets[0]
    entries = list(value.items()) if isinstance(value, dict) else [(None, inner) for inner in value]
    line = ""
    for k, (key, inner) in enumerate(entries):
        head = "" if key is None else f"{json.dumps(key, ensure_ascii=False)}: "
        comma = "," if k + 1 < len(entries) else ""
        text = head + json.dumps(inner, ensure_ascii=False) + comma
        if line and len(indent) + len(line) + len(text) + 2 > _WIDTH:
            yield f"{indent} {line}"
            line = ""
        if len(indent) + len(text) + 1 > _WIDTH:
            yield from _lines(inner, indent + " ", head, comma)
        else:
            line = f"{line} {text}" if line else text
    if line:
        yield f"{indent} {line}"
    yield indent + brackets[1] + after
