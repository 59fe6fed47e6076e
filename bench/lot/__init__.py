"""Many units: faults planted among them, new units from one run and their lot, units that return from service."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from dataclasses import replace

from ..campaigns import Settings, say
from ..page import Figure, ResultsTable, figures_table
from ..records import Record
from .new_units import WAYS, new_units
from .planted import planted
from .returned import returned

_TEXT = """
Planted faults: `gyrotc fleet` on simulated gyros of three axes with six runs of two hours. A fault counts as named if
every gyro that it concerns has the right reason.
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
    faults = figures_table(_TEXT, list(_of_faults(record)))
    return replace(faults, more=[_of_new_units(record), _of_returned(record)])


def _of_faults(record: Record) -> Iterator[tuple[str, Figure]]:
    found = record["planted"]
    yield f"faults named, of {found['planted']}", Figure(found["named"])
    for row in found["rows"]:
        if row["named"] < row["planted"]:
            yield f"... of these: {row['fault'].replace('_', ' ')}, of {row['planted']}", Figure(row["named"])
    yield f"healthy gyros with a reason, of {found['healthy']}", Figure(found["accused"], at_most=0)


_NEW = """
New gyros: 60 calibrated gyros of a simulated lot are the prior ([lot.md](lot.md)); others are calibrated from one run
of 2.5 h and judged on six environments. The figures are RMS over the noise floor, median of the gyros.
"""


def _of_new_units(record: Record) -> ResultsTable:
    head = ("lot", *(f"{words} " for words in WAYS.values()), "own gyros refused ", "unrelated gyros refused ")
    rows = []
    for case in record["new"]:
        refused = ", ".join(f"{share:.0%} from {runs}" for runs, share in case["unrelated_refused"].items())
        ways = (f"{case['ways'][way][0]:.3f}" for way in WAYS)
        rows.append((case["case"], *ways, f"{case['refused']:.1%}", refused))
    return ResultsTable(_NEW, head, rows)


_RETURNED = """
Returned gyros: they were calibrated from five runs and have changed in one of five ways or not at all. `--prior`
chooses from a check run of 5 h, or from its first 2.5 h, which contain no temperature below 0 C. As found: RMS of the
earlier table over the noise floor, median. As chosen: the same of the new table. Worst: largest RMS of the new table
over that of the better of the earlier table and the earlier table with an offset.
"""


def _of_returned(record: Record) -> ResultsTable:
    hours = sorted({row["hours"] for row in record["returned"]}, reverse=True)
    head = ["change", "as found "]
    for h in hours:
        head += [f"as chosen, {h:g} h ", f"worst, {h:g} h "]
    found: dict[str, list[str]] = {}
    for h in hours:
        for row in (row for row in record["returned"] if row["hours"] == h):
            cells = found.setdefault(row["kind"], [f"{row['as_found']:.3f}"])
            cells += [f"{row['chosen']:.3f}", f"{row['worst']:.3f}"]
    return ResultsTable(_RETURNED, head, [(kind, *cells) for kind, cells in found.items()])
