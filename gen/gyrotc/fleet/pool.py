"""Jobs of a fleet on processes of this machine, or on a Dask cluster: a process that dies concerns its unit alone."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from ..common.errors import InputError
from ..results.fleet import FleetEntry
from .entry import ENTRY
from .unit import Task, do_unit, failed

__all__ = ["on_dask", "on_processes"]

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_DIED = "its process died (out of memory?)"


def on_processes(jobs: int, tasks: Sequence[Task]) -> Iterator[tuple[int, FleetEntry]]:
    """Every task's number with its entry, as they come.

    A process that dies takes its pool with it. Whose process it was is not told; the pool hands tasks out in their
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
    pool = _pool(min(jobs, len(tasks)))
    try:
        numbers: dict[Future[FleetEntry], int] = {pool.submit(do_unit, task): n for n, task in tasks.items()}
        for future in as_completed(numbers):
            number = numbers[future]
            yield number, _entry_of(tasks[number], future)
    except (
        BaseException
    ):  # a process died, or the user stops the fleet: the others end now, not with their queue
        for process in multiprocessing.active_children():
            process.kill()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)  # until nobody writes any more


def _entry_of(task: Task, future: Any) -> FleetEntry:
    try:
        entry: FleetEntry = future.result()
    except BrokenProcessPool:
        raise
    except Exception as error:  # it could not be sent there or back
        return failed(task, f"{type(error).__name__}: {error}")
    return entry


def _alone(task: Task) -> FleetEntry:
    try:
        [(_, entry)] = _pooled(1, {0: task})
    except BrokenProcessPool:
        return failed(task, _DIED)
    return entry


def _pool(jobs: int) -> ProcessPoolExecutor:
    """Fresh processes with one thread each: a serial is too small to share."""
    for name in _THREADS:
        os.environ.setdefault(name, "1")
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(jobs, mp_context=context, initializer=_end_with_parent)


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


def on_dask(scheduler: str, tasks: Sequence[Task]) -> Iterator[tuple[int, FleetEntry]]:
    """As `on_processes`, on the workers of a cluster.

    Raises:
        InputError: Dask is not installed, or the scheduler cannot be reached.
    """
    try:
        from distributed import Client
        from distributed import as_completed as completed
    except ImportError as error:
        raise InputError("--scheduler", "Dask is not installed here", "pip install gyrotc[dask]") from error
    try:
        client = Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise InputError("--scheduler", f"{scheduler}: {error}", "the address of a Dask scheduler") from error
    with client:
        futures = client.map(do_unit, tasks, pure=False)
        numbers = {future.key: number for number, future in enumerate(futures)}
        for future in completed(futures):
            number = numbers[future.key]
            yield number, _there(tasks[number], _entry_of(tasks[number], future))


def _there(task: Task, entry: FleetEntry) -> FleetEntry:
    """The entry if its result is in the fleet's folder here: a worker may have another folder under that path."""
    if entry.status == "done":
        os.listdir(task.out.parent)  # noqa: PTH208 a network file system looks anew
        if not (task.out / ENTRY).is_file():
            return failed(task, f"{task.out}: its worker has written it into another folder of that name")
    return entry
