"""Jobs of the package as tests need them: of an emitted folder, and of a gyro of a fleet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

from gyrotc.fleet import Task, do_unit
from gyrotc.jobs import Built, build_into
from gyrotc.mirror import answers
from gyrotc.model import load_model
from gyrotc.recordings import Dataset
from gyrotc.results import FleetEntry, result_folder
from gyrotc.tables import emitted_tables, make_vectors
from gyrotc.train import FitOptions
from gyrotc.verify import Job


def job_of(folder: Path) -> Job:
    """Takes the folder's code as it is: these tests spoil it, and look whether the proof sees it."""
    model = load_model(folder / "model.json")
    tables = emitted_tables(folder / "c", model)
    vectors = make_vectors(model, tuple(tables))
    expected = {n: answers(table, vectors) for n, table in tables.items()}
    return Job(folder / "c", model, tables, expected, trusted=True)


def built_for_fleet(out: Path, dataset: Dataset, options: FitOptions | None = None, **more: Any) -> Built:
    """Build without a compiler and without pictures, as a fleet does it, into the new folder `out`."""
    with result_folder(out, "build") as stage:
        stage.of(dataset.serial)
        return build_into(stage.folder, dataset, options or FitOptions(), **more)


@contextmanager
def units_in_this_process() -> Iterator[None]:
    """Let fleets do their units in this process: starting another one takes longer than a small gyro."""

    def one_by_one(_jobs: int, tasks: Sequence[Task]) -> Iterator[tuple[int, FleetEntry]]:
        return ((number, do_unit(task)) for number, task in enumerate(tasks))

    with mock.patch("gyrotc.fleet.run.on_processes", one_by_one):
        yield
