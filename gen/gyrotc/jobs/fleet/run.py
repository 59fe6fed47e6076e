"""A fleet: what is done stays, the rest is done, and the summary agrees with the units at every moment."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ...outputs import KINDS, Lock, deferred
from ...outputs.places import check_apart, check_contents, final_place
from ...results.fleet import FleetEntry
from .aside import clean_units
from .catalogue import enter
from .fingerprint import program_of
from .manifest import SUMMARY, Fleet
from .page import write_summary
from .pool import on_dask, on_processes
from .unit import Task, done_before

__all__ = ["run_fleet"]

Told = Callable[[FleetEntry], None]


def run_fleet(
    fleet: Fleet,
    out: Path,
    *,
    jobs: int = 2,
    scheduler: str | None = None,
    full: bool = False,
    tag: str = "",
    told: Told | None = None,
) -> list[FleetEntry]:
    """Does every unit that is not done yet and writes the summary; one entry each, in the manifest's order.

    Args:
        out: A folder for each unit goes into it, and the files of the summary.
        jobs: Processes on this machine.
        scheduler: Address of a Dask scheduler to use instead; its workers see the same folders.
        tag: Goes into the catalogue with what is new in it.
        full: A whole `build` for each unit: compiled, verified on the targets found, with its report.
        told: Called with each entry as it comes, those of earlier calls first.

    Raises:
        InputError: A scheduler is named and Dask is not installed, or cannot be reached; `out` is, holds or lies in
            a data set, holds a summary that gyrotc did not write, or another fleet is being written there.
    """
    place = final_place(out)
    folders = [unit.dataset for unit in fleet.units if os.path.isdir(unit.dataset)]  # noqa: PTH112 (never raises)
    check_apart(out, place, folders, whole=True)
    check_contents(out, place, KINDS["fleet"], frozenset(SUMMARY))
    place.mkdir(parents=True, exist_ok=True)
    lock = Lock(place / "fleet.json", "fleet")
    try:
        entries = _run(fleet, place, jobs, scheduler, full, told or (lambda _: None))
        enter(place, entries, tag)
        return entries
    finally:
        with deferred():
            try:
                clean_units(place, [unit.folder for unit in fleet.units])  # of processes that this one ended
            finally:
                lock.release()


def _run(
    fleet: Fleet, out: Path, jobs: int, scheduler: str | None, full: bool, say: Told
) -> list[FleetEntry]:
    clean_units(out, [unit.folder for unit in fleet.units])
    program = program_of()
    tasks = [Task(unit, fleet, out / unit.folder, full, program) for unit in fleet.units]
    entries: dict[int, FleetEntry] = {}
    for number, task in enumerate(tasks):
        if known := done_before(task):
            entries[number] = known.as_kept()
            say(entries[number])
    waiting = [number for number in range(len(tasks)) if number not in entries]
    if waiting and any((out / name).exists() for name in SUMMARY):
        # What an earlier summary says of them ends now: a fleet that is killed must not leave it there.
        write_summary(out, [entries.get(n) or _unfinished(task) for n, task in enumerate(tasks)])
    left = [tasks[number] for number in waiting]
    for k, entry in on_dask(scheduler, left) if scheduler else on_processes(jobs, left):
        entries[waiting[k]] = entry
        say(entry)
    found = list(_one_of_each_serial([entries[number] for number in range(len(tasks))]))
    write_summary(out, found)
    return found


def _unfinished(task: Task) -> FleetEntry:
    return FleetEntry(
        name=task.unit.name,
        axis=task.unit.axis,
        status="unfinished",
        reason="the fleet was stopped before it: give the command again",
    )


def _one_of_each_serial(entries: Sequence[FleetEntry]) -> Iterator[FleetEntry]:
    """Two gyros under one serial: a table would fly on the wrong one, so both have failed."""
    counts = Counter((e.serial, e.axis) for e in entries)
    for entry in entries:
        if entry.serial is None or counts[(entry.serial, entry.axis)] < 2:
            yield entry
            continue
        reason = f"serial {entry.serial} is also that of another data set"
        others = f"; {entry.reason}" if entry.reason else ""
        yield entry.model_copy(update={"status": "failed", "reason": reason + others})
