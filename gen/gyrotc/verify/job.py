"""Prove that the emitted C is what gyrotc made, and gives on every target bit for bit what the reference gives.

Makes every file of `DIR/c` again from `model.json` and compares it byte for byte; only then compiles them for each
target, runs the board test and compares every result word with what the reference computes.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path

import numpy as np

from .. import __version__
from ..common.errors import InputError, quoted
from ..common.progress import Progress, Stages, silent
from ..model import Model, load_model
from ..recordings.records import Dataset
from ..results.base import read_optional
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
    c_hash,
    file_entries,
    made_again,
    shared_runtime_entries,
    texts_again,
)
from .exhaustive import visit_all
from .replay import replay_dataset
from .toolchain import Target, all_targets, end_all

__all__ = ["chosen_targets", "verify"]

# Shares of the time, as `gyrotc verify -v` measures it.
_STAGES = {"comparing files": 0.05, "testing": 0.75, "replaying": 0.1, "visiting every input": 0.1}

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
    progress: Progress = silent,
) -> Verification:
    """Verify `folder/c` against `folder/model.json`; return the content of `verify.json`.

    Args:
        folder: What `build` or `emit` wrote.
        targets: Names of targets, or `all`; empty for the default ones, with `log` for none.
        dataset: Recordings to replay on every target besides.
        log: Output of a board test that ran elsewhere. Its entries join those of an earlier
            `verify.json` of the same model and code; later calls keep them.
        exhaustive: Visit every input of the fixed-point table besides.
        compiled: False: no target; files and bounds are checked against model and reference alone.
        trust_code: Compile and run `folder/c` although it holds code that gyrotc did not write.
        progress: Takes note of every stage, and of every target before it is tried.

    Raises:
        InputError: No emitted code, an unknown target, an unreadable log or earlier `verify.json`, no table to visit
            all inputs of.
        CheckFailed: The log is not whole, or of another model.
    """
    asked = {"replaying": dataset is not None, "visiting every input": exhaustive}
    say = Stages(progress, {stage: share if asked.get(stage, True) else 0.0 for stage, share in _STAGES.items()})
    model = load_model(folder / "model.json")
    earlier = read_optional(folder / "verify.json", Verification)
    chosen = chosen_targets(targets) if compiled and (targets or log is None) else []
    say("comparing files")
    options, emission = made_again(folder / "c", model)
    tables = emission.tables
    if exhaustive and "q31" not in tables:
        raise InputError("--exhaustive", f"{folder / 'c'} has no fixed-point table", "one emitted with q31")
    vectors = make_vectors(model, tuple(tables))
    job = Job(folder / "c", model, tables, expected_answers(model, emission), trust_code)
    texts = texts_again(model, options, emission)
    emitted = tuple(file_entries(job.c_folder, texts))
    if options.runtime and compiled:
        emitted += tuple(shared_runtime_entries(job.c_folder, model, options.runtime))
    wrong = [file.file for file in emitted if file.status == "fail"]
    barred = wrong and not trust_code
    identity = (model.hash, c_hash(folder / "c"))
    same = earlier is not None and (earlier.model_hash, earlier.c_hash) == identity
    entries, brought = log_entries(job, vectors, log) if log is not None else ([], None)
    entries += _barred(job, chosen, wrong) if barred else _test_all(job, chosen, say.within("testing"))
    if dataset is not None and not barred:
        entries = replay_dataset(job, entries, chosen, dataset, say.within("replaying"))
    before = earlier.targets if earlier is not None else ()
    boards = [entry for entry in before if entry.log is not None]
    if same:
        entries = _merged(boards if log is None else before, entries)
    exact = options.shifted(model)
    errors = [_error(job, exact, vectors, numeric) for numeric in tables]
    if exhaustive and not barred:
        errors = [
            _every_input(job, exact, say.within("visiting every input")) if e.numeric == "q31" else e for e in errors
        ]
    tested = {entry.name for entry in entries}
    outdated = () if same else tuple(dict.fromkeys(entry.name for entry in boards if entry.name not in tested))
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
        outdated_boards=outdated,
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
            raise InputError("--target", quoted(name), ", ".join([*known, "all"]))
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

    begun = itertools.count()

    def one(target: Target) -> list[VerifiedTarget]:
        progress(target.name, next(begun), len(targets))
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


def _merged(earlier: Sequence[VerifiedTarget], entries: list[VerifiedTarget]) -> list[VerifiedTarget]:
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
    """Measure the departure of the map over every input of the fixed-point table."""
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
