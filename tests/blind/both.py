"""What a diagnosis must keep on fresh seeds of both worlds: one table, the same questions of either world.

The record holds further figures that one world alone has: limits of detection, parameters, gains, declared noise.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from gyrotc.pages import AFTER, BEFORE, COVERED, HALF, Panel, drawing
from gyrotc.results import write_atomically

from bench.page import Count, ResultsTable, keep
from bench.records import Record, rounded

from . import table as own
from .effects import FAMILY
from .grade import Row, alarmed, family_right, wrong_family
from .other import grade as other
from .table import SAID, Check, proportion, reliability, worse_on_the_exam

RELIABILITY = "reliability.svg"
WORLDS = {"own": ("own world", AFTER), "other": ("other world", BEFORE)}
_SURE, _LEAST = 0.95, 0.01  # of stated probabilities: where a name is sure, and what is kept
_STEEP = 1.2  # exponent of a spectrum from which on flicker noise, 1/f, no longer stands for it
_DETAILS = {"own": own.table, "other": other.table}
_TEXT = """
`gyrotc diagnose` on {recordings} recordings of each of two worlds, with seeds {seeds} that were drawn after the method
was finished. k = d/6, where d is the signal-to-noise ratio of the hidden effect after the best static map is removed.
The own world has the causes of the catalogue, but its own integration, maps, hysteresis and noise. The other world has
heat conduction by finite volumes, relays, ripples, other noise, noise that is declared wrong in half of the recordings,
and effects that are not in the catalogue ("foreign").

![Stated probability of a cause and share that is true, both worlds](reliability.svg)
"""


def _one(row: Row) -> bool:
    return bool(row["stratum"] == "one")


def _strong(row: Row) -> bool:
    return _one(row) and row["k"][0] >= 2.5


def _stratum(name: str) -> Callable[[Row], bool]:
    return lambda row: bool(row["stratum"] == name)


def _steep(row: Row) -> bool:
    return bool(row["stratum"] == "clean" and row.get("alpha", 0.0) > _STEEP)


def _named(row: Row) -> bool:
    return bool(row["named"])


_CHECKS: list[Check] = [
    ("a cause or structure claimed, clean", "≤ 2 %", _stratum("clean"), alarmed, 0.02, "max"),
    ("... of these, in noise steeper than flicker", "≤ 2 %", _steep, alarmed, 0.02, "max"),
    ("a cause named, clean", "≤ 2 %", _stratum("clean"), _named, 0.02, "max"),
    ("foreign given a name", "≤ 10 %", _stratum("foreign"), _named, 0.10, "max"),
    ("family right, k ≥ 2.5", "≥ 95 %", _strong, family_right, 0.95, "min"),
    ("a wrong family named", "≤ 2 %", _one, wrong_family, 0.02, "max"),
    ("broke down", "0", lambda row: True, lambda row: row["verdict"] == "error", 0.0, "max"),
]


def kept(world: str, seed: int, row: Row) -> Row:
    """What is kept of a recording: hidden, answered, how surely; numbers in four digits."""
    k = row["k"] if isinstance(row["k"], list) else [row["k"]] if row["truth"] else []
    said = [one for one in row["said"] if one["p"] >= _LEAST]
    shipped = row if "shipped" in row else row["gain"] or {"shipped": False}
    gained = ("before2", "after2", "noise2", "worse", "surely_worse")
    out = {
        **{"world": world, "seed": seed, "number": row["number"], "stratum": row["stratum"], "truth": row["truth"]},
        **{"k": k, "verdict": row["verdict"], "named": row["named"], "said": said},
        **{
            name: row[name]
            for name in ("kind", "stress", "alpha", "declared", "row_s", "noise", "equivalent")
            if row.get(name)
        },
        "gain": {name: shipped[name] for name in gained if name in shipped} if shipped["shipped"] else None,
    }
    return dict(rounded(out, 4))


def checked(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Every requirement with its count, share and limits, and how often what was stated is true."""
    out: list[dict[str, Any]] = []
    for name, goal, select, hit, bound, kind in _CHECKS:
        out += proportion(name, goal, [hit(r) for r in rows if select(r)], bound, kind)
    sure = [one["true"] for row in rows for one in row["said"] if one["p"] >= _SURE]
    out += proportion("stated with 95 % or more and true", "≥ 95 %", sure, 0.95, "min")
    return out + worse_on_the_exam([row["gain"] for row in rows if row["gain"]]) + reliability(rows)


def tables(rows: Sequence[Row]) -> dict[str, Any]:
    """The table of every world, of all its seeds and of each."""
    out: dict[str, Any] = {}
    for world in WORLDS:
        of = [row for row in rows if row["world"] == world]
        seeds = sorted({row["seed"] for row in of})
        each = {str(seed): checked([row for row in of if row["seed"] == seed]) for seed in seeds}
        out[world] = {"recordings": len(of), "all": checked(of), **each}
    return out


def answers(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    """For every hidden effect, alone and at k >= 1.7 if it is a cause, how often which answer was given."""
    found: dict[str, Counter[str]] = {}
    for row in rows:
        k = row["k"][0] if isinstance(row["k"], list) and row["k"] else row["k"]
        if row["stratum"] == "foreign" or (row["stratum"] == "one" and k >= 1.7):
            found.setdefault(row["truth"][0], Counter())[" + ".join(row["named"]) or row["verdict"]] += 1
    order = [*FAMILY, *sorted(set(found) - set(FAMILY))]
    return {name: dict(found[name].most_common()) for name in order if name in found}


def write_both(docs: Path, head: dict[str, Any], rows: Sequence[tuple[str, int, Row]]) -> None:
    """Keep the tables of all rows, which are given with world and seed, and the diagram of reliability."""
    short = [kept(*row) for row in rows]
    details = {}
    for world, table_of in _DETAILS.items():
        of = [row for name, _, row in rows if name == world]
        details[world] = {"table": table_of(of), "answers": answers(of)}
    record = {**head, "worlds": tables(short), "details": details}
    write_atomically(docs / RELIABILITY, reliability_diagram(record))
    keep(docs, "blind", record)


#: Questions on docs/results.md; in records their names stay.
_WORDS = {
    "a cause or structure claimed, clean": "a cause or structure is claimed in a clean recording",
    "a cause named, clean": "a cause is named in a clean recording",
    "... of these, in noise steeper than flicker": "a cause or structure is claimed in steep noise (1/f^1.2)",
    "foreign given a name": "a foreign effect gets the name of a cause",
    "family right, k ≥ 2.5": "the right family is named, k ≥ 2.5",
    "a wrong family named": "a wrong family is named",
    "broke down": "the command ends with an internal error",
    "stated with 95 % or more and true": "a cause with a stated probability of 95 % or more is true",
    "shipped although worse on the exam": "the extended table is worse than the plain one on test runs",
    "... by more than the exam's noise (95 %)": "... by more than the noise (95 %)",
}


def table(record: Record) -> ResultsTable:
    """Return every question with its answers in both worlds."""
    worlds = record["worlds"]
    text = _TEXT.format(seeds=", ".join(map(str, record["seeds"])), recordings=worlds["own"]["recordings"])
    found = {name: {one["name"]: one for one in of["all"]} for name, of in worlds.items()}
    rows = []
    for name in dict.fromkeys(name for of in found.values() for name in of if not name.startswith(SAID)):
        of_both = [of.get(name) for of in found.values()]
        goal = next(one["goal"] for one in of_both if one)
        rows.append((_WORDS.get(name, name), *(_counted(one) for one in of_both), goal))
    return ResultsTable(text, ("question", *(f"{WORLDS[name][0]} " for name in worlds), "aim "), rows)


def _counted(one: dict[str, Any] | None) -> Count | str:
    return "" if one is None else Count(one["hits"], one["of"], one["met"] is False)


def reliability_diagram(record: Record) -> str:
    """How often what was said with a probability is true in each world, with limits of 95 %."""
    panel = Panel(x="probability that was stated", y="share that is true", x_range=(0, 1), y_range=(0, 1))
    panel.line([0.0, 1.0], [0.0, 1.0], COVERED, "as stated", dash="5 3")
    for name, found in record["worlds"].items():
        label, color = WORLDS[name]
        said = [row for row in found["all"] if row["name"].startswith(SAID)]
        at = [float(row["goal"].rstrip("%")) / 100.0 for row in said]
        low, share, high = ([row[key] for row in said] for key in ("low", "share", "high"))
        panel.errors(at, low, high, color)
        panel.dots(at, share, color, f"{label}, {sum(row['of'] for row in said)} statements", size=8.0)
    return drawing([panel], height=300.0, width=HALF)
