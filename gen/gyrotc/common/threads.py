"""Libraries of linear algebra with one thread: the matrices here are small, and gyros are calibrated side by side."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Mapping
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

ONE_THREAD: Mapping[str, str] = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Variables of the environment that the libraries read when they are loaded."""


def single_threaded() -> None:
    """Give this process, and those that it starts, one thread each, unless the user says otherwise."""
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)


def with_one_thread(job: Callable[P, T]) -> Callable[P, T]:
    """Make a job give the libraries one thread while it runs, unless the user says otherwise by the environment.

    A caller of the job may have loaded the libraries long before it, with a thread for each core. The module that
    defines the job imports the libraries: one that is loaded only while the job runs keeps its threads.
    """

    @functools.wraps(job)
    def limited(*arguments: P.args, **options: P.kwargs) -> T:
        if any(name in os.environ for name in ONE_THREAD):
            return job(*arguments, **options)
        from threadpoolctl import threadpool_limits  # the command needs none: it has set the environment

        with threadpool_limits(limits=1):
            return job(*arguments, **options)

    return limited
