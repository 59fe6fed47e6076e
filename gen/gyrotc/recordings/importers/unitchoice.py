"""The unit of each column: stated, in the file, or asked for; one that stands nowhere is noted, never guessed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from ...common.errors import InputError
from ..units import UnitError, conversion
from .names import meaning, split_unit
from .tables import Column, LoggerTable

__all__ = ["OPTIONS", "Ask", "Units", "asked", "said"]

Ask = Callable[[str], str | None]
"""Asks a person on a terminal; None where there is none."""


OPTIONS = {"time": "--time-unit", "temperature": "--temperature-unit", "rate": "--rate-unit"}
_EXAMPLES = {"time": "s, ms, us, min, d", "temperature": "degC, K, degF", "rate": "deg/h, deg/s, rad/s"}


class Units:
    """Units of the three kinds: stated, in the file, or asked for."""

    def __init__(self, file: str, stated: Mapping[str, str], ask: Ask, missing: list[str]) -> None:
        self._file, self._stated, self._ask, self._missing = file, stated, ask, missing
        self._asked: dict[str, str] = {}

    def of(self, kind: str, column: Column, table: LoggerTable) -> str:
        """The unit of a column of a kind; empty (and noted as missing) where it stands nowhere."""
        if kind in self._stated:
            return self._checked(kind, self._stated[kind], OPTIONS[kind])
        _, in_name, how = split_unit(column.name)
        in_file = column.unit or meaning(column.name, None, table.name).unit
        if in_file is None and how.startswith(("in brackets", "after")):
            in_file = in_name
        if in_file is not None:
            try:
                conversion(in_file, kind)
            except UnitError:
                found = f"the file gives it in {in_file!r}, which is no {kind}"
                expected = (
                    f"{OPTIONS[kind]} with one of {_EXAMPLES[kind]}, or another column by --column {kind}=..."
                )
                raise InputError(f"{self._file}, column {column.name}", found, expected) from None
            return in_file
        if kind not in self._asked:
            answer = self._ask(
                f"{self._file}: unit of the {kind} in column {column.name!r} ({_EXAMPLES[kind]})"
            )
            if answer:
                self._asked[kind] = self._checked(kind, answer, "the answer")
        if kind not in self._asked:
            self._missing.append(f"{kind}\t{column.name}")
            return ""
        return self._asked[kind]

    def _checked(self, kind: str, unit: str, where: str) -> str:
        try:
            conversion(unit, kind)
        except UnitError as error:
            raise InputError(where, str(error), f"one of {_EXAMPLES[kind]}") from error
        return unit


def said(missing: Sequence[str]) -> Iterator[str]:
    seen = set()
    for one in missing:
        kind, column = one.split("\t")
        if kind not in seen:
            seen.add(kind)
            yield f"no unit of the {kind} in column {column!r}"


def asked(missing: Sequence[str]) -> Iterator[str]:
    for one in missing:
        kind = one.split("\t")[0]
        yield f'{OPTIONS[kind]} "..." ({_EXAMPLES[kind]})'
