"""The section `kills` of docs/results.md."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "py"))

from results import table, write

_HEAD = """## Jobs that are killed (`make kills`)

Jobs that end by a signal (KILL, TERM, INT), or that the disk lets down (EIO; ENOSPC from then on), at one of their
calls that change a file; commands also by a signal at a random time, `fleet` also in the processes that it starts.
Wrong is a result that is neither the earlier one nor the new one to the byte, a summary of a fleet that says of a
gyro what its result does not hold, anything that is left after the next job (temporary files included; after TERM
and INT: by the job itself), a traceback, and a next job that fails. Seed {seed}; {ended:,} jobs ended, {wrong} wrong.
"""
_ACTIONS = ("KILL", "TERM", "INT", "EIO", "ENOSPC")


def section(result: dict[str, Any]) -> str:
    """The section as text."""
    rows = []
    for name, counted in result["counts"].items():
        rows.append([name, counted.get("calls", "-"), *(counted.get(action, 0) for action in _ACTIONS)])
    commands = result["counts"].get("commands", {})
    named = {name: n for name, n in sorted(commands.items()) if name not in _ACTIONS}
    parts = [
        _HEAD.format(**result),
        table(["what", "calls ", *(f"{action} " for action in _ACTIONS)], rows),
        "Every call of the five ways of writing (a folder as a whole, one entry, several entries, a part in a folder,\n"
        "a file) is tried with each action; where names cannot be exchanged, too. Commands:\n",
        table(["command", "ended "], [[f"`{name}`", n] for name, n in named.items()]),
    ]
    return "\n".join(parts)


def write_page(docs: Path, result: dict[str, Any]) -> None:
    """Keeps what was found, and makes the section."""
    write(docs, "kills", result, section)
