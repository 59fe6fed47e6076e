"""Prove that the emitted C gives, on every target, bit for bit what the reference gives.

Stage 7 of the house (… → C → **proof** → report). Believes nothing: compiles `DIR/c` for each
target, runs the board test and compares every result word with what the reference computes from
`model.json`. The answers in `c/` are not trusted either; they must be the same.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import __version__
from .emit import emitted_tables
from .errors import CheckFailed, InputError
from .model import Model, load_model
from .quantise import Table
from .reference import answers
from .toolchain import Target, all_targets, compile_c, compiler_version, run_program
from .vectors import Vectors, make_vectors

__all__ = ["Comparison", "compare_output", "verify"]

Words = NDArray[np.int64]
Progress = Callable[[str], None]
_SHOWN_MISMATCHES = 5


@dataclass(frozen=True, slots=True)
class Comparison:
    """Vectors compared, mismatches among them, and the first of them with all bits."""

    vectors: int
    mismatches: int
    first: tuple[str, ...]


def verify(folder: Path, *, targets: Sequence[str] = (), progress: Progress | None = None) -> dict[str, Any]:
    """Verifies `folder/c` against `folder/model.json`; the JSON object of `gyrotc verify`.

    Args:
        folder: What `build` or `emit` wrote.
        targets: Names of targets, or `all`; empty for the default ones (host compilers).
        progress: Called with the name of each target before it is tried.

    Raises:
        InputError: No emitted code, or an unknown target.
    """
    model = load_model(folder / "model.json")
    chosen = _choose(targets)
    tables = emitted_tables(folder / "c", model)
    vectors = make_vectors(model, tuple(tables))
    expected = {n: answers(table, vectors) for n, table in tables.items()}
    entries = []
    for target in chosen:
        if progress:
            progress(target.name)
        entries += _verify_target(folder / "c", model, target, tables, expected)
    named = set(targets) - {"all"}
    status = [e["status"] for e in entries]
    bounds = [t.error_bound_dph for t in tables.values()]
    return {
        "schema": "gyrotc.verify/1",
        "gyrotc_version": __version__,
        "serial": model.serial,
        "axis": model.axis,
        "passed": status.count("pass"),
        "failed": status.count("fail")
        + sum(e["status"] == "missing" and e["name"] in named for e in entries),
        "missing": status.count("missing"),
        "targets": entries,
        "error_bound_dph": max(bounds),
        "worst_error_dph": _worst_error(model, tables, vectors, expected),
    }


def _choose(names: Sequence[str]) -> list[Target]:
    known = all_targets()
    for name in names:
        if name != "all" and name not in known:
            raise InputError("--target", repr(name), ", ".join([*known, "all"]))
    if not names:
        return [t for t in known.values() if t.default]
    return [t for t in known.values() if "all" in names or t.name in names]


def _verify_target(
    c_folder: Path, model: Model, target: Target, tables: dict[str, Table], expected: dict[str, Words]
) -> list[dict[str, Any]]:
    entries = []
    for numeric, table in tables.items():
        if numeric not in target.numerics:
            continue
        entry: dict[str, Any] = {"name": target.name, "status": "missing", "numeric": numeric}
        package = target.missing()
        if package is not None:
            entries.append(entry | {"package": package})
            continue
        others = [f"BOARD_{n.upper()}=0" for n in tables if n != numeric]
        try:
            with tempfile.TemporaryDirectory(prefix="gyrotc-") as work:
                program = Path(work) / "board_test"
                sources = [c_folder / f for f in ("board_test.c", "gtc.c", f"gtc_{model.id}.c")]
                command = compile_c(target, sources, program, include=c_folder, defines=others)
                run = run_program(target, program)
            comparison = compare_output(run.stdout.decode("ascii", "replace"), numeric, expected[numeric])
            if run.returncode != 0:
                raise CheckFailed(f"the program ended with status {run.returncode}: {run.stderr[:200]}")
            entry |= {
                "status": "fail" if comparison.mismatches else "pass",
                "compiler": compiler_version(target.compiler),
                "flags": " ".join(command[1:]),
                "vectors": comparison.vectors,
                "mismatches": comparison.mismatches,
                "first_mismatches": list(comparison.first),
            }
        except CheckFailed as error:
            entry |= {"status": "fail", "error": str(error)}
        entries.append(entry | {"table_bytes": table.table_bytes, "ram_bytes": 0})
    return entries


def compare_output(text: str, numeric: str, expected: Words) -> Comparison:
    """Compares what a board test printed (every result) with the expected (status, bits) words.

    Raises:
        CheckFailed: The output is not whole: no begin, no end, another number of results.
    """
    lines = text.splitlines()
    try:
        start = next(k for k, line in enumerate(lines) if line.split()[0:3:2] == ["begin", numeric])
        stop = next(k for k in range(start, len(lines)) if lines[k].startswith("end "))
        got = np.array([[int(w, 16) for w in line.split()] for line in lines[start + 1 : stop]])
        got = got.reshape(-1, 2)
    except (StopIteration, ValueError, IndexError) as error:
        tail = lines[-1] if lines else "nothing"
        raise CheckFailed(f"the board test did not run to its end (last output: {tail!r})") from error
    if got.shape != expected.shape:
        raise CheckFailed(f"the board test printed {len(got)} results instead of {len(expected)}")
    wrong = np.flatnonzero(np.any(got != expected, axis=1))
    first = tuple(
        f"vector {k}: status {got[k][0]:08x} bits {got[k][1]:08x}, reference {e[0]:08x} {e[1]:08x}"
        for k, e in ((int(k), expected[k]) for k in wrong[:_SHOWN_MISMATCHES])
    )
    return Comparison(len(expected), int(wrong.size), first)


def _worst_error(
    model: Model, tables: dict[str, Table], vectors: Vectors, expected: dict[str, Words]
) -> dict[str, Any]:
    """Largest departure of the emitted map from the float64 model over the map vectors (all arithmetics)."""
    worst, visited = 0.0, 0
    for numeric, table in tables.items():
        inputs = table.decode_inputs(vectors.map_inputs(numeric))
        status, bits = expected[numeric][1 : 1 + len(inputs)].T
        usable = (status < 2**31) & np.all(np.isfinite(inputs), axis=1)
        got = table.decode_bias(bits.astype(np.uint32))[usable]
        t, slope = inputs[usable].T
        exact = model.map_dph(t, slope * 60.0 / model.block_s)
        worst = max(worst, float(np.max(np.abs(got - exact), initial=0.0)))
        visited += int(usable.sum())
    return {"value": worst, "inputs_visited": visited}
