"""Differences between the outcomes of two runs of a set."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

#: Characters of a value that are shown, and how many of them stand before the first that differs.
_SHOWN, _BEFORE = 80, 30


def moved(earlier: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[tuple[str, str, list[tuple[str, str]]]]:
    """Yield step, file and its differences, of all that differ between the outcomes of a set."""
    for step in dict.fromkeys([*earlier, *now]):
        one, other = earlier.get(step, {}), now.get(step, {})
        for file in dict.fromkeys([*one, *other]):
            if file not in one or file not in other:
                yield step, file, [("", _only(file in one))]
            elif found := list(differences(one[file], other[file])):
                yield step, file, found


def differences(one: Any, other: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield every path at which two JSON values differ, with both values, in the order of the first."""
    if isinstance(one, dict) and isinstance(other, dict):
        for name in dict.fromkeys([*one, *other]):
            here = f"{path}/{name}" if path else name
            if name not in one or name not in other:
                yield here, _only(name in one)
            else:
                yield from differences(one[name], other[name], here)
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, pair in enumerate(zip(one, other, strict=True)):
            yield from differences(*pair, f"{path}/{number}" if path else str(number))
    elif json.dumps(one) != json.dumps(other):
        yield path, _change(one, other)


def _only(earlier: bool) -> str:
    return f"only in {'the earlier commit' if earlier else 'this tree'}"


def _change(one: Any, other: Any) -> str:
    """Return both values, from a little before the place where they part, and the ratio of numbers."""
    was, now = (json.dumps(value, ensure_ascii=False) for value in (one, other))
    parts = next((k for k, (a, b) in enumerate(zip(was, now, strict=False)) if a != b), min(len(was), len(now)))
    start = max(parts - _BEFORE, 0)
    shown = (f"{'...' * bool(start)}{x[start : start + _SHOWN]}{'...' * (len(x) > start + _SHOWN)}" for x in (was, now))
    numbers = all(isinstance(value, float | int) and not isinstance(value, bool) for value in (one, other))
    return " → ".join(shown) + (f" ({other / one - 1.0:+.2g})" if numbers and one else "")
