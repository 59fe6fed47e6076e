"""The section `sigma` of docs/results.md."""

from __future__ import annotations

import math
from typing import Any

from results import table

__all__ = ["section"]

_HEAD = """## How well the uncertainty of corrections holds (`python -m bench docs --only sigma`)

True bias less correction, in units of the 1 sigma of the same moment's snapshot, on {gyros} simulated gyros that
nothing was tuned on (seeds from 100000 on), every block of 10 s. *Held*: outages of 10 s to 5 min at random places;
*warming*: started anew at random places; *fallen back*: outages of up to 10 min. Behind each figure its standard error,
gyros counted as independent: errors of one gyro's blocks are not. A normal error has 68.3 %, 95.4 % and 1; aimed at
were 68 and 95 % to 2 points, and 0.9 to 1.1.

*By gyro*: the shares of normal errors of which each gyro's have the RMS that its own have; and that RMS over 1 sigma,
which 10 and 90 % of the gyros stay below. If all gyros had the RMS of all, {alike:.1f} % of all blocks would lie within
1 sigma; with the RMS of each it is {by_gyro:.1f} %: that much is a mixture of gyros whose sigma is too large and too
small. An error of a map is a smooth curve with about a dozen free values, whose size a few runs do not tell better.
Where fewer lie within 1 sigma, sigma is too small. *Near the edge*: the temperature is less than 1 C
beyond the envelope, or only its slope is beyond; a cell of the grid has the mean variance of the samples in it, and
the variance at the edge of the last cell is larger.
"""
_COST = """### Instructions of a snapshot

The table of `examples/nav_loop`, counted in QEMU at the level of each core; the map is not evaluated. Bits of sigma are
part of the board test on every target.
"""
_COLUMNS = (
    "state",
    "gyros ",
    "blocks ",
    "within 1 sigma, % ",
    "within 2 sigma, % ",
    "squared ",
    "by gyro: 1, 2 sigma, % ",
    "RMS ",
)


def section(result: dict[str, Any]) -> str:
    """The text and tables."""
    every = result["together"]["states"]["all"]
    parts = [
        _HEAD.format(
            gyros=result["together"]["gyros"],
            alike=100.0 * math.erf(math.sqrt(0.5 / every["squared"])),
            by_gyro=100.0 * every["normal_1"],
        ),
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
            f"{100.0 * f['normal_1']:.1f}, {100.0 * f['normal_2']:.1f}",
            f"{f['low']:.2f} ... {f['high']:.2f}",
        )
        for state, f in states.items()
    ]
