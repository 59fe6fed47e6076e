"""The section `mutants` of docs/results.md."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "py"))

from results import recorded, table, write

_HEAD = """## Faults planted in gyrotc (`make mutants`)

Each is a line of `gen/gyrotc/` that reads otherwise (`tests/mutants/faults.toml`). In what emits, the changed generator
emits a model; who objects first? The generator itself (a rule of its own on what it makes), `tools/check_table.py`
(standard library, nothing of gyrotc), or `gyrotc verify` of the changed generator (compiled code against its reference,
one target). Elsewhere tests of `tests/py` run on the changed package; which one fails first?
"""
_WHO = ("generator", "check_table", "verify", "test")


def section(result: dict[str, Any]) -> str:
    """The section as text."""
    mutants = result["mutants"]
    packages: dict[str, list[str | None]] = {}
    for m in mutants:
        packages.setdefault(f"`{m['file'].split('/')[0]}`", []).append(m["seen_by"])
    packages["all"] = [m["seen_by"] for m in mutants]
    counts = [
        [name, len(seen), *(seen.count(who) for who in (*_WHO, None)), _rate(seen)] for name, seen in packages.items()
    ]
    rows = [
        [
            m["name"],
            f"`{m['file']}`",
            m["model"],
            m["seen_by"] or "**nobody**",
            _cell(m["reported"]),
        ]
        for m in mutants
    ]
    return "\n".join(
        [
            _HEAD,
            table(["package", "faults ", *(f"{who} " for who in _WHO), "nobody ", "seen "], counts),
            table(["fault", "in", "model", "seen by", "reported"], rows),
        ]
    )


def _rate(seen: Sequence[str | None]) -> str:
    return f"{100.0 * sum(who is not None for who in seen) / len(seen):.0f} %"


def _short(text: str) -> str:
    """The first words of an objection."""
    return text if len(text) <= 110 else text[:107] + "..."


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;")


def write_page(docs: Path, found: Sequence[dict[str, Any]], names: Sequence[str]) -> None:
    """The section: what was found now, and of the other faults what was found before.

    Args:
        docs: Folder of the pages.
        found: Results of the faults that were tried.
        names: All faults, in order.
    """
    before = (recorded(docs, "mutants") or {"mutants": []})["mutants"]
    by_name = {m["name"]: m for m in [*before, *found]}
    result = {"mutants": [by_name[name] for name in names if name in by_name]}
    write(docs, "mutants", result, section, quoted)


def quoted(result: dict[str, Any]) -> dict[str, Any]:
    """What the page says of each fault."""
    names = ("name", "file", "model", "seen_by", "survives")
    return {
        "mutants": [
            {name: m[name] for name in names if name in m}
            | {"reported": _short(m["reported"] or m.get("survives", ""))}
            for m in result["mutants"]
        ]
    }
