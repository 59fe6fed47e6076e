"""What the tests of a session found, for the records of `make targets` and `make prove`."""

from __future__ import annotations

from typing import Any


class Results:
    """Lists of records by name."""

    def __init__(self) -> None:
        self.lists: dict[str, list[dict[str, Any]]] = {}

    def add(self, name: str, record: dict[str, Any]) -> None:
        self.lists.setdefault(name, []).append(record)
