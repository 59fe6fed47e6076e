"""Prove that the emitted C gives, on every target, bit for bit what the reference gives.

Stage 7 of the house (… → C → **proof** → report). Believes nothing: compiles `DIR/c` for each
target, runs the board test and compares every result word with what the reference computes from
`model.json`. The answers in `c/` are not trusted either; they must be the same.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..emit import emitted_tables
from ..errors import InputError
from ..model import load_model
from ..reference import answers
from ..toolchain import Target, all_targets
from ..vectors import Vectors, make_vectors
from .board import Job, test_target

__all__ = ["verify"]

Progress = Callable[[str], None]


def verify(folder: Path, *, targets: Sequence[str] = (), progress: Progress | None = None) -> dict[str, Any]:
    """Verifies `folder/c` against `folder/model.json`; the JSON object of `gyrotc verify`.

    Args:
        folder: What `build` or `emit` wrote.
        targets: Names of targets, or `all`; empty for the default ones.
        progress: Called with the name of each target before it is tried.

    Raises:
        InputError: No emitted code, or an unknown target.
    """
    model = load_model(folder / "model.json")
    chosen = _choose(targets)
    tables = emitted_tables(folder / "c", model)
    vectors = make_vectors(model, tuple(tables))
    job = Job(folder / "c", model, tables, {n: answers(table, vectors) for n, table in tables.items()})
    entries = list(_test_all(job, chosen, progress or (lambda _: None)))
    named = set(targets) - {"all"}
    status = [e["status"] for e in entries]
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
        "error_bound_dph": max(t.error_bound_dph for t in tables.values()),
        "worst_error_dph": _worst_error(job, vectors),
    }


def _choose(names: Sequence[str]) -> list[Target]:
    known = all_targets()
    for name in names:
        if name != "all" and name not in known:
            raise InputError("--target", repr(name), ", ".join([*known, "all"]))
    if not names:
        return [t for t in known.values() if t.default]
    return [t for t in known.values() if "all" in names or t.name in names]


def _test_all(job: Job, targets: Sequence[Target], progress: Progress) -> Iterator[dict[str, Any]]:
    """Entries in the order of the targets; compilers and emulators run side by side."""

    def one(target: Target) -> list[dict[str, Any]]:
        progress(target.name)
        return test_target(job, target)

    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        for entries in pool.map(one, targets):
            yield from entries


def _worst_error(job: Job, vectors: Vectors) -> dict[str, Any]:
    """Largest departure of the emitted map from the float64 model over the map vectors (all arithmetics)."""
    worst, visited = 0.0, 0
    for numeric, table in job.tables.items():
        inputs = table.decode_inputs(vectors.map_inputs(numeric))
        status, bits = job.expected[numeric][1 : 1 + len(inputs)].T
        usable = (status < 2**31) & np.all(np.isfinite(inputs), axis=1)
        got = table.decode_bias(bits.astype(np.uint32))[usable]
        t, slope = inputs[usable].T
        exact = job.model.map_dph(t, slope * 60.0 / job.model.block_s)
        worst = max(worst, float(np.max(np.abs(got - exact), initial=0.0)))
        visited += int(usable.sum())
    return {"value": worst, "inputs_visited": visited}
