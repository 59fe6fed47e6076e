"""Many units: faults planted among them, new units from one run and their lot, units that return from service."""

from __future__ import annotations

import secrets
from collections.abc import Iterator

from ..campaigns import Settings, say
from ..page import Figure, ResultsTable, figures_table
from ..records import Record
from .new_units import WAYS, new_units
from .planted import planted
from .returned import returned

_TEXT = """
Faults: planted in small simulated units of three axes, six runs of two hours each, through `gyrotc fleet`; named if
every gyro that the fault concerns has its reason. New units: 60 calibrated units of a simulated lot teach
([lot.md](lot.md)), others are calibrated from one run of 2.5 h and judged on six environments. Returned units:
calibrated from five runs, then changed in one of five ways or not at all; `--prior` chooses from a check run of 5 h, or
from its first 2.5 h, which leave out all below 0 C; worst is against the better of the earlier table and that table
with an offset. RMS is of compensated means over the noise floor, median of the units.
"""


def measure(settings: Settings) -> Record:
    """Plant faults, calibrate new units with and without their lot, and recalibrate units that return."""
    seed = secrets.randbelow(9000) + 1000 if settings.seed is None else settings.seed
    say(f"seed {seed}")
    quick, workers = settings.quick, settings.workers
    return {
        "seed": seed,
        "planted": planted(1, workers, 12, 1) if quick else planted(1, workers),
        "new": new_units(seed, workers, quick=quick),
        "returned": returned(workers, 1) if quick else returned(workers),
    }


def table(record: Record) -> ResultsTable:
    """Return what was named, and RMS over the noise floor of new and returned units."""
    return figures_table(_TEXT, [*_of_faults(record), *_of_new_units(record), *_of_returned(record)])


def _of_faults(record: Record) -> Iterator[tuple[str, Figure]]:
    found = record["planted"]
    yield f"faults named, of {found['planted']}", Figure(found["named"])
    for row in found["rows"]:
        if row["named"] < row["planted"]:
            yield f"... {row['fault'].replace('_', ' ')}, of {row['planted']}", Figure(row["named"])
    yield f"healthy gyros accused, of {found['healthy']}", Figure(found["accused"], at_most=0)


def _of_new_units(record: Record) -> Iterator[tuple[str, Figure]]:
    for case in record["new"]:
        for way, (rms, *_) in case["ways"].items():
            yield f"new unit, {case['case']}: {WAYS[way]}", Figure(rms, ".3f")
        yield f"new unit, {case['case']}: own units refused", Figure(case["refused"], ".1%")
        for runs, share in case["unrelated_refused"].items():
            yield f"new unit, {case['case']}: unrelated units refused from {runs}", Figure(share, ".0%")


def _of_returned(record: Record) -> Iterator[tuple[str, Figure]]:
    for row in record["returned"]:
        words = f"returned unit, {row['hours']:g} h, change: {row['kind']}"
        yield f"{words}; as found", Figure(row["as_found"], ".3f")
        yield f"{words}; as `--prior` chooses", Figure(row["chosen"], ".3f")
        yield f"{words}; worst against a simple way", Figure(row["worst"], ".3f")
