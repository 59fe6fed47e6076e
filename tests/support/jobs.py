"""The job of an emitted folder, for tests that vary the target."""

from __future__ import annotations

from pathlib import Path

from gyrotc.mirror import answers
from gyrotc.model import load_model
from gyrotc.tables import emitted_tables, make_vectors
from gyrotc.verify import Job


def job_of(folder: Path) -> Job:
    """Takes the folder's code as it is: these tests spoil it, and look whether the proof sees it."""
    model = load_model(folder / "model.json")
    tables = emitted_tables(folder / "c", model)
    vectors = make_vectors(model, tuple(tables))
    expected = {n: answers(table, vectors) for n, table in tables.items()}
    return Job(folder / "c", model, tables, expected, trusted=True)
