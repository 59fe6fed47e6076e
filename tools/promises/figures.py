"""Figures in documents come from docs/results/summary.json by name: `1.0040<!--= bench/accuracy/...; .4f -->`.

The comment behind a figure names its place in the summary, the format of Python, and, where the place has a `*`, what
to take of all values (`max`, `min`, `sum`, `median`, `mean`). A step `key=value` of a place selects the entry of a
list that has it. `python tools/promises/figures.py` writes the figures; `tools/promises figures` says which differ.
"""

from __future__ import annotations

import json
import re
import statistics
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import ages

_MARK = re.compile(r"([^\s|(*]+)(<!--= ([^;>]+); ([^;>]+?)(?:; (max|min|sum|median|mean))? -->)")
_OF_ALL: dict[str, Callable[[list[float]], float]] = {
    "max": max,
    "min": min,
    "sum": sum,
    "median": statistics.median,
    "mean": statistics.fmean,
}


def _values(record: Any, steps: list[str]) -> list[Any]:
    """Every value at a place."""
    if not steps:
        return [record]
    step, *rest = steps
    key, equal, value = step.partition("=")
    if isinstance(record, dict) and equal and step not in record:
        chosen = [record] if str(record[key]) == value else []
    elif isinstance(record, dict):
        chosen = list(record.values()) if step == "*" else [record[step]]
    elif step == "*":
        chosen = record
    elif equal:
        chosen = [entry for entry in record if str(entry[key]) == value]
    else:
        chosen = [record[int(step)]]
    return [value for entry in chosen for value in _values(entry, rest)]


def shown(summary: Any, place: str, form: str, of_all: str | None = None) -> str:
    """A figure as a page shows it.

    Args:
        summary: The record of all campaigns.
        place: Steps between slashes.
        form: Format of Python.
        of_all: What to take where there are several values.

    Raises:
        KeyError, IndexError, ValueError: There is no such place, or it has no single value.
    """
    values = _values(summary, place.strip().split("/"))
    if of_all is None and len(values) != 1:
        raise ValueError(f"{len(values)} values")
    return format(values[0] if of_all is None else _OF_ALL[of_all](values), form.strip())


def documents(root: Path) -> list[Path]:
    """Pages that may hold figures."""
    return sorted({*root.glob("README.md"), *(root / "docs").glob("*.md")})


def filled(text: str, summary: Any) -> str:
    """A page with its figures as the summary has them."""
    return _MARK.sub(lambda m: shown(summary, m[3], m[4], m[5]) + m[2], text)


def stale_figures(root: Path) -> Iterator[str]:
    """Figures that are not those of the summary, and names that lead nowhere."""
    summary = json.loads((root / "docs" / "results" / "summary.json").read_text("utf-8"))
    for page in documents(root):
        for number, line in enumerate(page.read_text("utf-8").splitlines(), 1):
            for mark in _MARK.finditer(line):
                where = f"{page.relative_to(root)}:{number}: {mark[1]}"
                try:
                    right = shown(summary, mark[3], mark[4], mark[5])
                except (KeyError, IndexError, ValueError, TypeError) as error:
                    yield f"{where}: no single figure at {mark[3].strip()} ({error})"
                    continue
                if right != mark[1]:
                    yield f"{where} is {right} in the summary"


def write(root: Path) -> None:
    """Fills every page."""
    summary = json.loads((root / "docs" / "results" / "summary.json").read_text("utf-8"))
    for page in documents(root):
        before = page.read_text("utf-8")
        after = ages.filled(root, filled(before, summary))
        if after != before:
            page.write_text(after, "utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[2])
