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
Jobs that end by a signal (KILL, TERM, INT), or that the disk lets down (EIO; ENOSPC from then on), at one of their
calls that change a file; commands also by a signal at a random time, `fleet` also in the processes that it starts. Each
way of writing (a folder, one entry, several entries, a part in a folder, a file) is ended at every call. {ended:,} jobs
ended. Wrong is whatever is neither the earlier result nor the new one. Commands: {commands}.
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
    record: Record = json.loads(done.stdout)
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
    head = ("what", "calls ", *(f"{action} " for action in ACTIONS), "wrong ")
    return ResultsTable(_TEXT.format(ended=record["ended"], commands=words), head, rows)
