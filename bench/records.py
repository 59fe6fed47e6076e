"""Records of what campaigns measured, and the figures of pages that are taken from them.

Each campaign has one record, docs/results/<name>.json, which nobody edits by hand. A figure of a page is followed by a
comment that names its place, `35<!--= rows/events/name=dropout/named; d -->`: the record, the steps to the value, and a
format of Python. A step `key=value`, or several with `&` between them, selects the one entry of a list that has these
values: a place by number would name another entry after the next campaign.
"""

from __future__ import annotations

import json
import platform
import re
import subprocess
from collections.abc import Iterator
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
#: Significant digits of a number in a record: more than any page prints.
_DIGITS = 6
#: Characters of a line of a record.
_WIDTH = 500
_MARK = re.compile(r"([^\s|(*]+)(<!--= ([^>]+); ([^;>]+?) -->)")

Record = dict[str, Any]


def machine() -> str:
    """Return processor, number of threads and system."""
    info = Path("/proc/cpuinfo")
    names = re.findall(r"^model name\s*: (.+)$", info.read_text(), re.MULTILINE) if info.exists() else []
    return f"{names[0] if names else platform.processor()}, {max(len(names), 1)} threads, {platform.system()}"


def measured_with() -> dict[str, str]:
    """Return the commit of the sources (with `+` if files differ from it), date, machine and Python."""
    described = subprocess.run(
        ["git", "-C", str(ROOT), "describe", "--always", "--dirty=+", "--exclude=*"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return {
        "commit": described.stdout.strip() or "unknown",
        "date": datetime.now(timezone.utc).strftime("%Y-%m-%d"),
        "machine": f"{machine()}, Python {platform.python_version()}",
    }


def read_record(docs: Path, name: str) -> Record | None:
    """Return a record; None if it was never measured."""
    path = docs / "results" / f"{name}.json"
    return dict(json.loads(path.read_text("utf-8"))) if path.exists() else None


def write_record(docs: Path, name: str, record: Record) -> None:
    """Replace a record, and fill the figures of all pages."""
    path = docs / "results" / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(_lines(record)) + "\n", "utf-8")
    fill(docs)


def rounded(value: Any, digits: int = _DIGITS) -> Any:
    """Return a record with its numbers to so many significant digits."""
    if isinstance(value, dict):
        return {key: rounded(inner, digits) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(inner, digits) for inner in value]
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value


def _lines(value: Any, indent: str = "", before: str = "", after: str = "") -> Iterator[str]:
    """Yield JSON with an entry on each line that does not fit whole into one."""
    flat = json.dumps(value, ensure_ascii=False)
    inside = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    is_short = len(indent + before + flat + after) <= _WIDTH
    if is_short or not any(isinstance(inner, dict | list) for inner in inside):
        yield indent + before + flat + after
        return
    brackets = "{}" if isinstance(value, dict) else "[]"
    yield indent + before + brackets[0]
    entries = value.items() if isinstance(value, dict) else ((None, inner) for inner in value)
    for k, (key, inner) in enumerate(entries, 1):
        head = "" if key is None else f"{json.dumps(key, ensure_ascii=False)}: "
        yield from _lines(inner, indent + " ", head, "," if k < len(value) else "")
    yield indent + brackets[1] + after


def fill(docs: Path) -> None:
    """Write into every page the figures that it takes from records.

    Raises:
        KeyError: a page names a place that no record has.
    """
    for page in sorted({*docs.parent.glob("README.md"), *docs.glob("*.md")}):
        before = page.read_text("utf-8")
        after = _MARK.sub(lambda mark: figure(docs, mark[3], mark[4]) + mark[2], before)
        if after != before:
            page.write_text(after, "utf-8")


def figure(docs: Path, place: str, form: str) -> str:
    """Return the value at a place of a record as a page prints it.

    Raises:
        KeyError: there is no such place.
    """
    name, *steps = place.strip().split("/")
    value: Any = read_record(docs, name)
    try:
        for step in steps:
            value = _inside(value, step)
        return format(value, form.strip())
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise KeyError(f"{place.strip()} is no value of a record in {docs / 'results'}") from error


def _inside(value: Any, step: str) -> Any:
    if isinstance(value, dict):
        return value[step]
    if "=" in step:
        wanted = [condition.split("=", 1) for condition in step.split("&")]
        (entry,) = (entry for entry in value if all(str(entry[key]) == text for key, text in wanted))
        return entry
    entry = value[int(step)]
    if isinstance(entry, dict):
        raise KeyError(step)
    return entry
