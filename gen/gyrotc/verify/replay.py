"""Recordings through the compiled code of targets, compared bit for bit with the reference.

A recording goes in as 32-bit words of the target's byte order over standard input (for bare metal: a
file of the emulator's host), and so come the results out.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed, InputError
from ..common.progress import Progress
from ..mirror.front_end import blocks_since_power_on, missed_before, period_us, samples_per_block
from ..mirror.history import FollowedHistory, Replay, follow_history
from ..mirror.table import Table, Words
from ..model import Model
from ..recordings.records import Dataset, Rows, Run
from ..results.files import write_own
from ..results.folder import scratch_folder
from ..results.release import ReplayedRows, VerifiedTarget
from ..results.templates import c_templates
from ..tables.quantisation import channels_of
from .emitted import Job, checked_sources, table_files
from .toolchain import Target, compile_objects, link, run_program, runtime_object, shared_object

_SHOWN_MISMATCHES = 5  # enough to see a pattern
_PART = 2**16  # rows that are answered together: bounds memory
_MOST_MISSED = 2**32 - 1  # samples between two readings, which the runtime counts in 32 bits


@dataclass(frozen=True, slots=True)
class ReplayCase:
    """A recording as the runtime sees it, and what it must answer.

    Bits of every row's channels, shape (n, n_channels); samples missed before each row, shape (n,).
    """

    channels: Words
    missed: NDArray[np.int64]
    samples_per_block: int
    period_us: int
    reference: FollowedHistory

    def parts(self) -> Iterator[slice]:
        """The rows, part by part."""
        return (slice(at, min(at + _PART, len(self.missed))) for at in range(0, len(self.missed), _PART))


@dataclass(frozen=True, slots=True)
class ReplayedPart:
    """Answers of the compiled code to some rows.

    Attributes:
        rows: Which of the file.
        reference: What it must answer.
        bits: Of the bias in force after each row.
        status: In force after each row.
        wrong: Rows of the part that differ from the reference in any bit.
        words: Status of the sample, status in force and bits, three arrays, as they came.
    """

    rows: slice
    reference: Replay
    bits: Words
    status: NDArray[np.int32]
    wrong: NDArray[np.intp]
    words: Words

    def differences(self) -> Iterator[str]:
        """Yield the differences in words, with the number of the row."""
        for row in self.wrong.tolist():
            texts = [
                " ".join(f"{int(words[row]):08x}" for words in side) for side in (self.words, _words_of(self.reference))
            ]
            yield f"row {self.rows.start + row}: statuses and bits {texts[0]}, reference {texts[1]}"


def _words_of(answers: Replay) -> tuple[Words, Words, Words]:
    return answers.sample_status.view(np.uint32), answers.status.view(np.uint32), answers.bits


def replay_case_of(rows: Rows, run: Run, model: Model, table: Table) -> ReplayCase:
    """Bits and answers of a recording.

    Where a term counts from power-on and this was before the first row, the blocks between are missing samples.

    Raises:
        InputError: It lacks a channel that a term of the model needs.
    """
    channels, missed, per_block = replay_inputs(rows, run, model, table)
    answers = follow_history(table, channels, missed=missed, samples_per_block=per_block)
    return ReplayCase(channels, missed, per_block, period_us(table.block_us, per_block), answers)


def replay_inputs(rows: Rows, run: Run, model: Model, table: Table) -> tuple[Words, NDArray[np.int64], int]:
    """Bits of a recording's channels, samples missed before each row, and samples per block, as of `ReplayCase`."""
    channels = channels_of(rows, model, table)
    missed = missed_before(rows.time_s, run.row_period_s)
    per_block = samples_per_block(model.block_s, run.row_period_s)
    if any(term.cause.needs.power_on for term in model.terms):
        before = per_block * max(blocks_since_power_on(rows, run, model.block_s), 0)
        if before > _MOST_MISSED:
            found = f"power-on {before * run.row_period_s:.4g} s before the first row"
            raise InputError(run.file, found, f"at most {_MOST_MISSED} rows of {run.row_period_s:.4g} s")
        missed = np.append(before, missed[1:])
    return channels, missed, per_block


@contextmanager
def replay_program(
    c_folder: Path, model: Model, table: Table, target: Target, *, trusted: bool = False
) -> Iterator[Path]:
    """The replay program of a table, compiled for a target.

    Raises:
        CheckFailed: The compiler refused, or the folder holds other code than gyrotc's and is not `trusted`.
    """
    text = (
        c_templates()
        .get_template("replay.c.j2")
        .render(
            id=model.id,
            symbol=model.symbol,
            n=table.numeric,
            n_channels=table.n_channels,
            has_time="time" not in model.left_out,
        )
    )
    with scratch_folder() as work:
        source = work / "replay.c"
        write_own(source, text)
        program = work / "replay"
        c = checked_sources(c_folder, work, table_files(c_folder, model, (table.numeric,)), trusted=trusted)
        runtime = runtime_object(target, c, table.numeric, work, fresh=trusted)
        emitted = shared_object(target, c / f"gtc_{model.id}.c", work, include=c, fresh=trusted)
        own = compile_objects(target, [source], work, include=c)
        link(target, [runtime.put(work / "gtc.o"), emitted.put(work / "table.o"), *own], program)
        yield program


def replay_on(target: Target, program: Path, history: ReplayCase) -> Iterator[ReplayedPart]:
    """Feed a recording to the compiled code, part by part, and compare every step with the reference.

    Raises:
        CheckFailed: The program did not run to its end.
    """
    word = np.dtype("<u4" if target.byte_order == "little" else ">u4")
    n = len(history.missed)
    with tempfile.TemporaryFile() as printed:
        done = run_program(target, program, _stream(history, word), printed)
        size = printed.seek(0, os.SEEK_END)
        if done.returncode != 0 or size != 12 * n:
            raise CheckFailed(
                f"the replay ended with status {done.returncode} after {size // 12} of {n} rows {done.stderr[:200]}"
            )
        printed.seek(0)
        for rows in history.parts():
            answers = history.reference.rows(rows)
            got = np.frombuffer(printed.read(12 * (rows.stop - rows.start)), dtype=word).reshape(-1, 3).T
            different = np.any([a != b for a, b in zip(got, _words_of(answers), strict=True)], axis=0)
            bits, status = got[2].astype(np.uint32), got[1].astype(np.uint32).view(np.int32)
            yield ReplayedPart(rows, answers, bits, status, np.flatnonzero(different), got)


def _stream(history: ReplayCase, word: np.dtype[np.uint32]) -> Iterator[bytes]:
    """Standard input of the replay program."""
    yield np.array([history.period_us, len(history.missed)], dtype=word).tobytes()
    for part in history.parts():
        yield np.column_stack([history.missed[part], history.channels[part]]).astype(word).tobytes()


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
            for part in replay_on(self.target, self.program, history):
                self.mismatches += part.wrong.size
                room = _SHOWN_MISMATCHES - len(self.first)
                self.first += [f"{file}, {text}" for text in islice(part.differences(), room)]
        except CheckFailed as error:
            self.error = f"{file}: {error}"
            return
        self.runs += 1
        self.rows += len(history.missed)


def replay_dataset(
    job: Job,
    entries: Sequence[VerifiedTarget],
    targets: Sequence[Target],
    dataset: Dataset,
    progress: Progress,
) -> list[VerifiedTarget]:
    """Replay every run on every target whose board test ran; return the entries, theirs with `replayed`."""
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
        for k, run in enumerate(dataset.runs):
            progress(f"replaying {run.file}", k, len(dataset.runs))
            rows = run.rows()
            for table in job.tables.values():
                history = replay_case_of(rows, run, job.model, table)
                same = [lane for lane in lanes.values() if lane.table is table]
                list(pool.map(lambda lane, h=history, file=run.file: lane.run(file, h), same))
            del rows, history  # before those of the next run are read
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
