"""Jobs that a signal ends, or that the disk lets down, at one of their calls that change a file.

Wrong is a result that is neither the earlier one nor the new one to the byte, a summary of a fleet that says of a gyro
what its result does not hold, anything that is left after the next job (after TERM and INT: by the job itself), a
traceback, and a next job that fails.
"""

from __future__ import annotations

import json
import os
import secrets
import subprocess
import sys
import tempfile
from pathlib import Path

from ..campaigns import Settings, say
from ..page import Figure, ResultsTable
from ..records import ROOT, Record
from .driver import ACTIONS, compiled_shim

_COMMANDS = 300
_TEXT = """
{ended:,} jobs are interrupted by a signal (KILL, TERM, INT) or by a disk error (EIO; ENOSPC from then on) at one of
their calls that change a file; commands also by a signal at a random time, and `fleet` in its worker processes too.
Each way of writing (a folder, one entry, several entries, a part of a folder, a file) is interrupted at {calls}, with
and without an exchange of names. Wrong: a result that is neither the earlier one nor the new one, or anything left
after the next job. Without an exchange of names, a disk that is full between the two renames leaves the place empty
until the next job, which counts as wrong. Interrupted commands: {commands}.
"""


def measure(settings: Settings) -> Record:
    """End jobs in a process that has the shim preloaded, which counts and stops calls that change files."""
    seed = secrets.randbits(32) if settings.seed is None else settings.seed
    say(f"seed {seed}")
    commands, every = (10, 101) if settings.quick else (_COMMANDS, 1)
    with tempfile.TemporaryDirectory(prefix="gyrotc-kills-") as work:
        environment = os.environ | {"LD_PRELOAD": str(compiled_shim(Path(work)))}
        command = [sys.executable, "-m", "bench.kills.run", "--commands", str(commands), "--every", str(every)]
        done = subprocess.run(
            [*command, "--seed", str(seed)], cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True, check=True
        )
    record: Record = json.loads(done.stdout) | {"every": every}
    return record


def table(record: Record) -> ResultsTable:
    """Return how many jobs were ended in which way."""
    of_commands = sorted(record["counts"]["commands"].items())
    commands = {name: count for name, count in of_commands if name not in (*ACTIONS, "calls", "wrong")}
    words = ", ".join(f"`{name}` {count}" for name, count in commands.items())
    rows = []
    for name, counted in record["counts"].items():
        ended = (counted.get(action, 0) for action in ACTIONS)
        rows.append((name, counted.get("calls", ""), *ended, Figure(counted["wrong"], at_most=0)))
    head = ("interrupted", "calls ", *(f"{action} " for action in ACTIONS), "wrong ")
    every = record.get("every", 1)
    calls = "every call" if every == 1 else f"one call in {every}"
    return ResultsTable(_TEXT.format(ended=record["ended"], calls=calls, commands=words), head, rows)
