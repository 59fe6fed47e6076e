"""The section `bounds` of docs/results.md."""

from __future__ import annotations

from typing import Any

from results import table

__all__ = ["AIM", "section"]

AIM = 1.2  # largest quotient of bound and count that was set as a goal
_HEAD = """## The most instructions of each function (`python -m bench docs --only bounds`)

*Bound*: that no call exceeds, from the object code: the graph of its blocks with all that it calls, loops bounded by
the sizes of the table, solved as a linear program (`gen/gyrotc/verify/bounds.py`). *Counted*: the most of {calls} calls
in QEMU that were made to take the longest ways (`bench/counted.c`). No count exceeds its bound; {within} of {all}
bounds are within {aim} of the count, the others in bold. What separates them: corrections in libgcc's 64-bit division
that its divisor never needs (`angle`); a loop over 32 bits for uncertainties that no table has (`rezero`); channels
that are lost one after the other, and blocks that end in the same call (`missed`, `sample`, `sample_at`). Instructions are
not cycles: what an instruction costs is the core's and its memory's. float32 on the M3 is software and has no bound
here.

`filter` is the table of `examples/nav_loop` with a constant that a rest may move, `terms` has a memory, a play, a
warm-up and an auxiliary channel.
"""
_COLUMNS = ("function", "bound ", "counted ", "bound ÷ counted ")


def section(result: dict[str, Any]) -> str:
    """The text and a table for each model, core and arithmetic."""
    rows = result["rows"]
    within = sum(row["bound"] <= AIM * row["counted"] for row in rows)
    parts = [_HEAD.format(calls=sum(r["calls"] for r in rows), within=within, all=len(rows), aim=AIM)]
    kinds = dict.fromkeys((r["model"], r["core"], r["numeric"]) for r in rows)
    for kind in kinds:
        own = [r for r in rows if (r["model"], r["core"], r["numeric"]) == kind]
        parts += [f"### {', '.join(kind)}\n", table(_COLUMNS, [_row(r) for r in own])]
    return "\n".join(parts)


def _row(row: dict[str, Any]) -> tuple[str, ...]:
    quotient = row["bound"] / row["counted"]
    text = f"{quotient:.3f}" if quotient <= AIM else f"**{quotient:.3f}**"
    return f"`{row['function']}`", str(row["bound"]), str(row["counted"]), text
