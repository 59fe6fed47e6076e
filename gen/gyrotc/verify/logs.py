"""Output of a board test that ran elsewhere: on hardware, with a compiler that is not here."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import CheckFailed
from ..inputs import read_input
from ..reference import answers
from ..vectors import Vectors
from .board import Job, checked_output
from .boardlog import BoardOutput, compare, read_output

__all__ = ["log_entries", "log_parts"]


def log_entries(job: Job, vectors: Vectors, log: Path) -> list[dict[str, Any]]:
    """Entries of `verify.json`, one for each arithmetic that the board tested.

    Raises:
        InputError: The file cannot be read.
        CheckFailed: It does not hold a whole board test of this model.
    """
    try:
        parts = [checked_output(_text(log), job, part.numeric) for part in log_parts(log)]
        return [_entry(job, vectors, log, part) for part in parts]
    except CheckFailed as error:
        raise CheckFailed(f"{log}: {error}") from error


def _text(log: Path) -> str:
    return read_input(log, "result_mib", "the output of board_test.c").decode("ascii", "replace")


def log_parts(log: Path) -> list[BoardOutput]:
    """The parts of a log.

    Raises:
        InputError: The file cannot be read.
        CheckFailed: It is not whole.
    """
    try:
        return read_output(_text(log))
    except (ValueError, LookupError, ArithmeticError) as error:
        raise CheckFailed(f"a line of the output is damaged ({error})") from error


def _entry(job: Job, vectors: Vectors, log: Path, output: BoardOutput) -> dict[str, Any]:
    table = job.tables.get(output.numeric)
    if table is None:
        raise CheckFailed(f"no {output.numeric} table was emitted")
    comparison = compare(output, answers(table, replace(vectors, n_random=output.random)))
    entry: dict[str, Any] = {
        "name": output.board or log.stem,
        "status": "fail" if comparison.mismatches else "pass",
        "numeric": output.numeric,
        "compiler": "not known",
        "flags": "not known",
        "log": log.name,
        "table_bytes": table.table_bytes,
        "vectors": comparison.vectors,
        "mismatches": comparison.mismatches,
        "first_mismatches": list(comparison.first),
    }
    for what, cost in output.costs.items():
        prefix = "" if what == "map" else f"{what}_"
        mean = round(cost.total / cost.calls, 1)
        entry[f"{prefix}ticks"] = {"min": cost.low, "mean": mean, "max": cost.high}
        entry[f"{prefix}stack_bytes"] = cost.stack
    return entry
