"""Recordings, and drawn calls of learning, through the compiled code of targets, compared bit for bit.

A recording goes in as 32-bit words of the target's byte order over standard input (for bare metal: a
file of the emulator's host), and so come the results out.

Learning in service: the gyro learns over some power-ons, saves, is cut off in a write after every number of words,
takes back what it kept before, and goes on.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed, InputError
from ..common.texts import c_environment
from ..mirror.front_end import blocks_since_power_on, missed_before, period_us, samples_per_block
from ..mirror.history import FollowedHistory, Replay, followed
from ..mirror.learning import KEPT_WORDS, KNOTS, Learner, ServicePrior, Stop
from ..mirror.table import Table, Words
from ..model import Model
from ..recordings.records import Dataset, Rows, Run
from ..results.files import write_own
from ..results.folder import scratch_folder
from ..results.release import LearnedCalls, ReplayedRows, VerifiedTarget
from ..tables.quantise import channels_of
from .emitted import Job, checked_sources, table_files
from .toolchain import Target, compile_objects, link, run_program, runtime_object

_SHOWN_MISMATCHES = 5  # enough to see a pattern
_PART = 2**16  # rows that are answered together: bounds memory
_MOST_MISSED = 2**32 - 1  # what gtc_<n>_missed counts


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
    """What the compiled code answered to some rows.

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
        """In words, with the number of the row."""
        for row in self.wrong.tolist():
            texts = [
                " ".join(f"{int(words[row]):08x}" for words in side) for side in (self.words, _words_of(self.reference))
            ]
            yield f"row {self.rows.start + row}: statuses and bits {texts[0]}, reference {texts[1]}"


def _words_of(answers: Replay) -> tuple[Words, Words, Words]:
    return answers.sample_status.view(np.uint32), answers.status.view(np.uint32), answers.bits


def history_of(rows: Rows, run: Run, model: Model, table: Table) -> ReplayCase:
    """Bits and answers of a recording.

    Where a term counts from power-on and this was before the first row, the blocks between are missing samples.

    Raises:
        InputError: It lacks a channel that a term of the model needs.
    """
    channels, missed, per_block = inputs_of(rows, run, model, table)
    answers = followed(table, channels, missed=missed, samples_per_block=per_block)
    return ReplayCase(channels, missed, per_block, period_us(table.block_us, per_block), answers)


def inputs_of(rows: Rows, run: Run, model: Model, table: Table) -> tuple[Words, NDArray[np.int64], int]:
    """Bits of a recording's channels, samples missed before each row, and samples per block, as of `ReplayCase`."""
    channels = channels_of(rows, model, table)
    missed = missed_before(rows.time_s, run.row_period_s)
    per_block = samples_per_block(model.block_s, run.row_period_s)
    if any(term.cause.needs.power_on for term in model.terms):
        before = per_block * blocks_since_power_on(rows, run, model.block_s)
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
        c_environment()
        .get_template("replay.c.j2")
        .render(id=model.id, symbol=model.symbol, n=table.numeric, n_channels=table.n_channels)
    )
    with scratch_folder() as work:
        source = work / "replay.c"
        write_own(source, text)
        program = work / "replay"
        c = checked_sources(c_folder, work, table_files(model), trusted=trusted)
        runtime = runtime_object(target, c, work, fresh=trusted)
        objects = compile_objects(target, [source, c / f"gtc_{model.id}.c"], work, include=c)
        link(target, [runtime.put(work / "gtc.o"), *objects], program)
        yield program


def replay_on(target: Target, program: Path, history: ReplayCase) -> Iterator[ReplayedPart]:
    """Feeds a recording to the compiled code and compares every step with the reference; part by part.

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


_SEED = 20140904  # of the calls: the same for every table
_SHOWN = 5  # mismatches
_START, _POWER_ON, _REST, _SHIFT, _SAVE, _TORN, _BEFORE = range(7)  # calls of learn.c.j2
_NAMES = ("start", "power_on", "rest", "shift", "save", "restore of a torn write", "restore")
_POWER_ONS, _RESTS = 4, 9  # the least that pass each gate, and are refused by it


@dataclass(frozen=True, slots=True)
class _Call:
    kind: int
    numbers: tuple[float, ...] = ()
    whole: int = 0  # words of a torn write, or whether a rest is confirmed

    def words(self) -> list[int]:
        numbers = np.array(self.numbers, dtype=np.float32).view(np.uint32).tolist()
        found = [self.kind, *([self.whole] if self.kind == _TORN else [*numbers, self.whole])]
        return [*found, *[0] * (9 - len(found))]


def drawn_calls(prior: ServicePrior) -> list[_Call]:
    """Power-ons with rests that are accepted, and that each gate refuses; a save after each."""
    draw = np.random.default_rng(_SEED)
    high = prior.low_c + (KNOTS - 1) / prior.knots_per_c
    sigma = float(np.sqrt(prior.map_var[0] + prior.power_on_var[0] + prior.power_on_var[3]))
    calls = [_Call(_START)]

    def one_power_on() -> Iterator[_Call]:
        temp_c, time_s = draw.uniform(prior.low_c, high), prior.settle_s
        yield _Call(_POWER_ON, (float(draw.choice([np.nan, 5e4])), temp_c))
        for k in range(_RESTS):
            time_s += 10.0 ** draw.uniform(0, 4)
            temp_c = float(np.clip(temp_c + draw.normal(0, 8), prior.low_c - 5, high + 5))
            size = (1.0, 1.0, 1.0, 30.0)[k % 4]  # a wrong one now and then
            span_c = prior.span_c * (1.0 if k else 2.0)
            earth_var = np.nan if k == 1 else (0.1 * sigma) ** 2
            rate = size * draw.normal(0, sigma)
            yield _Call(_REST, (time_s, temp_c, span_c, rate, 600.0, 0.0, earth_var), int(k == 7))
            yield _Call(_SHIFT, (time_s + draw.uniform(0, 900), temp_c + draw.normal(0, 3)))

    for _ in range(_POWER_ONS):
        calls += [*one_power_on(), _Call(_SAVE)]
    calls += [_Call(_TORN, whole=n) for n in range(KEPT_WORDS + 1)]
    return [*calls, _Call(_BEFORE), *one_power_on(), _Call(_SAVE)]


def expected_words(prior: ServicePrior, calls: Sequence[_Call]) -> Words:
    """What learn.c must answer, a row for each call."""
    learner = Learner(prior)
    kept = [[0] * KEPT_WORDS, [0] * KEPT_WORDS]
    shift = np.zeros(2, dtype=np.float32)
    rows = []
    for call in calls:
        status, numbers = 0, call.numbers
        if call.kind == _START:
            learner = Learner(prior)
        elif call.kind == _POWER_ON:
            learner.power_on(*numbers)
        elif call.kind == _REST:
            time_s, temp_c, span_c, rate, duration_s, mean_var, earth_var = numbers
            stop = Stop(time_s, temp_c, rate, duration_s, span_c, mean_var, earth_var, bool(call.whole))
            status = int(learner.rest(stop)[0])
        elif call.kind == _SHIFT:
            shift = np.concatenate(learner.shift(*numbers))
        elif call.kind == _SAVE:
            kept = [kept[1], learner.save()]
        elif call.kind == _TORN:
            status = Learner(prior).restore(kept[1][: call.whole] + kept[0][call.whole :])
        else:
            status = learner.restore(kept[0])
        state = np.concatenate([learner.x[:, 0], learner.p[:, 0]]).view(np.uint32).tolist()
        rows.append([status & 0xFFFFFFFF, *state, *kept[1], *shift.view(np.uint32).tolist()])
    return np.array(rows, dtype=np.uint32)


def learned_on(
    target: Target, model: Model, prior: ServicePrior, c: Path, objects: Sequence[Path], work: Path
) -> LearnedCalls:
    """Runs the calls on a target.

    Args:
        objects: Runtime and table.

    Raises:
        CheckFailed: The compiler refused, or the program did not run to its end.
    """
    source = work / "learn.c"
    text = c_environment().get_template("learn.c.j2").render(id=model.id, symbol=model.symbol)
    write_own(source, text)
    own = compile_objects(target, [source], work, include=c)
    link(target, [*own, *objects], work / "learn")
    calls = drawn_calls(prior)
    expected = expected_words(prior, calls)
    word = np.dtype("<u4" if target.byte_order == "little" else ">u4")
    given = np.array([len(calls), *(w for call in calls for w in call.words())], dtype=word)
    done = run_program(target, work / "learn", [given.tobytes()])
    if done.returncode != 0 or len(done.stdout) != 4 * expected.size:
        raise CheckFailed(f"the test of learning ended with status {done.returncode} {done.stderr[:200]}")
    got = np.frombuffer(done.stdout, dtype=word).astype(np.uint32).reshape(expected.shape)
    wrong = np.flatnonzero((got != expected).any(axis=1))
    first = tuple(
        f"call {k}, {_NAMES[calls[k].kind]}: word {at} is {int(got[k, at]):08x}, reference {int(expected[k, at]):08x}"
        for k in wrong[:_SHOWN].tolist()
        for at in [int(np.argmax(got[k] != expected[k]))]
    )
    return LearnedCalls(calls=len(calls), words=expected.size, mismatches=wrong.size, first_mismatches=first)
