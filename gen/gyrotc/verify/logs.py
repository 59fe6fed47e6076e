"""Output of a board test that ran elsewhere: on hardware, with a compiler that is not here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..common.errors import CheckFailed
from ..common.opening import read_input
from ..results.verification import CallCost, LogPart, ReadLog, VerifiedTarget
from ..tables.vectors import Vectors
from ..target.history import answers
from .board import Job, check_identity
from .board_log import BoardComparison, BoardLog, BoardOutput, compared_words, read_log

__all__ = ["log_entries", "log_parts"]

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
        **_costs(output),
    )


def _costs(output: BoardOutput) -> dict[str, Any]:
    """Ticks and stack of the calls, by the names of `VerifiedTarget`."""
    found: dict[str, Any] = {}
    for what, cost in output.costs.items():
        prefix = "" if what == "map" else f"{what}_"
        mean = round(cost.total / cost.calls, 1)
        found[f"{prefix}ticks"] = CallCost(min=cost.low, mean=mean, max=cost.high)
        found[f"{prefix}stack_bytes"] = cost.stack
    return found
