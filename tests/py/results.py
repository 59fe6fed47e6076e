"""What campaigns leave: everything in build/results/, what pages quote in docs/results/summary.json, and the figures of
pages that are taken from it by name. Nobody edits them by hand.

`pytest ... --results docs` writes them when every test passed.
"""

from __future__ import annotations

import json
import platform
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from gyrotc.paper.page import keep, recorded, shortened

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools" / "promises"))

import ages
import figures

ROOT = Path(__file__).resolve().parents[2]


class Results:
    """What the tests of a session found: lists of records by name."""

    def __init__(self) -> None:
        self.lists: dict[str, list[dict[str, Any]]] = {}

    def add(self, name: str, record: dict[str, Any]) -> None:
        self.lists.setdefault(name, []).append(record)


def machine() -> str:
    """Processor and system."""
    info = Path("/proc/cpuinfo")
    names = re.findall(r"^model name\s*: (.+)$", info.read_text(), re.MULTILINE) if info.exists() else []
    return f"{names[0] if names else platform.processor()}, {max(len(names), 1)} threads, {platform.system()}"


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table in Markdown; columns whose title ends in a space are aligned to the right."""
    rule = ["---:" if title.endswith(" ") else "---" for title in head]
    lines = [[title.strip() for title in head], rule, *([str(cell) for cell in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def write(
    docs: Path,
    name: str,
    result: Any,
    section: Callable[[Any], str],
    quoted: Callable[[Any], Any] = lambda result: result,
) -> None:
    """Keeps the result, writes its tables to `build/results/<name>.md`, and fills the figures of pages again.

    Args:
        docs: The folder docs.
        name: Of the campaign.
        result: Everything that it found; goes to `build/results/<name>.json`, which is not tracked.
        section: Its tables as text, from what `quoted` leaves.
        quoted: What of the result stands in `docs/results/summary.json`, in as many digits as the section needs.
    """
    whole = docs.parent / "build" / "results" / f"{name}.json"
    whole.parent.mkdir(parents=True, exist_ok=True)
    whole.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    kept = json.loads(json.dumps(quoted(result)))
    keep(docs, name, shortened(kept, section))
    whole.with_suffix(".md").write_text(section(recorded(docs, name)), encoding="utf-8")
    if name in ages.CODE:
        keep(docs, "code", {**(recorded(docs, "code") or {}), name: ages.code_of(ROOT, name)})
    figures.write(docs.parent)
