"""The section `sigma` of docs/results.md, from docs/results/sigma.json."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "py"))

from results import table

__all__ = ["section"]

_HEAD = """## How well the uncertainty of corrections holds (`python -m bench docs --only sigma`)

True bias less correction, in units of the 1 sigma of the same moment's snapshot, on {gyros} simulated gyros that
nothing was tuned on (seeds from 100000 on), every block of 10 s. *Held*: outages of 10 s to 5 min at random places;
*warming*: started anew at random places; *fallen back*: outages of up to 10 min. Behind each figure its standard error,
gyros counted as independent: errors of one gyro's blocks are not. A normal error has 68.3 %, 95.4 % and 1; aimed at
were 68 and 95 % to 2 points, and 0.9 to 1.1. Where more than 68 % lie within 1 sigma while the square is near 1, errors
are a mixture: sigma is one number for a cell of the envelope and for what few runs tell of a gyro, so that the middle
is fuller and the tails are longer than of one normal error. Where less do, sigma is too small.
"""
_COST = """### Instructions of a snapshot

The table of `examples/nav_loop`, counted in QEMU at the level of each core; the map is not evaluated. Bits of sigma are
part of the board test on every target.
"""
_COLUMNS = ("state", "gyros ", "blocks ", "within 1 sigma, % ", "within 2 sigma, % ", "squared ")


def section(result: dict[str, Any]) -> str:
    """The text and tables."""
    parts = [
        _HEAD.format(gyros=result["together"]["gyros"]),
        table(_COLUMNS, _rows(result["together"]["states"])),
    ]
    for row in result["campaigns"]:
        parts += [
            f"### {row['campaign'].capitalize()}, {row['gyros']} gyros",
            table(_COLUMNS, _rows(row["states"])),
        ]
    cost = [(r["core"], r["numeric"], f"{r['in_force']:.0f}", f"{r['held']:.0f}") for r in result["cost"]]
    parts += [_COST, table(("core", "arithmetic", "in force ", "held "), cost)]
    return "\n".join(parts)


def _rows(states: dict[str, dict[str, float]]) -> list[tuple[str, ...]]:
    return [
        (
            state,
            f"{f['gyros']:.0f}",
            f"{f['blocks']:.0f}",
            f"{100.0 * f['within_1']:.1f} ± {100.0 * f['within_1_se']:.1f}",
            f"{100.0 * f['within_2']:.1f} ± {100.0 * f['within_2_se']:.1f}",
            f"{f['squared']:.2f} ± {f['squared_se']:.2f}",
        )
        for state, f in states.items()
    ]
