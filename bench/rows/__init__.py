"""Events and faults planted in recordings: what is found, named and placed, and what is said of clean ones."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from typing import Any

from ..campaigns import Settings, say
from ..page import Count, Figure, ResultsTable, figures_table
from ..records import Record
from .events import events
from .evidence import evidence

_TEXT = """
Each data set has four runs of a random gyro in a random chamber, with rows of 1, 10 or 60 s, and one event; sizes are
in noise floors. An event is named if a finding of the right kind is at the right place. Seed {seed}.
"""
# Largest share of clean data sets with a finding.
_FALSE = 0.02
# Lines of the page, with the beginnings of the names of the events that each is about.
_GROUPS = {
    "steps of 6 to 30 that are named, in holds and on ramps": ("step, ",),
    "transitions of 16 that are named": ("transition",),
    "drifts of 12 an hour that are named": ("drift 12",),
    "drifts of 40 an hour that are named": ("drift 40",),
    "gains of 1.5 that are named, within a run or of a run": ("gain within 1.5", "gain of a run 1.5"),
    "runs with a reversed sign or in another unit that are named": ("sign of a run", "other unit"),
    "shifted, loose or stuck temperature sensors that are named": ("thermometer", "lost", "stuck"),
    "bursts and gaps that are named": ("burst", "dropout"),
}


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
    """Return what was named of each kind, and findings where nothing was planted."""
    return figures_table(_TEXT.format(**record), [*_of_events(record["events"]), *_of_runs(record["runs"])])


def _of_events(events: list[dict[str, Any]]) -> Iterator[tuple[str, Figure | Count]]:
    for words, beginnings in _GROUPS.items():
        rows = [row for row in events if row["name"].startswith(beginnings)]
        yield words, Count(sum(row["named"] for row in rows), sum(row["sets"] for row in rows))
    (clean,) = (row for row in events if row["name"] == "clean")
    words = f"clean data sets with a finding, of {clean['sets']}"
    yield words, Figure(clean["false"], at_most=_FALSE * clean["sets"])
    others = [row for row in events if row is not clean]
    words = "data sets with an event and a finding elsewhere"
    yield words, Count(sum(row["false"] for row in others), sum(row["sets"] for row in others))


def _of_runs(runs: list[dict[str, Any]]) -> Iterator[tuple[str, Figure | Count]]:
    (clean,) = (row for row in runs if row["kind"] == "clean")
    faulty = [row for row in runs if row is not clean]
    kinds = ", ".join(row["kind"] for row in faulty)
    words = f"whole runs with a fault that are found ({kinds})"
    yield words, Count(sum(row["named"] for row in faulty), sum(row["sets"] for row in faulty))
    words = f"clean sets of such runs with a finding, of {clean['sets']}"
    yield words, Figure(clean["named"], at_most=_FALSE * clean["sets"])
