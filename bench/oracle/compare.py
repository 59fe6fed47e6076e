"""Differences between the outcomes of two runs of a set."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

#: Characters of a value that are shown.
_SHOWN = 80


def moved(earlier: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Yield step, place and change of everything that differs between the outcomes of a set."""
    for step in dict.fromkeys([*earlier, *now]):
        for place, change in differences(earlier.get(step, {}), now.get(step, {})):
            yield step, place, change


def differences(one: Any, other: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield every path at which two JSON values differ, with both values, in the order of the first."""
    if isinstance(one, dict) and isinstance(other, dict):
        for name in dict.fromkeys([*one, *other]):
            here = f"{path}/{name}" if path else name
            if name not in one or name not in other:
                yield here, f"only in {'the earlier commit' if name in one else 'this tree'}"
            else:
                yield from differences(one[name], other[name], here)
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, pair in enumerate(zip(one, other, strict=True)):
            yield from differences(*pair, f"{path}/{number}")
    elif json.dumps(one) != json.dumps(other):
        yield path, f"{_shown(one)} → {_shown(other)}{_ratio(one, other)}"


def _ratio(one: Any, other: Any) -> str:
    numbers = all(isinstance(value, float | int) and not isinstance(value, bool) for value in (one, other))
    return f" ({other / one - 1.0:+.2g})" if numbers and one else ""


def _shown(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _SHOWN else text[:_SHOWN] + " ..."
