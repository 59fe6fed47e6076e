"""A fleet: what is done stays, the rest is done, and the summary agrees with the units at every moment."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from ..results.fleet import FleetEntry
from ..store.fingerprint import program_of
from ..store.interrupts import deferred
from ..store.lock import Lock
from ..store.marker import KINDS
from ..store.places import check_apart, check_contents, final_place
from .aside import clean_units
from .catalogue import enter
from .manifest import SUMMARY, Fleet, printable
from .page import write_summary
from .pool import on_dask, on_processes
from .unit import Task, done_before

__all__ = ["checked_place", "done_already", "run_fleet", "summed", "tasks_of", "unfinished", "worked"]

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
    place = checked_place(fleet, out)
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


def checked_place(fleet: Fleet, out: Path) -> Path:
    """The folder of a fleet, which is there afterwards; raises as `run_fleet`."""
    place = final_place(out)
    folders = [unit.dataset for unit in fleet.units if os.path.isdir(unit.dataset)]  # noqa: PTH112 (never raises)
    check_apart(out, place, folders, whole=True)
    check_contents(out, place, KINDS["fleet"], frozenset(SUMMARY))
    place.mkdir(parents=True, exist_ok=True)
    return place


def tasks_of(fleet: Fleet, out: Path, full: bool) -> list[Task]:
    """A task for each unit; none of them carries the others to another process."""
    program, common = program_of(), replace(fleet, units=())
    return [
        Task(
            replace(unit, dataset=unit.dataset.absolute()),
            printable(str(unit.dataset)),
            common,
            out / unit.folder,
            full,
            program,
        )
        for unit in fleet.units
    ]


def _run(
    fleet: Fleet, out: Path, jobs: int, scheduler: str | None, full: bool, say: Told
) -> list[FleetEntry]:
    clean_units(out, [unit.folder for unit in fleet.units])
    tasks = tasks_of(fleet, out, full)
    entries = done_already(tasks, say)
    if len(entries) < len(tasks) and any((out / name).exists() for name in SUMMARY):
        # What an earlier summary says of them ends now: a fleet that is killed must not leave it there.
        write_summary(out, [entries.get(n) or unfinished(task) for n, task in enumerate(tasks)])
    return summed(out, worked(tasks, entries, jobs, scheduler, say))


def done_already(tasks: list[Task], say: Told) -> dict[int, FleetEntry]:
    """Entries of earlier calls that still hold, by the number of their task. Every task gets its key."""
    entries = {}
    for number, task in enumerate(tasks):
        tasks[number] = task.keyed()
        if known := done_before(tasks[number]):
            entries[number] = known.as_kept()
            say(entries[number])
    return entries


def worked(
    tasks: Sequence[Task], entries: dict[int, FleetEntry], jobs: int, scheduler: str | None, say: Told
) -> list[FleetEntry]:
    """Does what has no entry yet; all entries in the order of the tasks."""
    waiting = [number for number in range(len(tasks)) if number not in entries]
    left = [tasks[number] for number in waiting]
    for k, entry in on_dask(scheduler, left) if scheduler else on_processes(jobs, left):
        entries[waiting[k]] = entry
        say(entry)
    return [entries[number] for number in range(len(tasks))]


def summed(out: Path, entries: Sequence[FleetEntry]) -> list[FleetEntry]:
    """Writes the summary; the entries as it tells them."""
    found = list(_one_of_each_serial(entries))
    write_summary(out, found)
    return found


def unfinished(task: Task) -> FleetEntry:
    """The entry of a unit that was not reached."""
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
