"""Runs a job in a forked process that a signal ends, or the disk lets down, at its n-th call that changes a file."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gyrotc.errors import GyrotcError
from gyrotc.outputs import Interrupted, die_of, raise_on_signals

ACTIONS = {
    "KILL": int(signal.SIGKILL),
    "TERM": int(signal.SIGTERM),
    "INT": int(signal.SIGINT),
    "EIO": -errno.EIO,
    "ENOSPC": -errno.ENOSPC,
}
SHIM = Path(__file__).with_name("shim.c")
Job = Callable[[], None]


def compiled_shim(folder: Path) -> Path:
    """The shim as a library; a process that is to use it is started with `LD_PRELOAD` naming it."""
    library = folder / "shim.so"
    flags = ["-std=gnu99", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, "-o", library, SHIM, "-ldl"], check=True)
    return library


@dataclass(frozen=True)
class End:
    """How a job ended: its exit status (-n: by signal n), its calls that change files, what it told."""

    status: int
    calls: int
    told: str


def run(job: Job, below: Path, action: str = "", at: int = 0, after_s: float | None = None) -> End:
    """Runs a job; at its `at`-th call below a folder, or after a time, what is asked for happens."""
    errors, counter = os.memfd_create("errors"), os.memfd_create("calls")
    pid = os.fork()
    if pid == 0:
        _child(job, below, ACTIONS.get(action, 0), at, errors, counter)
    timer = None
    if after_s is not None:
        timer = threading.Timer(after_s, _end, [pid, ACTIONS[action]])
        timer.start()
    _, status = os.waitpid(pid, 0)
    if timer:
        timer.cancel()
        timer.join()
    told = os.pread(errors, 2**20, 0).decode(errors="replace")
    calls = int.from_bytes(os.pread(counter, 8, 0), "little")
    os.close(errors)
    os.close(counter)
    return End(os.waitstatus_to_exitcode(status), calls, told)


def _end(pid: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, number)


def _child(job: Job, below: Path, action: int, at: int, errors: int, counter: int) -> None:
    """Never returns."""
    os.dup2(errors, 2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    shim = ctypes.CDLL(None)
    exit_code, number = 70, 0
    try:
        raise_on_signals()
        shim.shim_arm(os.fsencode(f"{below}/"), ctypes.c_long(at), action)
        job()
        exit_code = 0
    except GyrotcError as error:
        print(f"gyrotc: {error}", file=sys.stderr)
        exit_code = error.exit_status
    except Interrupted as end:
        number = end.number
    except OSError as error:
        print(f"gyrotc: {error}", file=sys.stderr)
        exit_code = 2
    except SystemExit as end:
        exit_code = end.code if isinstance(end.code, int) else 70
    except BaseException:
        import traceback

        traceback.print_exc()
    sys.stderr.flush()
    os.pwrite(counter, int(shim.shim_count()).to_bytes(8, "little"), 0)
    if number:
        die_of(number)
    os._exit(exit_code)


def seconds(job: Job, below: Path) -> float:
    """How long a job takes."""
    begun = time.monotonic()
    end = run(job, below)
    if end.status != 0:
        raise RuntimeError(f"the job failed by itself: {end.told}")
    return time.monotonic() - begun
