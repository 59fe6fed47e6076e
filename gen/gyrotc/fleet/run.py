"""The jobs of a fleet on the processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from ..errors import InputError
from .manifest import Fleet
from .unit import Entry, Task, do_unit, done_before

__all__ = ["run_fleet"]

Told = Callable[[Entry], None]
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def run_fleet(
    fleet: Fleet,
    out: Path,
    *,
    jobs: int = 2,
    scheduler: str | None = None,
    full: bool = False,
    told: Told | None = None,
) -> list[Entry]:
    """Does every unit that is not done yet; one entry each, in the manifest's order.

    Args:
        out: A folder for each unit goes into it.
        jobs: Processes on this machine.
        scheduler: Address of a Dask scheduler to use instead; its workers see the same folders.
        full: A whole `build` for each unit: compiled, verified on the targets found, with its report.
        told: Called with each entry as it comes, those of earlier calls first.

    Raises:
        InputError: A scheduler is named and Dask is not installed, or cannot be reached.
    """
    say = told or (lambda _: None)
    out.mkdir(parents=True, exist_ok=True)
    tasks = [Task(unit, fleet, out / unit.name, full) for unit in fleet.units]
    entries: dict[str, Entry] = {}
    for task in tasks:
        if known := done_before(task):
            entries[task.unit.name] = known | {"kept": True}
            say(entries[task.unit.name])
    waiting = [task for task in tasks if task.unit.name not in entries]
    for entry in _on_dask(scheduler, waiting) if scheduler else _on_processes(jobs, waiting):
        entries[entry["name"]] = entry
        say(entry)
    return list(_one_of_each_serial([entries[task.unit.name] for task in tasks]))


def _one_of_each_serial(entries: Sequence[Entry]) -> Iterator[Entry]:
    """Two gyros under one serial: a table would fly on the wrong one, so both have failed."""
    counts = Counter((e["serial"], e["axis"]) for e in entries if "serial" in e)
    for entry in entries:
        if counts[(entry.get("serial"), entry["axis"])] < 2:
            yield entry
            continue
        reason = f"serial {entry['serial']} is also that of another data set"
        others = f"; {entry['reason']}" if "reason" in entry else ""
        yield entry | {"status": "failed", "reason": reason + others}


def _on_processes(jobs: int, tasks: Sequence[Task]) -> Iterator[Entry]:
    """A process that dies takes the pool with it; what it had not done is then done one by one, each in its own."""
    left = {task.unit.name: task for task in tasks}
    try:
        with _pool(jobs) as pool:
            for future in as_completed([pool.submit(do_unit, task) for task in tasks]):
                entry: dict[str, Any] = future.result()
                del left[entry["name"]]
                yield entry
    except BrokenProcessPool:
        for task in left.values():
            yield _alone(task)


def _alone(task: Task) -> Entry:
    try:
        with _pool(1) as pool:
            return pool.submit(do_unit, task).result()
    except BrokenProcessPool:
        unit = task.unit
        reason = "its process died (out of memory?)"
        return {
            "name": unit.name, "dataset": str(unit.dataset), "axis": unit.axis, "status": "failed",
            "reason": reason,
        }  # fmt: skip


def _pool(jobs: int) -> ProcessPoolExecutor:
    """Fresh processes with one thread each: a serial is too small to share."""
    for name in _THREADS:
        os.environ.setdefault(name, "1")
    return ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"))


def _on_dask(scheduler: str, tasks: Sequence[Task]) -> Iterator[Entry]:
    try:
        from distributed import Client
        from distributed import as_completed as completed
    except ImportError as error:
        raise InputError("--scheduler", "Dask is not installed here", "pip install distributed") from error
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise InputError("--scheduler", f"{scheduler}: {error}", "the address of a Dask scheduler") from error
    with client:
        for future in completed(client.map(do_unit, tasks, pure=False)):
            yield future.result()
