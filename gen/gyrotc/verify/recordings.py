"""Recordings replayed on several targets: each file is read once, and kept no longer than needed."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from ..common.errors import CheckFailed
from ..recordings.records import Dataset
from ..results.verification import ReplayedRows, VerifiedTarget
from ..target.table import Table
from .board import Job
from .replay import ReplayCase, history_of, replay_on, replay_program
from .toolchain import Target

__all__ = ["replay_dataset"]

_SHOWN_MISMATCHES = 5  # enough to see a pattern


@dataclass(slots=True)
class _Lane:
    """One table on one target: its program, and what came of it so far."""

    target: Target
    table: Table
    program: Path | None = None
    rows: int = 0
    runs: int = 0
    mismatches: int = 0
    first: list[str] = field(default_factory=list)
    error: str | None = None

    def run(self, file: str, history: ReplayCase) -> None:
        if self.program is None or self.error is not None:
            return
        try:
            replayed = replay_on(self.target, self.program, history)
        except CheckFailed as error:
            self.error = f"{file}: {error}"
            return
        self.runs += 1
        self.rows += len(history.missed)
        self.mismatches += replayed.mismatches
        room = _SHOWN_MISMATCHES - len(self.first)
        self.first += [f"{file}, {text}" for text in replayed.first[:room]]


def replay_dataset(
    job: Job,
    entries: Sequence[VerifiedTarget],
    targets: Sequence[Target],
    dataset: Dataset,
    progress: Callable[[str], None],
) -> list[VerifiedTarget]:
    """Replays every run on every target whose board test ran; the entries, with `replayed` in theirs."""
    with ExitStack() as stack, ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        lanes = {}
        for number, entry in enumerate(entries):
            target = next((t for t in targets if t.name == entry.name), None)
            if target is not None and entry.status != "missing" and target.reads_input:
                lanes[number] = _Lane(target, job.tables[entry.numeric])
        for lane in lanes.values():
            try:
                lane.program = stack.enter_context(
                    replay_program(job.c_folder, job.model, lane.table, lane.target, trusted=job.trusted)
                )
            except CheckFailed as error:
                lane.error = str(error)
        for k, run in enumerate(dataset.runs, 1):
            progress(f"replaying {run.file}, {k} of {len(dataset.runs)}")
            rows = run.rows()
            for table in job.tables.values():
                history = history_of(rows, run, job.model, table)
                same = [lane for lane in lanes.values() if lane.table is table]
                list(pool.map(lambda lane, h=history, file=run.file: lane.run(file, h), same))
    return [_entered(entry, lanes.get(number)) for number, entry in enumerate(entries)]


def _entered(entry: VerifiedTarget, lane: _Lane | None) -> VerifiedTarget:
    if lane is None:
        return entry
    replayed = ReplayedRows(
        runs=lane.runs, rows=lane.rows, mismatches=lane.mismatches, first_mismatches=tuple(lane.first)
    )
    if lane.error is not None:
        replayed = replayed.model_copy(update={"error": lane.error})
    status = "fail" if lane.error is not None or lane.mismatches else entry.status
    return entry.model_copy(update={"replayed": replayed, "status": status})
