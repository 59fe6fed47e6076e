"""Where problems go: `load` stops at the first one, `check` collects them all."""

from __future__ import annotations

from ..errors import InputError

__all__ = ["Problems"]


class Problems:
    """Problems found so far.

    Args:
        collect: False: `add` raises what it is given.
    """

    def __init__(self, *, collect: bool) -> None:
        self._collect = collect
        self.found: list[InputError] = []

    def add(self, problem: InputError) -> None:
        """Keeps the problem.

        Raises:
            InputError: The problem itself, if problems are not collected.
        """
        if not self._collect:
            raise problem
        self.found.append(problem)

    def __len__(self) -> int:
        return len(self.found)
