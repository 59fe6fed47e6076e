"""Prove that the emitted C is what gyrotc made, and gives on every target bit for bit what the reference gives.

Makes every file of `DIR/c` again from `model.json` and compares it byte for byte; only then compiles them for each
target, runs the board test and compares every result word with what the reference computes.
"""

from __future__ import annotations

import itertools
import math
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from subprocess import DEVNULL, PIPE
from typing import Any

import numpy as np

from .. import __version__
from ..common.arrays import Progress
from ..common.errors import CheckFailed, GyrotcError, InputError
from ..mirror.q31 import exp2_table
from ..mirror.table import Table
from ..model import Model, load_model
from ..recordings.records import Dataset
from ..results.base import read_optional
from ..results.folder import scratch_folder
from ..results.release import (
    EmittedWith,
    MapError,
    Verification,
    VerifiedFile,
    VerifiedTarget,
    WorstError,
)
from ..tables.emission import expected_answers
from ..tables.quantisation import rms_growth
from ..tables.vectors import Vectors, make_vectors
from .board import board_entries, log_entries
from .emitted import (
    Job,
    board_files_again,
    c_hash,
    checked_sources,
    file_entries,
    made_again,
    shared_runtime_entries,
    table_files,
    texts_again,
)
from .replay import replay_dataset
from .toolchain import Target, all_targets, compile_objects, confined, end_all, link, runtime_object

__all__ = ["Visited", "chosen_targets", "file_entries", "verify", "visit_all"]

_SLICES = 128  # of exhaustive.c, which is written independently of libc/ but for the code under test
_BAR = 32  # characters
_LIMIT_S = 4 * 3600  # of processor time for one of the processes; all 2^32 inputs take minutes
_KEPT_LINES = 1000  # exhaustive.c prints fewer than ten
_COMPILERS = ("host-clang-O3", "host-gcc-O3")
_SOURCE = Path(__file__).resolve().parent / "exhaustive.c"


@dataclass(frozen=True, slots=True)
class Visited:
    """What came of visiting all pairs of positions.

    `worst_dph` is the largest departure from the model over all inputs that a pair stands for (at the
    corners of its cell), `arithmetic_dph` that at the middle of the cell, `mean_dph` the mean departure there.
    """

    inputs: int
    mismatches: int
    first: tuple[str, ...]
    worst_dph: float
    arithmetic_dph: float
    mean_dph: float


def visit_all(
    c_folder: Path,
    model: Model,
    table: Table,
    *,
    every: int = 1,
    trusted: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Visited:
    """Visits every pair of positions, or every `every`-th slice of slopes.

    Args:
        model: The model that the table was made of.
        table: Its fixed-point table.
        trusted: Code of the folder that is not gyrotc's is compiled and run, too.
        progress: Called with a line that shows the share done and the time left.

    Raises:
        CheckFailed: The emitted code does not compile, or the program failed.
        GyrotcError: There is no host compiler.
    """
    target = _host()
    with scratch_folder() as work:
        program = _compiled(target, c_folder, model, work, trusted=trusted)
        parts = os.cpu_count() or 1
        lines = list(_numbers(model, table))
        done = _Counter(progress or (lambda _: None))
        with ThreadPoolExecutor(max_workers=parts) as pool:
            results = list(
                pool.map(lambda part: _run(program, [f"{part} {parts} {every}", *lines], done), range(parts))
            )
    return _together(results)


def _host() -> Target:
    for name in _COMPILERS:
        target = all_targets()[name]
        if target.missing() is None:
            return target
    raise GyrotcError("no C compiler: install clang or gcc")


def _compiled(target: Target, c_folder: Path, model: Model, work: Path, *, trusted: bool) -> Path:
    c = checked_sources(c_folder, work, table_files(model), trusted=trusted)
    runtime = runtime_object(target, c, work, fresh=trusted).put(work / "gtc.o")
    emitted = [runtime, *compile_objects(target, [c / f"gtc_{model.id}.c"], work, include=c)]
    # The program itself is no code for targets: it may use what the host has.
    loose = target.model_copy(update={"flags": (*target.flags, "-ffast-math", "-Wno-error")})
    defines = [f"TABLE=gtc_{model.symbol}_q31", f'HEADER="gtc_{model.id}.h"']
    (own,) = compile_objects(loose, [_SOURCE], work, include=c, defines=defines)
    program = work / "exhaustive"
    link(target.model_copy(update={"link": (*target.link, "-lm")}), [own, *emitted], program)
    return program


def _numbers(model: Model, table: Table) -> Iterator[str]:
    """What exhaustive.c reads: integers of the table's words, then the model in float64."""
    per_block = model.block_s / 60.0
    low_t, high_t, low_r, high_r = table.numbers(table.envelope).tolist()
    gain_t, gain_r, narrow = table.scale
    center, half = model.scale.temperature_c
    half_r = model.scale.slope_c_per_min
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    yield f"{low_t} {high_t} {gain_t} {t0!r} {t1!r} {center!r} {half!r}"
    yield f"{low_r} {high_r} {gain_r} {r0 * per_block!r} {r1 * per_block!r} 0.0 {half_r * per_block!r}"
    yield f"{narrow} {' '.join(str(int(e)) for e in exp2_table())}"
    network = model.networks[0]
    own, w0, linear_t, linear_r, *_ = table.numbers(table.networks).tolist()
    yield f"{w0} {linear_t} {linear_r} {own} {len(network.weights)}"
    for record in table.numbers(table.records("centers"))[:own].tolist():
        yield " ".join(map(str, record))
    yield f"{table.coverage_cells[0]} {table.coverage_cells[1]}"
    yield " ".join(str(int(word)) for word in table.coverage)
    yield f"{2.0**-table.bias_frac_bits!r} {network.w0!r} {network.linear[0]!r} {network.linear[1]!r}"
    for (c_t, c_r), widths, weight in zip(network.centers, network.widths, network.weights, strict=True):
        inverse = [0.0 if width is None else 1.0 / width for width in widths]
        yield f"{(c_t - center) / half!r} {inverse[0]!r} {c_r / half_r!r} {inverse[1]!r} {weight!r}"


class _Counter:
    """Slices done, by all processes together, shown as a bar with the time that is left."""

    def __init__(self, progress: Callable[[str], None]) -> None:
        self._progress = progress
        self._done = 0
        self._start = time.monotonic()

    def one_more(self) -> None:
        self._done += 1
        share = self._done / _SLICES
        bar = "█" * round(_BAR * share) + "░" * (_BAR - round(_BAR * share))
        left = (time.monotonic() - self._start) * (1.0 - share) / share
        self._progress(f"every input: {share:.0%} {bar} {left:.0f} s left")


def _run(program: Path, lines: list[str], done: _Counter) -> list[str]:
    """Lines that one process printed, without its progress."""
    kept: list[str] = []
    with confined([str(program)], program.parent, stdin=PIPE, stdout=PIPE, stderr=DEVNULL, cpu_s=_LIMIT_S) as process:
        assert process.stdin is not None and process.stdout is not None
        with suppress(BrokenPipeError), process.stdin:  # its status says that it ended early
            process.stdin.write(("\n".join(lines) + "\n").encode("ascii"))
        for line in process.stdout:
            if line.startswith(b"progress"):
                done.one_more()
            elif len(kept) < _KEPT_LINES:
                kept.append(line.decode("ascii", "replace").strip())
        process.wait()
    if process.returncode != 0:
        raise CheckFailed(f"the visit of all inputs ended with status {process.returncode}")
    return kept


def _together(results: list[list[str]]) -> Visited:
    first = [line for lines in results for line in lines if line.startswith("differs")]
    words: list[list[Any]] = [lines[-1].split()[1:] for lines in results]
    inputs = sum(int(w[0]) for w in words)
    return Visited(
        inputs=inputs,
        mismatches=sum(int(w[1]) for w in words),
        first=tuple(first[:5]),
        worst_dph=max(float.fromhex(w[3]) for w in words),
        arithmetic_dph=max(float.fromhex(w[2]) for w in words),
        mean_dph=math.fsum(float.fromhex(w[4]) for w in words) / max(inputs, 1),
    )


# Between two looks at threads that are to end: a delay that nobody notices, and next to no work.
_NEXT_PROGRAM_S = 0.05


def verify(
    folder: Path,
    *,
    targets: Sequence[str] = (),
    dataset: Dataset | None = None,
    log: Path | None = None,
    exhaustive: bool = False,
    compiled: bool = True,
    trust_code: bool = False,
    progress: Progress | None = None,
) -> Verification:
    """Verifies `folder/c` against `folder/model.json`; what `verify.json` holds.

    Args:
        folder: What `build` or `emit` wrote.
        targets: Names of targets, or `all`; empty for the default ones, with `log` for none.
        dataset: Recordings to replay on every target besides.
        log: Output of a board test that ran elsewhere. Its entries join those of an earlier
            `verify.json` of the same model and code; later calls keep them.
        exhaustive: Visit every input of the fixed-point table besides.
        compiled: False: no target; files and bounds are checked against model and reference alone.
        trust_code: Compile and run `folder/c` although it holds code that gyrotc did not write.
        progress: Called with the name of each target before it is tried.

    Raises:
        InputError: No emitted code, an unknown target, an unreadable log, no table to visit all inputs of.
        CheckFailed: The log is not whole, or of another model.
    """
    say = progress or (lambda _: None)
    model = load_model(folder / "model.json")
    chosen = chosen_targets(targets) if compiled and (targets or log is None) else []
    say("comparing files")
    options, emission = made_again(folder / "c", model)
    tables = emission.tables
    if exhaustive and "q31" not in tables:
        raise InputError("--exhaustive", f"{folder / 'c'} has no fixed-point table", "one emitted with q31")
    vectors = make_vectors(model, tuple(tables))
    tests = board_files_again(model, emission) if options.runtime and compiled else {}
    job = Job(folder / "c", model, tables, expected_answers(model, emission), trust_code, tests)
    texts = texts_again(model, options, emission)
    emitted = tuple(file_entries(job.c_folder, texts))
    if options.runtime and compiled:
        emitted += tuple(shared_runtime_entries(job.c_folder, model, options.runtime))
    wrong = [file.file for file in emitted if file.status == "fail"]
    barred = wrong and not trust_code
    identity = (model.hash, c_hash(folder / "c"))
    entries, brought = log_entries(job, vectors, log) if log is not None else ([], None)
    entries += _barred(job, chosen, wrong) if barred else _test_all(job, chosen, say)
    if dataset is not None and not barred:
        entries = replay_dataset(job, entries, chosen, dataset, say)
    entries = _merged(_earlier(folder, identity, boards_only=log is None), entries)
    exact = options.shifted(model)
    errors = [_error(job, exact, vectors, numeric) for numeric in tables]
    if exhaustive and not barred:
        errors = [_every_input(job, exact, say) if e.numeric == "q31" else e for e in errors]
    passed, failed, missing = _counts(entries, [*emitted, *errors], set(targets))
    return Verification(
        gyrotc_version=__version__,
        serial=model.serial,
        axis=model.axis,
        model_hash=identity[0],
        c_hash=identity[1],
        passed=passed,
        failed=failed,
        missing=missing,
        targets=tuple(entries),
        log=brought,
        options=EmittedWith(numeric=options.numeric, zero_at_c=options.zero_at_c),
        emitted=tuple(emitted),
        errors=tuple(errors),
        error_bound_dph=max(e.bound_dph for e in errors),
        worst_error_dph=WorstError(
            value=max(e.worst_dph for e in errors), inputs_visited=max(e.inputs_visited for e in errors)
        ),
    )


def chosen_targets(names: Sequence[str]) -> list[Target]:
    """The targets of these names or of `all`; without a name Cortex-M4F and one host.

    Raises:
        InputError: A name is not known.
    """
    known = all_targets()
    for name in names:
        if name != "all" and name not in known:
            raise InputError("--target", repr(name), ", ".join([*known, "all"]))
    if not names:
        return [t for t in known.values() if t.default]
    return [t for t in known.values() if "all" in names or t.name in names]


def _barred(job: Job, targets: Sequence[Target], wrong: Sequence[str]) -> list[VerifiedTarget]:
    """Entries of targets for which nothing was compiled: files that differ are code of somebody else."""
    more = f" (and {len(wrong) - 1} more files)" if len(wrong) > 1 else ""
    reason = f"not compiled: {wrong[0]} is not what gyrotc makes of this model{more}"
    pairs = [(t.name, n) for t in targets for n in job.tables if n in t.numerics]
    return [VerifiedTarget(name=name, numeric=n, status="fail", error=reason) for name, n in pairs]


def _test_all(job: Job, targets: Sequence[Target], progress: Progress) -> list[VerifiedTarget]:
    """Entries in the order of the targets; compilers and emulators run side by side."""

    begun = itertools.count(1)

    def one(target: Target) -> list[VerifiedTarget]:
        progress(f"{target.name}, target {next(begun)} of {len(targets)}")
        return board_entries(job, target)

    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        tests = [pool.submit(one, target) for target in targets]
        try:
            entries = []
            for test in tests:
                # In steps: a signal that comes just before a wait without end is handled only after it.
                while not test.done():
                    wait([test], timeout=_NEXT_PROGRAM_S)
                entries += test.result()
            return entries
        except BaseException:  # one failed, or the user stops: the others end now, not with their queue
            pool.shutdown(wait=False, cancel_futures=True)
            while not all(test.done() for test in tests):  # a thread may go on with a next program
                end_all()
                wait(tests, timeout=_NEXT_PROGRAM_S)
            raise


def _earlier(folder: Path, identity: tuple[str, str], *, boards_only: bool) -> list[VerifiedTarget]:
    """Entries of an earlier `verify.json` that still hold: same model, same code."""
    try:
        earlier = read_optional(folder / "verify.json", Verification)
    except InputError:
        return []
    if earlier is None or (earlier.model_hash, earlier.c_hash) != identity:
        return []
    return [entry for entry in earlier.targets if entry.log is not None or not boards_only]


def _merged(earlier: list[VerifiedTarget], entries: list[VerifiedTarget]) -> list[VerifiedTarget]:
    new = {(entry.name, entry.numeric) for entry in entries}
    return [entry for entry in earlier if (entry.name, entry.numeric) not in new] + entries


def _counts(
    entries: Sequence[VerifiedTarget], checks: Sequence[VerifiedFile | MapError], named: set[str]
) -> tuple[int, int, int]:
    """Targets passed, failed, missing. A named target that is missing has failed, and so has a check."""
    status = [entry.status for entry in entries]
    absent = sum(entry.status == "missing" and entry.name in named for entry in entries)
    wrong = sum(check.status == "fail" for check in checks)
    return status.count("pass"), status.count("fail") + absent + wrong, status.count("missing")


def _error(job: Job, model: Model, vectors: Vectors, numeric: str) -> MapError:
    """Largest departure of the emitted map from the float64 model over the map vectors, and the bound."""
    table = job.tables[numeric]
    inputs = table.decode_inputs(vectors.map_inputs(numeric))
    status, bits = job.expected[numeric][1 : 1 + len(inputs)].T
    usable = (status < 2**31) & np.all(np.isfinite(inputs), axis=1)
    got = table.decode_bias(bits[usable])
    t, slope = inputs[usable].T
    exact = model.map_dph(t, slope * 60.0 / model.block_s)
    worst = float(np.max(np.abs(got - exact), initial=0.0))
    return MapError(
        numeric=numeric,
        status="pass" if worst <= table.error_bound_dph else "fail",
        bound_dph=table.error_bound_dph,
        rms_growth=rms_growth(model, table),
        worst_dph=worst,
        inputs_visited=int(usable.sum()),
    )


def _every_input(job: Job, model: Model, progress: Progress) -> MapError:
    """The same for every input of the fixed-point table."""
    table = job.tables["q31"]
    visited = visit_all(job.c_folder, model, table, trusted=job.trusted, progress=progress)
    sound = visited.mismatches == 0 and visited.worst_dph <= table.error_bound_dph
    return MapError(
        numeric="q31",
        status="pass" if sound else "fail",
        bound_dph=table.error_bound_dph,
        rms_growth=rms_growth(model, table),
        worst_dph=visited.worst_dph,
        arithmetic_dph=visited.arithmetic_dph,
        mean_dph=visited.mean_dph,
        inputs_visited=visited.inputs,
        mismatches=visited.mismatches,
        first_mismatches=tuple(visited.first),
    )
