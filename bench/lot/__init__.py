"""Many units: faults planted among them, new units from one run and their lot, units that return from service."""

from __future__ import annotations

import secrets
from collections.abc import Iterator

from ..campaigns import Settings, say
from ..page import Count, Figure, ResultsTable, figures_table
from ..records import Record
from .new_units import new_units
from .planted import planted
from .returned import returned

_TEXT = """
Planted faults: `gyrotc fleet` on simulated gyros of three axes with six runs of two hours. New gyros: 60 calibrated
gyros of a simulated lot are the prior ([lot.md](lot.md)), and others are calibrated from one run of 2.5 h and judged on
six environments. Returned gyros: they were calibrated from five runs and have changed in one of five ways or not at
all, and `--prior` chooses from a check run; their RMS is compared with the better of the earlier table and that table
with an offset.
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
    parts = (_of_faults, _of_new_units, _of_strangers, _of_returned)
    return figures_table(_TEXT, [figure for part in parts for figure in part(record)])


def _of_faults(record: Record) -> Iterator[tuple[str, Figure | Count]]:
    found = record["planted"]
    yield "planted faults whose gyros all have the right reason", Count(found["named"], found["planted"])
    yield f"healthy gyros with a reason, of {found['healthy']}", Figure(found["accused"], at_most=0)


def _of_new_units(record: Record) -> Iterator[tuple[str, Figure]]:
    for case in record["new"]:
        for way, words in (("lot", "with the lot"), ("mrbf", "without")):
            name = f"RMS ÷ noise floor of a new gyro, median, {case['case']}: {words}"
            yield name, Figure(case["ways"][way][0], ".3f")


def _of_strangers(record: Record) -> Iterator[tuple[str, Figure]]:
    refused = max(case["refused"] for case in record["new"])
    yield "gyros of the lot that are refused, worst lot", Figure(refused, ".1%")
    for case in record["new"]:
        for runs, share in case["unrelated_refused"].items():
            yield f"unrelated gyros that are refused, from {runs}", Figure(share, ".0%")


def _of_returned(record: Record) -> Iterator[tuple[str, Figure]]:
    for hours in sorted({row["hours"] for row in record["returned"]}, reverse=True):
        worst = max(row["worst"] for row in record["returned"] if row["hours"] == hours)
        yield (
            f"returned gyros, check run of {hours:g} h: largest RMS over that of the earlier table",
            Figure(worst, ".3f"),
        )
