"""A fleet: units that are done stay, the rest is done on processes of this machine or on a Dask cluster."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..common.errors import InputError, install_command
from ..common.threads import single_threaded
from ..results.cache import program_of
from ..results.destination import check_separate
from ..results.files import check_replaceable
from ..results.fleet import FleetEntry
from ..results.place import held
from ..results.signals import deferred
from .manifest import SUMMARY, Fleet, printable
from .page import write_summary
from .unit import ENTRY, Task, clean_units, do_unit, failed, made_before

_DIED = "its process died (out of memory?)"
_STOPPED = "the fleet was stopped before it: give the command again"


def on_processes(jobs: int, tasks: Sequence[Task]) -> Iterator[tuple[int, FleetEntry]]:
    """Every task's number with its entry, as they come.

    A process that dies takes its pool with it. Whose process it was is unknown; the pool hands tasks out in their
    order, so that it is among the first that are not done: these are done each in a process of its own, the rest
    in a new pool.
    """
    waiting = dict(enumerate(tasks))
    while waiting:
        try:
            for number, entry in _pooled(jobs, waiting):
                del waiting[number]
                yield number, entry
        except BrokenProcessPool:
            for number in list(waiting)[: jobs + 1]:  # those at work, and the one that the pool keeps ready
                yield number, _alone(waiting.pop(number))


def _pooled(jobs: int, tasks: dict[int, Task]) -> Iterator[tuple[int, FleetEntry]]:
    """Run tasks on fresh processes with one thread each: a serial is too small to share."""
    single_threaded()
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(jobs, len(tasks)), mp_context=context, initializer=_end_with_parent)
    try:
        numbers: dict[Future[FleetEntry], int] = {pool.submit(do_unit, task): n for n, task in tasks.items()}
        for future in as_completed(numbers):
            number = numbers[future]
            yield number, _entry_of(tasks[number], future)
    except BaseException:  # a process died, or the user stops the fleet: the others end now, not with their queue
        for process in multiprocessing.active_children():
            process.kill()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)  # until nobody writes any more


def _entry_of(task: Task, future: Future[FleetEntry]) -> FleetEntry:
    try:
        return future.result()
    except BrokenProcessPool:
        raise
    except Exception as error:  # it could not be sent there or back
        return failed(task, f"{type(error).__name__}: {error}")


def _alone(task: Task) -> FleetEntry:
    try:
        [(_, entry)] = _pooled(1, {0: task})
    except BrokenProcessPool:
        return failed(task, _DIED)
    return entry


def _end_with_parent() -> None:
    """Ctrl-C is the parent's to handle; when it is gone, however that came, nobody goes on writing for it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.freeze()  # what was imported stays: it need not be looked through after every serial
    parent = multiprocessing.parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


_CONNECT_S = 10.0  # also the scheduler of a busy cluster answers within seconds
_LOOK_S = 0.2  # between two looks at what has come


@dataclass(frozen=True, slots=True)
class Cluster:
    """A Dask cluster.

    Attributes:
        address: Address of the scheduler.
        wait_s: Longest time that a fleet waits for a worker, s.
        say: Called with what is waited for, and with the address of the dashboard.
    """

    address: str
    wait_s: float = 60.0
    say: Callable[[str], None] = lambda _: None


def on_dask(cluster: Cluster, tasks: Sequence[Task]) -> Iterator[tuple[int, FleetEntry]]:
    """Run tasks on the workers of a cluster; see `on_processes`.

    Dask gives a task whose worker was lost to another, and fails it when that has happened more often than its
    scheduler allows (`allowed-failures`). What is left when the scheduler or all workers are lost is unfinished.
    A future is released with its result: else Dask would do the task again when the worker that did it is lost.

    Raises:
        InputError: Dask is not installed, the scheduler cannot be reached, or no worker comes.
    """
    with connected(cluster) as client:
        from distributed import as_completed as completed

        _wait_for_worker(cluster, client)
        cluster.say(_described(cluster, client))
        numbers = {future: k for k, future in enumerate(client.map(do_unit, tasks, pure=False))}
        arrived = completed(list(numbers), with_results=True, raise_errors=False)
        why = f"{cluster.address}: the scheduler was lost, or has cancelled it"
        while numbers:
            for future, result in arrived.next_batch(block=False):
                if isinstance(result, (FleetEntry, tuple)):  # else it was cancelled
                    number = numbers.pop(future)
                    future.release()
                    yield number, _entry_on_dask(tasks[number], result)
            if all(future.cancelled() for future in numbers):
                break
            try:
                _wait_for_worker(cluster, client)
            except InputError as error:
                why = error.found
                break
            time.sleep(_LOOK_S)
    for number in numbers.values():
        yield number, _unfinished(tasks[number], f"{why}; give the command again")


@contextmanager
def connected(cluster: Cluster) -> Iterator[Any]:
    """A client; with the end of the block the scheduler forgets what it has not begun."""
    try:
        import distributed
    except ImportError as error:
        raise InputError("--scheduler", "Dask is not installed here", install_command("dask")) from error
    try:
        client = distributed.Client(cluster.address, timeout=_CONNECT_S)
    except (OSError, ValueError, distributed.TimeoutError) as error:
        found = f"{cluster.address}: {(str(error) or type(error).__name__).splitlines()[0]}"
        raise InputError("--scheduler", found, "the address of a Dask scheduler") from error
    with client:
        yield client


def _wait_for_worker(cluster: Cluster, client: Any) -> None:
    """Wait until there is a worker.

    Raises:
        InputError: None came in time, or the scheduler was lost.
    """
    from distributed import TimeoutError as TimeIsOver

    try:
        if not client.nthreads():
            limit = f"{cluster.wait_s:g} s at most"
            cluster.say(f"waiting for a worker of {cluster.address} (0 now, 1 is enough), {limit}")
            client.wait_for_workers(1, timeout=cluster.wait_s)
    except TimeIsOver as error:
        found, expected = f"no worker in {cluster.wait_s:g} s", f"dask worker {cluster.address}"
        raise InputError("--scheduler", f"{cluster.address}: {found}", expected) from error
    except OSError as error:
        raise InputError("--scheduler", f"{cluster.address}: the scheduler was lost", "it runs") from error


def _described(cluster: Cluster, client: Any) -> str:
    threads = client.nthreads()
    try:
        dashboard = f"dashboard {client.dashboard_link}"
    except KeyError:
        dashboard = "no dashboard"
    return f"{cluster.address}: {len(threads)} workers, {sum(threads.values())} threads, {dashboard}"


def _entry_on_dask(task: Task, result: FleetEntry | tuple[Any, Any, Any]) -> FleetEntry:
    """Return the entry of a task, or one made of the type, value and place of what it raised."""
    if isinstance(result, FleetEntry):
        if result.status == "done":  # in the fleet's folder here: a worker may have another folder under that path
            os.listdir(task.out.parent)  # noqa: PTH208 a network file system looks anew
            if not (task.out / ENTRY).is_file():
                return failed(task, f"{task.out}: its worker has written it into another folder of that name")
        return result
    error = result[1]
    if type(error).__name__ != "KilledWorker":
        return failed(task, f"{type(error).__name__}: {error}; workers need the same gyrotc")
    times, last = error.allowed_failures + 1, error.last_worker.name
    return failed(task, f"{times} workers died with it, the last one {last} (out of memory?)")


Done = Callable[[FleetEntry], None]


def run_fleet(
    fleet: Fleet,
    out: Path,
    *,
    jobs: int = 2,
    cluster: Cluster | None = None,
    done: Done | None = None,
) -> list[FleetEntry]:
    """Do every unit that is not done yet and write the summary; one entry each, in the manifest's order.

    Args:
        out: A folder for each unit goes into it, and the files of the summary.
        jobs: Processes on this machine.
        cluster: To use instead; its workers see the same folders.
        done: Called with each entry as it comes, those of earlier calls first.

    Raises:
        InputError: As `on_dask`, where a cluster is named; `out` is, holds or lies in
            a data set, holds a summary that gyrotc did not write, or another fleet is being written there.
    """
    place = _checked_place(fleet, out)
    with held(place):
        try:
            return _run(fleet, place, jobs, cluster, done or (lambda _: None))
        finally:
            with deferred():
                clean_units(place, [unit.folder for unit in fleet.units])  # of processes that this one ended


def forgotten_units(fleet: Fleet, out: Path) -> list[str]:
    """Return the names of results in the folder of a fleet whose recordings are none of the fleet's."""
    known = {unit.folder for unit in fleet.units}
    return sorted(printable(place.parent.name) for place in out.glob(f"*/{ENTRY}") if place.parent.name not in known)


def _checked_place(fleet: Fleet, out: Path) -> Path:
    """The folder of a fleet, which is there afterwards; raises as `run_fleet`."""
    place = Path(os.path.realpath(out))
    check_separate(out, [unit.dataset for unit in fleet.units if os.path.isdir(unit.dataset)])  # noqa: PTH112 (never raises)
    summary = [place / name for name in SUMMARY]
    check_replaceable(summary[0])
    for path in summary[1:]:
        if path.exists() and not summary[0].exists():
            raise InputError(str(path), "exists and was not written by gyrotc", "another folder; or move it away")
    place.mkdir(parents=True, exist_ok=True)
    return place


def tasks_of(fleet: Fleet, out: Path) -> list[Task]:
    """A task for each unit; none of them carries the others to another process."""
    program, common = program_of(), replace(fleet, units=(), releases={})
    return [
        Task(
            replace(unit, dataset=unit.dataset.absolute()),
            printable(str(unit.dataset)),
            common,
            out / unit.folder,
            program,
        )
        for unit in fleet.units
    ]


def _run(
    fleet: Fleet,
    out: Path,
    jobs: int,
    cluster: Cluster | None,
    say: Done,
) -> list[FleetEntry]:
    clean_units(out, [unit.folder for unit in fleet.units])
    tasks = [task.keyed() for task in tasks_of(fleet, out)]
    entries = {}
    for number, task in enumerate(tasks):
        if (known := made_before(task)) and known.status == "done":
            entries[number] = known.as_kept()
            say(entries[number])
    if len(entries) < len(tasks) and any((out / name).exists() for name in SUMMARY):
        # What an earlier summary says of them ends now: a fleet that is killed must not leave it there.
        so_far = [entries.get(n) or _unfinished(task) for n, task in enumerate(tasks)]
        write_summary(out, so_far)
    waiting = [number for number in range(len(tasks)) if number not in entries]
    left = [tasks[number] for number in waiting]
    for k, entry in on_dask(cluster, left) if cluster and left else on_processes(jobs, left):
        entries[waiting[k]] = entry
        say(entry)
    done = [entries[number] for number in range(len(tasks))]
    judged = list(one_of_each_serial(done))
    for before, after in zip(done, judged, strict=True):
        if before.status != after.status:
            say(after)
    found = [
        entry.model_copy(update={"released": why}) if (why := fleet.releases.get(entry.serial or "")) else entry
        for entry in judged
    ]
    write_summary(out, found)
    return found


def _unfinished(task: Task, reason: str = _STOPPED) -> FleetEntry:
    """The entry of a unit that nobody has done."""
    return FleetEntry(name=task.unit.name, axis=task.unit.axis, status="unfinished", reason=reason)


def one_of_each_serial(entries: Sequence[FleetEntry]) -> Iterator[FleetEntry]:
    """Two gyros under one serial: a table would fly on the wrong one, so both have failed."""
    counts = Counter((e.serial, e.axis) for e in entries)
    for entry in entries:
        if entry.serial is None or counts[(entry.serial, entry.axis)] < 2:
            yield entry
            continue
        reason = f"serial {entry.serial} is also that of another data set; serial = ... in dataset.toml states its own"
        others = f"; {entry.reason}" if entry.reason else ""
        yield entry.model_copy(update={"status": "failed", "reason": reason + others})
