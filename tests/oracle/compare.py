"""Where the outcomes of a step differ: from those of another run, or from the tracked reference, which holds hashes.

The reference has a hash for each path of a JSON value, where the rows of a list of objects share their paths
(`runs[].file`). Files of one kind have the same paths, so these stand in it once.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

_DIGITS = 4  # of base64, 24 bits: a change stays unseen once in 10^7; of JSON results a hash of the whole stands beside
_LONGEST = 120  # characters of a value that are shown


def differences(one: Any, other: Any, path: str = "") -> Iterator[str]:
    """Every path at which two JSON values differ, with both values, in the order of the first."""
    if isinstance(one, dict) and isinstance(other, dict):
        for name in dict.fromkeys([*one, *other]):
            here = f"{path}.{name}" if path else name
            if name not in one or name not in other:
                yield f"{here}: only in {'the earlier run' if name in one else 'this run'}"
            else:
                yield from differences(one[name], other[name], here)
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, pair in enumerate(zip(one, other, strict=True)):
            yield from differences(*pair, f"{path}[{number}]")
    elif json.dumps(one) != json.dumps(other):
        yield f"{path}: {_shown(one)} -> {_shown(other)}"


class Reference:
    """Hashes of the outcomes of all sets, as they stand in a file.

    A part of an outcome is a text "shape hashes": the number of its list of paths, and a hash for each of them.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        content = json.loads(path.read_text("utf-8")) if path.is_file() else {}
        self.made_with: dict[str, str] = content.get("made_with", {})
        paths = content.get("paths", [])
        self._shapes: list[list[str]] = [[paths[int(k)] for k in s.split()] for s in content.get("shapes", [])]
        self._sets: dict[str, dict[str, dict[str, str]]] = content.get("sets", {})

    def steps(self, name: str) -> dict[str, dict[str, str]]:
        """The steps of a set with their parts."""
        return self._sets.get(name, {})

    def differences(self, part: str, found: Any) -> Iterator[str]:
        """As the function of this name; of the reference a hash is shown."""
        shape, hashes = part.split(" ")
        known = {path: hashes[_DIGITS * k : _DIGITS * (k + 1)] for k, path in enumerate(self._shapes[int(shape)])}
        values = dict(_leaves(found))
        for path in dict.fromkeys([*known, *values]):
            if path not in known or path not in values:
                yield f"{path}: only in {'the reference' if path in known else 'this run'}"
            elif known[path] != (now := _hash(values[path])):
                value = json.dumps(values[path], ensure_ascii=False)
                yield f"{path}: {known[path]} -> {now}" + f", {value}" * (len(value) <= _LONGEST)

    def enter(self, name: str, outcomes: Mapping[str, Mapping[str, Any]]) -> None:
        """Replaces a set."""
        self._sets[name] = {
            step: {part: self._text(value) for part, value in parts.items()} for step, parts in outcomes.items()
        }

    def _text(self, value: Any) -> str:
        leaves = dict(_leaves(value))
        if (paths := list(leaves)) not in self._shapes:
            self._shapes.append(paths)
        return f"{self._shapes.index(paths)} {''.join(map(_hash, leaves.values()))}"

    def write(self, made_with: Mapping[str, str]) -> None:
        """The file, sets by name, with a line for each part of a step."""
        paths = sorted({path for shape in self._shapes for path in shape})
        number = {path: k for k, path in enumerate(paths)}
        content = {
            "made_with": made_with,
            "sets": dict(sorted(self._sets.items())),
            "shapes": [" ".join(str(number[path]) for path in shape) for shape in self._shapes],
            "paths": paths,
        }
        self._path.write_text(json.dumps(content, indent=0, ensure_ascii=False) + "\n", "utf-8")


def _leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Paths and what is there: a list of objects is an object of columns, any other list is one value."""
    if isinstance(value, dict) and value:
        for name, part in value.items():
            yield from _leaves(part, f"{path}.{name}" if path else name)
    elif isinstance(value, list) and value and all(isinstance(part, dict) for part in value):
        for name in dict.fromkeys(name for part in value for name in part):
            yield from _leaves([part[name] for part in value if name in part], f"{path}[].{name}")
    else:
        yield path, value


def _hash(value: Any) -> str:
    return base64.b64encode(hashlib.sha256(json.dumps(value).encode()).digest()).decode()[:_DIGITS]


def _shown(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _LONGEST else text[:_LONGEST] + " ..."
