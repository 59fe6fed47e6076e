"""What campaigns leave: everything in build/results/, what pages quote in docs/results/summary.json, and the sections
of docs/results.md that are made from it. Nobody edits them by hand.

`pytest ... --results docs` writes them when every test passed.
"""

from __future__ import annotations

import json
import platform
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from gyrotc.paper.summary import keep, recorded, shortened

__all__ = ["Results", "filled", "machine", "recorded", "table", "write"]

_HEAD = "# Results\n\nFigures that programs wrote; nobody edits them by hand.\n"


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


def filled(page: str | None, name: str, section: str) -> str:
    """The page (None: a new one) with the section between the marks `name` replaced, or added at its end."""
    marks = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
    text = _HEAD if page is None else page
    if not marks.search(text):
        text = f"{text.rstrip()}\n\n<!-- {name} -->\n<!-- /{name} -->\n"
    return marks.sub(lambda found: found[1] + section + found[2], text)


def write(
    docs: Path,
    name: str,
    result: Any,
    section: Callable[[Any], str],
    quoted: Callable[[Any], Any] = lambda result: result,
) -> None:
    """Keeps the result, and makes the section `name` of `docs/results.md` from what is quoted of it.

    Args:
        docs: The folder docs.
        name: Of the campaign.
        result: Everything that it found; goes to `build/results/<name>.json`, which is not tracked.
        section: The text, from what `quoted` leaves.
        quoted: What of the result stands in `docs/results/summary.json`, in as many digits as the section needs.
    """
    whole = docs.parent / "build" / "results" / f"{name}.json"
    whole.parent.mkdir(parents=True, exist_ok=True)
    whole.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    told = json.loads(json.dumps(quoted(result)))
    keep(docs, name, shortened(told, section))
    page = docs / "results.md"
    before = page.read_text(encoding="utf-8") if page.exists() else None
    page.write_text(filled(before, name, section(recorded(docs, name))), encoding="utf-8")
