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
from ..page import Figure, ResultsTable, figures_table
from ..records import ROOT, Record
from .driver import ACTIONS, compiled_shim

_COMMANDS = 300
_TEXT = """
{ended:,} jobs are interrupted by a signal (KILL, TERM, INT) or by a disk error (EIO; ENOSPC from then on) at one of
their calls that change a file; commands also by a signal at a random time, and `fleet` in its worker processes too.
Each way of writing is interrupted at {calls}, with and without an exchange of names. Wrong is a result that is
neither the earlier one nor the new one, or anything left after the next job. Without an exchange of names, a disk on
which every call fails from the second rename on leaves the place empty until the next job, which counts as wrong.
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
    """Return how many interrupted jobs left a wrong result."""
    every = record.get("every", 1)
    calls = "every call" if every == 1 else f"one call in {every}"
    figures = []
    for name, counted in record["counts"].items():
        ended = sum(counted.get(action, 0) for action in ACTIONS)
        figures.append((f"wrong results, {name}, of {ended:,} interrupted", Figure(counted["wrong"], at_most=0)))
    return figures_table(_TEXT.format(ended=record["ended"], calls=calls), figures)
