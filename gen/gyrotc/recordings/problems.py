"""Where problems go: `load` stops at the first one, `check` collects them all."""

from __future__ import annotations

from ..common.errors import InputError
from .records import Mark

__all__ = ["Problems"]


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
        """Keeps the problem, and by its text the rows that it is about.

        Raises:
            InputError: The problem itself, if problems are not collected.
        """
        if not self._collect:
            raise problem
        self.found.append(problem)
        self.marks[str(problem)] = marks

    def __len__(self) -> int:
        return len(self.found)
