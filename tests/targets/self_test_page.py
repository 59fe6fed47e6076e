"""The section `self-test` of docs/results.md."""

from __future__ import annotations

from typing import Any

from results import table

_HEAD = """## Self-test against builds that break float32 (`make targets`)

{tables} emitted tables, every other one with terms, under flags that break the arithmetic: of how many the results
differ from those of the right build in any bit, how many of these `gtc_f32_check` refuses, and how many it refuses
whose results happen to be right. None that differs may pass. Where no result differs, the flag changes nothing there
and nothing is to be caught; *does not compile*: the runtime says in an `#error` that it needs IEEE arithmetic.
"""


def section(result: dict[str, Any]) -> str:
    """The section as text."""
    rows = [_row(r) for r in result["builds"]]
    head = [
        "build",
        "flags",
        "results differ ",
        "of them refused ",
        "refused besides ",
        "passed though wrong ",
    ]
    return _HEAD.format(tables=result["tables"]) + "\n" + table(head, rows)


def _row(r: dict[str, Any]) -> list[object]:
    flags = f"`{r['flags']}`"
    if r["differ"] is None:
        return [r["build"], flags, "does not compile", "-", "-", "-"]
    wrong = r["differ"] - r["refused"]
    return [
        r["build"],
        flags,
        r["differ"],
        r["refused"],
        r["refused_besides"],
        f"**{wrong}**" if wrong else 0,
    ]
