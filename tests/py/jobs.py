"""The job of an emitted folder, for tests that vary the target."""

from __future__ import annotations

from pathlib import Path

from gyrotc.emit import emitted_tables
from gyrotc.model import load_model
from gyrotc.reference import answers
from gyrotc.vectors import make_vectors
from gyrotc.verify.board import Job


def job_of(folder: Path) -> Job:
    model = load_model(folder / "model.json")
    tables = emitted_tables(folder / "c", model)
    vectors = make_vectors(model, tuple(tables))
    return Job(folder / "c", model, tables, {n: answers(table, vectors) for n, table in tables.items()})
