"""A fleet on many machines: each does its share of the units, and one call gathers what they did.

Which share a unit belongs to follows from the hash of its name alone, so that all machines agree without talking.
A share leaves results as a whole fleet does; what came to nothing is kept in `shards/`, for no result tells it.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..common.errors import GyrotcError, InputError
from ..common.inputs import checked, read_json
from ..results.fleet import FleetEntry, ShardEntries
from ..store.files import Lock, check_own, json_text, write_atomically
from ..store.folder import result_folder
from ..store.interrupts import deferred
from .catalogue import enter
from .manifest import SUMMARY, Fleet
from .run import Told, checked_place, done_already, summed, tasks_of, unfinished, worked
from .unit import Task, clean_units

__all__ = ["SHARDS", "Share", "gather", "mine", "run_share", "share_of"]

SHARDS = "shards"
_MOST = 100_000  # shares: as many as a fleet may have units


@dataclass(frozen=True, slots=True)
class Share:
    """The k-th of n shares, from 1 on."""

    number: int
    of: int

    @property
    def name(self) -> str:
        return f"{self.number}-of-{self.of}"


def share_of(text: str) -> Share:
    """`k/N` as a share.

    Raises:
        InputError: It is not of that form.
    """
    number, _, of = text.partition("/")
    if number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of) <= _MOST:
        return Share(int(number), int(of))
    raise InputError("--shard", repr(text)[:40], f"k/N with 1 <= k <= N <= {_MOST}, such as 3/16")


def mine(fleet: Fleet, share: Share) -> Fleet:
    """The fleet with the units of a share alone, in their order."""
    units = (unit for unit in fleet.units if _number(unit.folder) % share.of == share.number - 1)
    return replace(fleet, units=tuple(units))


def _number(name: str) -> int:
    return int.from_bytes(hashlib.sha256(os.fsencode(name)).digest()[:8], "big")


def run_share(
    fleet: Fleet,
    out: Path,
    share: Share,
    *,
    jobs: int = 2,
    scheduler: str | None = None,
    full: bool = False,
    told: Told | None = None,
) -> list[FleetEntry]:
    """Does the units of one share that are not done yet, and writes no summary; arguments as of `run_fleet`.

    Raises:
        InputError: As `run_fleet`; the same share is at work; what it would replace is not of a share.
    """
    place, own = checked_place(fleet, out), mine(fleet, share)
    (place / SHARDS).mkdir(exist_ok=True)
    _check_replaceable(place / SHARDS / f"{share.name}.json")
    lock = Lock(place / SHARDS / share.name, "fleet")
    try:
        say = told or (lambda _: None)
        tasks = tasks_of(own, place, full)
        entries = done_already(tasks, say)
        if len(entries) < len(tasks):
            _without_summary(place)  # what it says of them ends now
        found = worked(tasks, entries, jobs, scheduler, say)
        failed = (
            e.model_copy(update={"key": t.key or None})
            for e, t in zip(found, tasks, strict=True)
            if e.status != "done"
        )
        kept = ShardEntries(entries=tuple(failed))
        write_atomically(place / SHARDS / f"{share.name}.json", json_text(kept.content()))
        return found
    finally:
        with deferred():
            try:
                clean_units(place, [unit.folder for unit in own.units])
            finally:
                lock.release()


def _check_replaceable(path: Path) -> None:
    if path.exists() or path.is_symlink():
        check_own(path)
        checked(ShardEntries, read_json(path, "what a share kept"), str(path))


def _without_summary(out: Path) -> None:
    """Takes an earlier summary away; shares that do it at the same time wait for one another."""
    lock = Lock(out / "fleet.json", "fleet", wait=True)
    try:
        if any((out / name).exists() for name in SUMMARY):
            with result_folder(out, "fleet", entries=SUMMARY):
                pass
    finally:
        with deferred():
            lock.release()


def gather(
    fleet: Fleet, out: Path, *, full: bool = False, tag: str = "", told: Told | None = None
) -> list[FleetEntry]:
    """The summary and the catalogue of what the shares have done; arguments as of `run_fleet`.

    A unit that no share has reached, or whose recordings are others now, is unfinished.

    Raises:
        InputError: As `run_fleet`.
    """
    place, say = checked_place(fleet, out), told or (lambda _: None)
    lock = Lock(place / "fleet.json", "fleet")
    try:
        tasks = tasks_of(fleet, place, full)
        entries = done_already(tasks, say)
        kept = {entry.name: entry for entry in _kept(place)}
        for number, task in enumerate(tasks):
            if number not in entries:
                entries[number] = _still(kept.get(task.unit.name), task) or unfinished(task)
                say(entries[number])
        found = summed(place, [entries[number] for number in range(len(tasks))])
        enter(place, found, tag)
        return found
    finally:
        with deferred():
            lock.release()


def _still(entry: FleetEntry | None, task: Task) -> FleetEntry | None:
    """The entry of a share, if it is of the same inputs."""
    return entry if entry is not None and entry.key == task.key else None


def _kept(out: Path) -> Iterator[FleetEntry]:
    paths: Sequence[Path] = sorted((out / SHARDS).glob("*-of-*.json"), key=lambda path: path.stat().st_mtime)
    for path in paths:  # of two that know a unit the later one
        try:
            yield from checked(ShardEntries, read_json(path, "what a share kept"), str(path)).entries
        except GyrotcError:
            continue  # damaged: its units are unfinished then
