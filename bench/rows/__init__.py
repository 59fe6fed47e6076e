"""Events and faults planted in recordings: what is found, named and placed, and what is said of clean ones."""

from __future__ import annotations

import secrets

from ..campaigns import Settings, say
from ..page import Figure, ResultsTable
from ..records import Record
from .events import events
from .evidence import evidence

_TEXT = """
Each data set has four runs of a random gyro in a random chamber, with rows of 1, 10 or 60 s, and one event. Sizes are
in noise floors. Found: a finding at the right place. Named: a finding of the right kind. Limits hold: the true time is
within the stated limits. False: data sets with a finding elsewhere; at most 2 % of the clean ones is the aim. Whole
runs: one of five runs has the fault, and any finding about that run counts. Seed {seed}.
"""
_FALSE = 0.02


def measure(settings: Settings) -> Record:
    """Draw sets with each kind of event and fault, and read what is said of them."""
    seed = secrets.randbits(31) if settings.seed is None else settings.seed
    say(f"seed {seed}")
    each, clean, faulty = (1, 4, 2) if settings.quick else (36, 200, 50)
    return {
        "seed": seed,
        "events": events(seed, each, settings.workers),
        "runs": evidence(seed, clean, faulty, settings.workers),
    }


def table(record: Record) -> ResultsTable:
    """Return what was found of each kind."""
    rows: list[tuple[object, ...]] = []
    for row in record["events"]:
        aim = _FALSE * row["sets"] if row["name"] == "clean" else None
        false = Figure(row["false"], at_most=aim)
        rows.append((_words(row["name"]), row["sets"], row["found"], row["named"], row["holds"], false))
    for row in record["runs"]:
        clean = row["kind"] == "clean"
        false = Figure(row["named"], at_most=_FALSE * row["sets"]) if clean else ""
        named = "" if clean else row["named"]
        rows.append((f"whole run: {row['kind']}", row["sets"], "", named, "", false))
    head = ("planted", "data sets ", "found ", "named ", "limits hold ", "false ")
    return ResultsTable(_TEXT.format(**record), head, rows)


def _words(name: str) -> str:
    return name.replace("thermometer", "temperature sensor").replace("dropout", "gap")
