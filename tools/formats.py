"""Writes the tables of docs/FORMAT.md from the classes of results.

`make formats` runs it; tests/py/test_result_forms.py holds what is there against the classes. With `--check` nothing is
written, and the exit status is 1 where something differs.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from gyrotc.cli.schemas import KINDS
from gyrotc.results.describe import tables

ROOT = Path(__file__).resolve().parents[1]
FORMAT = ROOT / "docs" / "FORMAT.md"

TOLD_ABOVE = {"next-run": "lot-plan", "release": "limits", "entry": "fleet", "verify-axes": "verify"}
"""Results whose objects are those of a result above them."""


def made() -> str:
    """The page with its tables."""
    text = FORMAT.read_text("utf-8")
    for name, kind in KINDS.items():
        if name == "model":  # written by hand
            continue
        table = tables(kind, [KINDS[above] for above in [TOLD_ABOVE.get(name)] if above])
        block = f"<!-- fields of {name}: made by `make formats` -->\n\n{table}\n<!-- end of {name} -->"
        pattern = re.compile(rf"<!-- fields of {name}:.*?<!-- end of {name} -->", re.DOTALL)
        if not pattern.search(text):
            raise SystemExit(f"{FORMAT} has no place for the fields of {name}")
        text = pattern.sub(lambda _, block=block: block, text)
    return text


def main() -> int:
    text = made()
    if "--check" in sys.argv:
        return 1 if FORMAT.read_text("utf-8") != text else 0
    FORMAT.write_text(text, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
