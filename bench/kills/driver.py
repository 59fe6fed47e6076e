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

from gyrotc.common import GyrotcError
from gyrotc.results import Interrupted, die_of, raise_on_signals

ACTIONS = {
    "KILL": int(signal.SIGKILL),
    "TERM": int(signal.SIGTERM),
    "INT": int(signal.SIGINT),
    "EIO": -errno.EIO,
    "ENOSPC": -errno.ENOSPC,
}
SHIM = Path(__file__).with_name("shim.c")
_SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER of linux/prctl.h
_PATIENCE_S = 120.0
Job = Callable[[], None]


def compiled_shim(folder: Path) -> Path:
    """The shim as a library; a process that is to use it is started with `LD_PRELOAD` naming it."""
    library = folder / "shim.so"
    flags = ["-std=gnu99", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, "-o", library, SHIM, "-ldl"], check=True)
    return library


@dataclass(frozen=True)
class Blow:
    """Interruption of a job.

    Attributes:
        action: One of `ACTIONS`; "" lets the job run undisturbed.
        at: Its number of the calls that change a file.
        after_s: Or after this time, instead.
        workers: It happens to each process that the job starts, not to the job's own.
    """

    action: str = ""
    at: int = 0
    after_s: float | None = None
    workers: bool = False

    def __str__(self) -> str:
        when = f"call {self.at}" if self.after_s is None else f"{self.after_s:.3f} s"
        return f"{self.action} at {when}{' of a worker' if self.workers else ''}"


@dataclass(frozen=True)
class End:
    """End of a job: its exit status (-n: by signal n), its calls that change files, what it reported."""

    status: int
    calls: int
    reported: str


def adopt_orphans() -> None:
    """Processes that a killed job leaves become children of this one, which can then wait for their end."""
    if ctypes.CDLL(None).prctl(_SUBREAPER, 1, 0, 0, 0) != 0:
        raise OSError("this system has no PR_SET_CHILD_SUBREAPER")


def run(job: Job, below: Path, blow: Blow = Blow()) -> End:
    """Runs a job, to the end of the last process that it started."""
    errors, counter = os.memfd_create("errors"), os.memfd_create("calls")
    pid = os.fork()
    if pid == 0:
        _child(job, below, blow, errors, counter)
    timer = None
    if blow.after_s is not None:
        timer = threading.Timer(blow.after_s, _end, [pid, ACTIONS[blow.action]])
        timer.start()
    _, status = os.waitpid(pid, 0)
    if timer:
        timer.cancel()
        timer.join()
    _wait_for_orphans()
    reported = os.pread(errors, 2**20, 0).decode(errors="replace")
    calls = int.from_bytes(os.pread(counter, 8, 0), "little")
    os.close(errors)
    os.close(counter)
    return End(os.waitstatus_to_exitcode(status), calls, reported)


def _end(pid: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, number)


def _wait_for_orphans() -> None:
    """Nobody writes any more when this returns.

    Raises:
        RuntimeError: A process that a dead job started does not end.
    """
    begun = time.monotonic()
    with contextlib.suppress(ChildProcessError):
        while time.monotonic() - begun < _PATIENCE_S:
            pid, _ = os.waitpid(-1, os.WNOHANG)
            if pid == 0:
                time.sleep(0.005)
        raise RuntimeError(f"a process outlives its job by {_PATIENCE_S} s")


def _child(job: Job, below: Path, blow: Blow, errors: int, counter: int) -> None:
    """Never returns."""
    os.dup2(errors, 2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    shim = ctypes.CDLL(None)
    exit_code, number = 70, 0
    action = ACTIONS.get(blow.action, 0)
    try:
        raise_on_signals()
        if blow.workers:  # the shim arms itself in every program that is started with these
            os.environ.update(SHIM_BELOW=f"{below}/", SHIM_AT=str(blow.at), SHIM_ACTION=str(action))
            action = 0
        shim.shim_arm(os.fsencode(f"{below}/"), ctypes.c_long(blow.at), action)
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
    """Return the time that a job takes, s."""
    begun = time.monotonic()
    end = run(job, below)
    if end.status != 0:
        raise RuntimeError(f"the job failed by itself: {end.reported}")
    return time.monotonic() - begun
