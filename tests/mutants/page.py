"""The section `mutants` of docs/results.md, from docs/results/mutants.json."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "py"))

from results import table, write

__all__ = ["section", "write_page"]

_HEAD = """## Faults planted in the generator (`make mutants`)

Each is a line of `gen/gyrotc/` that reads otherwise (`tests/mutants/faults.toml`). The changed generator emits a model;
who objects first? The generator itself (a rule of its own on what it makes), `tools/check_table.py` (standard library,
nothing of gyrotc), or `gyrotc verify` of the changed generator (compiled code against its reference, one target).
{n} faults: {generator} by the generator, {check_table} by `check_table`, {verify} by `verify`, {nobody} by nobody.
"""


def section(result: dict[str, Any]) -> str:
    """The section as text."""
    mutants = result["mutants"]
    seen = [m["seen_by"] for m in mutants]
    counts = {who: seen.count(who) for who in ("generator", "check_table", "verify")}
    rows = [
        [m["name"], f"`{m['file']}`", m["model"], m["seen_by"] or "**nobody**", _told(m["told"])]
        for m in mutants
    ]
    return "\n".join(
        [
            _HEAD.format(n=len(mutants), nobody=seen.count(None), **counts),
            table(["fault", "in", "model", "seen by", "told"], rows),
        ]
    )


def _told(text: str) -> str:
    """The first words of an objection, as a cell of a table."""
    short = text if len(text) <= 110 else text[:107] + "..."
    return short.replace("|", "\\|").replace("<", "&lt;")


def write_page(docs: Path, result: dict[str, Any]) -> None:
    """`docs/results/mutants.json` and the section."""
    write(docs, "mutants", result, section)
