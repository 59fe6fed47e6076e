"""The job of an emitted folder, for tests that vary the target."""

from __future__ import annotations

from pathlib import Path

from gyrotc.mirror.history import answers
from gyrotc.model import load_model
from gyrotc.tables.emit import emitted_tables
from gyrotc.tables.vectors import make_vectors
from gyrotc.verify.emitted import Job


def job_of(folder: Path) -> Job:
    """Takes the folder's code as it is: these tests spoil it, and look whether the proof sees it."""
    model = load_model(folder / "model.json")
    tables = emitted_tables(folder / "c", model)
    vectors = make_vectors(model, tuple(tables))
    expected = {n: answers(table, vectors) for n, table in tables.items()}
    return Job(folder / "c", model, tables, expected, trusted=True)
