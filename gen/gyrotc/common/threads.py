"""Libraries of linear algebra with one thread: the matrices here are small, and gyros are calibrated side by side."""

from __future__ import annotations

import os
from collections.abc import Mapping

ONE_THREAD: Mapping[str, str] = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Variables of the environment that the libraries read when they are loaded."""


def single_threaded() -> None:
    """Give this process, and those that it starts, one thread each, unless the user says otherwise."""
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
