"""A fleet on a Dask cluster whose workers run in another folder: the recordings meant, or none."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from conftest import Command
from gyrotc.fleet import run as running
from gyrotc.fleet.manifest import load_manifest
from gyrotc.fleet.run import run_fleet
from gyrotc.results.fleet import FleetEntry
from recordings import columns, toml, write_csv

distributed = pytest.importorskip("distributed", reason="Dask is not installed")

SERIALS = ("RLG-1", "RLG-2", "RLG-3")
WORKERS = ("anna", "bert")
STARTS_S = 120.0  # a busy machine imports Dask in some seconds


def gyro(folder: Path, serial: str, *, seed: int) -> None:
    write_csv(folder / "run-01.csv", columns(720, seed=seed))
    head = f'schema = 1\nserial = "{serial}"\nearth_rate = "none"'
    (folder / "dataset.toml").write_text(toml('file = "run-01.csv"', head=head))


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`lab` with three gyros; `elsewhere`, where under the same relative path another three lie."""
    folder = tmp_path_factory.mktemp("world")
    for k, serial in enumerate(SERIALS, 1):
        gyro(folder / "lab" / "few" / serial, serial, seed=k)
        gyro(folder / "elsewhere" / "few" / serial, f"OTHER-{k}", seed=10 + k)
    (folder / "lab" / "fleet.toml").write_text('schema = 1\ndatasets = ["few/*"]\n')
    return folder


@pytest.fixture(scope="module")
def scheduler(world: Path) -> Iterator[str]:
    """Address of a scheduler with two workers, all of them started in `elsewhere`."""
    file = world / "scheduler.json"
    common = ("--scheduler-file", str(file), "--no-dashboard")
    calls = [
        ("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", *common),
        *(
            ("distributed.cli.dask_worker", *common, "--name", name, "--nthreads", "1", "--no-nanny")
            for name in WORKERS
        ),
    ]
    environment = os.environ | {"DASK_DISTRIBUTED__WORKER__MEMORY__TERMINATE": "0"}
    started: list[subprocess.Popen[bytes]] = []
    try:
        for call in calls:
            program = [sys.executable, "-m", *call]
            with (world / f"log-{len(started)}.txt").open("wb") as log:
                started.append(
                    subprocess.Popen(
                        program, cwd=world / "elsewhere", env=environment, stdout=log, stderr=log
                    )
                )
            _wait_for(file, started[0])
        address = json.loads(file.read_text())["address"]
        with distributed.Client(address, timeout=STARTS_S) as client:
            client.wait_for_workers(len(WORKERS), timeout=STARTS_S)
        yield address
    finally:
        for process in reversed(started):  # a worker that is asked to end may wait for its scheduler for ever
            process.kill()
            process.wait()


def _wait_for(file: Path, process: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + STARTS_S
    while not file.exists():
        assert process.poll() is None and time.monotonic() < end, "the scheduler does not start"
        time.sleep(0.05)


def test_relative_paths_name_the_recordings_of_who_types_them(
    world: Path, scheduler: str, gyrotc: Command
) -> None:
    """Before: the worker took what lay under that path in its own folder, and the fleet said done, exit 0."""
    done = gyrotc("fleet", "fleet.toml", "--out", "fleet", "--scheduler", scheduler, cwd=world / "lab")
    assert done.returncode == 0, done.stdout + done.stderr
    summary = json.loads((world / "lab" / "fleet" / "fleet.json").read_text())
    assert [unit["serial"] for unit in summary["serials"]] == list(SERIALS)
    assert [unit["dataset"] for unit in summary["serials"]] == [f"few/{serial}" for serial in SERIALS]
    assert not (world / "elsewhere" / "fleet").exists()
    for serial in SERIALS:
        model = json.loads((world / "lab" / "fleet" / serial / "model.json").read_text())
        recording = (world / "lab" / "few" / serial / "run-01.csv").read_bytes()
        assert {data["sha256"] for data in model["data"]} == {hashlib.sha256(recording).hexdigest()}


def test_a_worker_that_finds_other_recordings_refuses_them(
    world: Path, scheduler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder is exchanged behind the client's back, so that the worker sees what a wrong mount would show it."""
    lab = shutil.copytree(world / "lab" / "few", tmp_path / "few")
    on_dask = running.on_dask

    def mounted_wrongly(address: str, tasks: Sequence[running.Task]) -> Iterator[tuple[int, FleetEntry]]:
        shutil.rmtree(lab / "RLG-1")
        shutil.copytree(world / "elsewhere" / "few" / "RLG-1", lab / "RLG-1")
        keys.extend(task.key for task in tasks)
        yield from on_dask(address, tasks)

    keys: list[str] = []
    monkeypatch.setattr(running, "on_dask", mounted_wrongly)
    entries = run_fleet(load_manifest(lab), tmp_path / "out", scheduler=scheduler)
    assert [entry.status for entry in entries] == ["failed", "done", "done"]
    reason = entries[0].reason or ""
    assert str(lab / "RLG-1") in reason and keys[0][:16] in reason
    assert any(f"on worker {name}" in reason for name in WORKERS), reason
    found = running.tasks_of(load_manifest(lab), tmp_path / "out", False)[0].found()
    assert found != keys[0] and found[:16] in reason
    assert not (tmp_path / "out" / "RLG-1").exists()
