"""What an import tells: the proposal with its reasons, the first rows before and after, what was written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .plan import Choice, ImportPlan
from .rows import NAMES, ImportedRows
from .tables import LoggerFile

__all__ = ["preview", "proposal", "summary"]

_NATIVE = {"time": "s", "temperature": "C", "rate": "deg/h"}
_MOST_NAMES = 12  # that are listed in a line of a terminal


def proposal(file: LoggerFile, plan: ImportPlan, rows: ImportedRows) -> Iterator[str]:
    """How a file is read, a line for each column."""
    table = f", table {plan.main.name}" if plan.main.name else ""
    yield f"{file.path.name}: {file.format}{table}"
    if plan.time:
        names = " + ".join(choice.column.name for choice in plan.time)
        form = f"stamps {rows.clock.form}" if rows.clock.form else _unit_words(plan.time[0])
        yield _line("time", names, form, _why(plan.time[0]))
    else:
        yield _line("time", "-", f"{plan.rate_hz:g} rows per second", plan.why_rate)
    for choice in (plan.temperature, *plan.values, *plan.channels):
        yield _line(choice.role, choice.source, _unit_words(choice), _why(choice))
    if rows.clock.needs_zone:
        yield "  the stamps have no zone: when the run started is left out (--time-zone Europe/Berlin would say it)"
    if plan.left_out:
        more = f" and {len(plan.left_out) - _MOST_NAMES} more" if len(plan.left_out) > _MOST_NAMES else ""
        yield f"  left out: {', '.join(plan.left_out[:_MOST_NAMES])}{more} ([channels] of the map takes them)"
    for note in plan.main.notes:
        yield f"  {note}"


def preview(rows: ImportedRows) -> Iterator[str]:
    """The first rows as the file has them and as they become."""
    for k in range(min(3, len(next(iter(rows.raw.values()), [])))):
        before = ", ".join(f"{name} {values[k]}" for name, values in rows.raw.items())
        after = ", ".join(f"{name} {values[k]:.10g}" for name, values in rows.first_rows.items())
        yield f"  row {k + 1}: {before or '-'}  ->  {after}"


def summary(out: Path, entries: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """What was written."""
    for entry in entries:
        cells = entry["evidence"].cells
        low, high = entry["evidence"].temperature_c
        period = (cells[-1, 0] - cells[0, 0]) / max(entry["rows"] - 1, 1)
        means = ", ".join(f"{mean:.4g}" for mean in np.atleast_1d(cells[:, 2:].mean(axis=0)))
        left = "".join(f"; {count} left out: {reason}" for reason, count in entry["left_out"].items())
        yield (
            f"{out / entry['file']}: {entry['rows']} rows of about {period:.4g} s, {low:.4g} ... {high:.4g} C, "
            f"mean {means} {'pulses a row' if entry['pulses'] else 'deg/h'}{left}"
        )
        for text in entry["trusted"]:
            yield f"  units are trusted: {text}"
    yield f"{out / 'map.toml'}: reads the next file of this logger: gyrotc import FILE --map map.toml --out ..."


def _line(role: str, source: str, unit: str, why: str) -> str:
    return f"  {role:<12} {source:<24} {unit:<24} {why}"


def _unit_words(choice: Choice) -> str:
    kind = "rate" if choice.role.startswith("rate") else choice.role
    if choice.role in NAMES or choice.role == "time":
        return f"{choice.unit} -> {_NATIVE[kind]}" if choice.unit and kind in _NATIVE else ""
    return choice.unit or ""


def _why(choice: Choice) -> str:
    from .names import meaning

    column = choice.column
    if choice.unit is None:
        return choice.why
    if choice.unit == column.unit:
        return f"{choice.why}; the unit: {column.why or 'in the file'}"
    in_name = meaning(column.name, None, choice.table.name)
    if choice.unit == in_name.unit and in_name.why:
        return f"{choice.why}; the unit: {in_name.why}"
    return f"{choice.why}; the unit: as stated"
