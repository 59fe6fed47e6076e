"""Programs that are compiled or run for others: in a folder of their own, with limits, and with nothing of the user's.

What is compiled and run may be somebody else's. Every command runs in the folder of its work, with an environment of
its own, limits of time, memory and file size, no core dumps, and all of its processes end with it.
"""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from ..common.errors import CheckFailed

__all__ = ["LIMIT_S", "ProgramRun", "confined", "end_all", "run_to_end"]

LIMIT_S = 600  # s, elapsed: docs/design.md, "Trust"
# Of each process. Data: four times what a compiler at -O3 or an emulator with its translations takes (below 0.5 GiB).
# Addresses: qemu-user reserves the 4 GiB of a 32-bit processor, which are addresses without memory behind them.
# A file: the answers to a recording of 350 million rows. Shells count in KiB, and files in blocks of 512 bytes.
_LIMITS = {"c": 0, "d": 2 * 2**20, "v": 16 * 2**20, "f": 8 * 2**20}
_SAID_BYTES = 64 * 2**20  # kept of what a program says on stderr

Stream = IO[bytes] | int

_groups: set[int] = set()  # of processes that run now


@dataclass(frozen=True, slots=True)
class ProgramRun:
    """How a program ended and what it printed."""

    returncode: int
    stdout: bytes
    stderr: str


@contextmanager
def confined(
    command: Sequence[str], folder: Path, *, stdin: Stream, stdout: Stream, stderr: Stream, cpu_s: int
) -> Iterator[subprocess.Popen[bytes]]:
    """A process in `folder`, whose whole group ends with the block.

    A shell sets the limits, those that the system has: what Python does between fork and exec is not safe with threads.
    """
    limits = "; ".join(f"ulimit -{option} {n} 2>/dev/null" for option, n in {**_LIMITS, "t": cpu_s}.items())
    process = subprocess.Popen(
        ["/bin/sh", "-c", f'{limits}; exec "$@"', "sh", *command],
        cwd=folder,
        env=_environment(folder.absolute()),
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        start_new_session=True,
    )
    _groups.add(process.pid)
    try:
        yield process
    finally:
        _groups.discard(process.pid)
        _end(process.pid)
        process.wait()
        for pipe in (process.stdin, process.stdout, process.stderr):
            if pipe is not None:
                with suppress(BrokenPipeError):  # what was still to be written to it
                    pipe.close()


def end_all() -> None:
    """Ends what other threads run: the job is interrupted, and nobody waits for it any more."""
    for group in tuple(_groups):
        _end(group)


def _end(group: int) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def run_to_end(
    command: Sequence[str], folder: Path, what: str, stdin: Stream = subprocess.DEVNULL
) -> ProgramRun:
    """Runs a command in `folder` to its end.

    Raises:
        CheckFailed: It did not end; `what` says in words who it is.
    """
    # Files, not pipes: a recording goes in and comes out, and is in memory once.
    with tempfile.TemporaryFile() as stdout, tempfile.TemporaryFile() as stderr:
        # The clock ends it; the limit of processor time is for what escapes the clock, and must not come first.
        with confined(
            command, folder, stdin=stdin, stdout=stdout, stderr=stderr, cpu_s=2 * LIMIT_S
        ) as process:
            try:
                process.wait(LIMIT_S)
            except subprocess.TimeoutExpired as error:
                raise CheckFailed(f"{what} did not end within {LIMIT_S} s") from error
        for stream in (stdout, stderr):
            stream.seek(0)
        return ProgramRun(
            process.returncode, stdout.read(), stderr.read(_SAID_BYTES).decode("utf-8", "replace")
        )


def _environment(folder: Path) -> dict[str, str]:
    """All that a compiler or a program sees of the user's environment: where programs are."""
    path = os.environ.get("PATH", os.defpath)
    return {"PATH": path, "HOME": str(folder), "TMPDIR": str(folder), "LANG": "C", "LC_ALL": "C"}
