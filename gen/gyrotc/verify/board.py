"""The board test on one target, run here or from a log of hardware: compiled, run, compared, measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed
from ..common.inputs import read_input
from ..model import Model
from ..results.verification import CallCost, FunctionCost, LogPart, ReadLog, VerifiedTarget
from ..store.scratch import scratch_folder
from ..tables.vectors import Vectors
from ..target.history import answers
from ..target.table import Table
from .board_log import BoardComparison, BoardLog, BoardOutput, compared_words, read_log, read_output
from .bounds import instruction_bounds
from .emitted import board_files, checked_sources
from .sizes import function_costs
from .toolchain import (
    Object,
    Symbol,
    Target,
    compile_objects,
    compiler_version,
    link,
    run_program,
    runtime_object,
    symbols,
    writable_bytes,
)

__all__ = ["Job", "board_entries", "check_identity", "log_entries", "log_parts"]

_CODE = "tT"
_CONSTANT = "rR"


@dataclass(frozen=True, slots=True)
class Job:
    """What is to be verified: emitted C, its tables, and what the reference answers to its vectors."""

    c_folder: Path
    model: Model
    tables: dict[str, Table]
    expected: dict[str, NDArray[np.uint32]]
    trusted: bool = False  # the user takes the code of the folder as it is


def board_entries(job: Job, target: Target) -> list[VerifiedTarget]:
    """Entries of `verify.json` for one target, one for each arithmetic."""
    numerics = [n for n in job.tables if n in target.numerics]
    package = target.missing()
    if package is not None:
        return [
            VerifiedTarget(name=target.name, status="missing", numeric=n, package=package) for n in numerics
        ]
    with scratch_folder() as work:
        return list(_entries(job, target, numerics, work))


def _entries(job: Job, target: Target, numerics: list[str], work: Path) -> Iterator[VerifiedTarget]:
    """Compiles runtime and table once, and a test program for each arithmetic."""
    shared: _Shared | CheckFailed
    functions: dict[str, dict[str, FunctionCost]] = {}
    files = board_files(job.model, tuple(job.tables), next(iter(job.tables.values())).n_channels)
    try:
        c = checked_sources(job.c_folder, work, files, trusted=job.trusted)
        runtime = runtime_object(target, c, work, fresh=job.trusted)
        shared = _shared(job, target, c, work, runtime)
        functions = _functions(job, target, c, work, runtime)
    except CheckFailed as error:
        shared = error
    for numeric in numerics:
        entry = partial(
            VerifiedTarget,
            name=target.name,
            numeric=numeric,
            compiler=compiler_version(target.compiler),
            flags=" ".join(target.all_flags),
            table_bytes=job.tables[numeric].table_bytes,
        )
        told: dict[str, Any] = {"functions": functions[numeric]} if numeric in functions else {}
        try:
            if isinstance(shared, CheckFailed):
                raise shared
            yield entry(**_ran(job, target, numeric, shared, work, c), **told)
        except CheckFailed as error:
            yield entry(status="fail", error=str(error))


@dataclass(frozen=True, slots=True)
class _Shared:
    """Objects of runtime and table, which the programs of all arithmetics have: symbols, writable static data."""

    objects: tuple[Path, ...]
    symbols: tuple[Symbol, ...]
    writable_bytes: int


def _shared(job: Job, target: Target, c: Path, work: Path, runtime: Object) -> _Shared:
    (table,) = compile_objects(target, [c / f"gtc_{job.model.id}.c"], work, include=c)
    return _Shared(
        (runtime.put(work / "gtc.o"), table),
        (*runtime.symbols, *symbols(target, table)),
        runtime.writable_bytes + writable_bytes(target, table),
    )


def _functions(
    job: Job, target: Target, c: Path, work: Path, runtime: Object
) -> dict[str, dict[str, FunctionCost]]:
    """Code, stack and the most instructions of each public function, by arithmetic.

    Code of other levels may have loops that no line of the text bounds: then no bound is stated, and the bits count.
    """
    costs = function_costs(runtime)
    if not costs:
        return costs
    try:
        bounds = instruction_bounds(target, c, job.tables, job.model.symbol, runtime, work)
    except CheckFailed:
        return costs
    for n, most in bounds.items():
        costs[n] = {f: cost.model_copy(update={"instructions": most.get(f)}) for f, cost in costs[n].items()}
    return costs


def _ran(job: Job, target: Target, numeric: str, shared: _Shared, work: Path, c: Path) -> dict[str, Any]:
    """What a target showed of one arithmetic, by the names of `VerifiedTarget`."""
    defines = [f"BOARD_{n.upper()}={int(n == numeric)}" for n in job.tables]
    if target.counts:
        defines.append('BOARD_HEADER="board.h"')
    test = compile_objects(target, [c / "board_test.c"], work, include=c, defines=defines)
    program = work / f"board_{numeric}"
    link(target, [*test, *shared.objects], program)
    run = run_program(target, program)
    text = run.stdout.decode("ascii", "replace")
    # Some simulators print what a program says among their own messages.
    output = _output_of(text if "begin " in text else run.stderr, job, numeric)
    if run.returncode != 0:
        raise CheckFailed(f"the program ended with status {run.returncode}: {run.stderr[:200]}")
    comparison = compared_words(output, job.expected[numeric])
    return {
        "status": "fail" if comparison.mismatches else "pass",
        "vectors": comparison.vectors,
        "mismatches": comparison.mismatches,
        "first_mismatches": comparison.first,
        **_costs(target, output),
        **_sizes(target, program, shared),
    }


def _output_of(text: str, job: Job, numeric: str) -> BoardOutput:
    """The part of a board test's output for one arithmetic.

    Raises:
        CheckFailed: It is not whole, or of another model.
    """
    parts = [part for part in read_output(text) if part.numeric == numeric]
    if len(parts) != 1:
        raise CheckFailed(f"the output has {len(parts)} parts for {numeric} instead of one")
    check_identity(parts[0], job)
    return parts[0]


def check_identity(output: BoardOutput, job: Job) -> None:
    """Refuses the output of another model."""
    if (output.id, output.model) != (job.model.id, int(job.model.hash[:8], 16)):
        raise CheckFailed(
            f"the output is of table {output.id}, model {output.model:08x}..., "
            f"not of {job.model.id}, model {job.model.hash[:8]}..."
        )


def _costs(target: Target, output: BoardOutput) -> dict[str, Any]:
    """Counts and stack of a call of the map and, apart, of a sample (one in a block evaluates the map)."""
    if target.counts is None:
        return {}
    found: dict[str, Any] = {}
    for what, cost in output.costs.items():
        prefix = "" if what == "map" else f"{what}_"
        found[prefix + target.counts] = CallCost(
            min=round(cost.low / target.ticks_per_count),
            mean=round(cost.total / cost.calls / target.ticks_per_count, 1),
            max=round(cost.high / target.ticks_per_count),
        )
        found[f"{prefix}stack_bytes"] = cost.stack
    return found


def _sizes(target: Target, program: Path, shared: _Shared) -> dict[str, int]:
    """Code and constants of runtime and table that the program links, and their writable static data.

    What is constant is told by the objects: linker scripts put constants beside the code.
    """
    own = {symbol.name: symbol.kind for symbol in shared.symbols}
    linked = {symbol.name: symbol for symbol in symbols(target, program) if symbol.name in own}.values()
    return {
        "code_bytes": sum(symbol.size for symbol in linked if own[symbol.name] in _CODE),
        "read_only_bytes": sum(symbol.size for symbol in linked if own[symbol.name] in _CONSTANT),
        "ram_bytes": shared.writable_bytes,
    }


_SHOWN = 5  # lines outside of a board test, differences


def log_entries(job: Job, vectors: Vectors, log: Path) -> tuple[list[VerifiedTarget], ReadLog]:
    """Entries of `verify.json`, one for each board and arithmetic, and what the log holds in all.

    All parts of an arithmetic are compared; an entry passes only if each of them does.

    Raises:
        InputError: The file cannot be read.
        CheckFailed: It does not hold whole board tests of this model alone; names the line.
    """
    try:
        found = log_parts(log)
        compared = [(part, _compared(job, vectors, part)) for part in found.parts]
    except CheckFailed as error:
        raise CheckFailed(f"{log}: {error}") from error
    groups: dict[tuple[str, str], list[tuple[BoardOutput, BoardComparison]]] = {}
    for part, comparison in compared:
        groups.setdefault((part.board or log.stem, part.numeric), []).append((part, comparison))
    whole = ReadLog(
        file=log.name,
        lines=found.lines,
        parts=tuple(
            LogPart(line=p.line, numeric=p.numeric, vectors=c.vectors, mismatches=c.mismatches)
            for p, c in compared
        ),
        absent=tuple(n for n in job.tables if all(p.numeric != n for p, _ in compared)),
        outside=len(found.outside),
        first_outside=tuple(f"line {number}: {line[:80]}" for number, line in found.outside[:_SHOWN]),
    )
    return [_entry(job, log, name, parts) for (name, _), parts in groups.items()], whole


def log_parts(log: Path) -> BoardLog:
    """The board tests that a log holds.

    Raises:
        InputError: The file cannot be read.
        CheckFailed: A line of a board test is damaged, or one is not whole.
    """
    return read_log(read_input(log, "result_mib", "the output of board_test.c").decode("ascii", "replace"))


def _compared(job: Job, vectors: Vectors, part: BoardOutput) -> BoardComparison:
    """A part against the reference."""
    check_identity(part, job)
    table = job.tables.get(part.numeric)
    if table is None:
        raise CheckFailed(f"line {part.line}: no {part.numeric} table was emitted")
    fixed = len(job.expected[part.numeric]) - vectors.n_random
    if part.n_results != fixed + part.random:
        raise CheckFailed(
            f"line {part.line}: {part.random} random vectors were asked for, which makes {fixed + part.random} "
            f"results; the board test made {part.n_results}"
        )
    return compared_words(part, answers(table, replace(vectors, n_random=part.random)))


def _entry(
    job: Job, log: Path, name: str, parts: Sequence[tuple[BoardOutput, BoardComparison]]
) -> VerifiedTarget:
    """What one board showed of one arithmetic; the cost of the calls is that of the last part."""
    mismatches = sum(c.mismatches for _, c in parts)
    several = len(parts) > 1
    first = [f"part at line {p.line}, {text}" if several else text for p, c in parts for text in c.first]
    output = parts[-1][0]
    return VerifiedTarget(
        name=name,
        status="fail" if mismatches else "pass",
        numeric=output.numeric,
        compiler="not known",
        flags="not known",
        log=log.name,
        parts=len(parts),
        table_bytes=job.tables[output.numeric].table_bytes,
        vectors=sum(c.vectors for _, c in parts),
        mismatches=mismatches,
        first_mismatches=tuple(first[:_SHOWN]),
        **_tick_costs(output),
    )


def _tick_costs(output: BoardOutput) -> dict[str, Any]:
    """Ticks and stack of the calls, by the names of `VerifiedTarget`."""
    found: dict[str, Any] = {}
    for what, cost in output.costs.items():
        prefix = "" if what == "map" else f"{what}_"
        mean = round(cost.total / cost.calls, 1)
        found[f"{prefix}ticks"] = CallCost(min=cost.low, mean=mean, max=cost.high)
        found[f"{prefix}stack_bytes"] = cost.stack
    return found
