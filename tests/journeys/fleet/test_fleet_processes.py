"""A fleet on processes and on Dask: the same bytes, whatever is killed in between."""

from __future__ import annotations

import json
import os
import pickle
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from gyrotc.fleet import Cluster, Fleet, Task, Unit, do_unit, load_manifest, run_fleet, tasks_of
from gyrotc.fleet import run as pools
from gyrotc.results import MARKER, FleetEntry
from gyrotc.train import FitOptions
from recordings import columns, toml, write_csv


def gyro(folder: Path, serial: str, *, seed: int) -> None:
    write_csv(folder / "run-01.csv", columns(720, seed=seed))
    head = f'schema = 1\nserial = "{serial}"\nearth_rate = "none"'
    (folder / "dataset.toml").write_text(toml('file = "run-01.csv"', head=head))


def contents(out: Path) -> dict[str, bytes]:
    """All files of a fleet but markers; without the seconds that training took."""
    found = {}
    for path in out.rglob("*"):
        name = path.relative_to(out).as_posix()
        if not path.is_file() or path.name == MARKER:
            continue
        found[name] = path.read_bytes()
        if path.name == "training.json":
            found[name] = re.sub(rb'"seconds": {[^}]*}', b"", found[name])
        elif path.name == "manifest.json":
            found[name] = re.sub(rb'"training.json": "[0-9a-f]*"', b"", found[name])
    return found


@pytest.fixture(scope="module")
def lot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four gyros, of which one has no recordings."""
    folder = tmp_path_factory.mktemp("lot")
    for k in range(4):
        gyro(folder / "d" / f"RLG-{k}", f"RLG-{k}", seed=k)
    (folder / "d" / "RLG-3" / "run-01.csv").write_text("time_s,rate_dph\n")
    run_fleet(load_manifest(folder / "d"), folder / "whole")
    return folder


def test_a_task_does_not_carry_the_fleet(tmp_path: Path) -> None:
    sizes = []
    for count in (10, 10000):
        units = tuple(Unit(tmp_path / f"RLG-{k:05d}", None) for k in range(count))
        sizes.append(len(pickle.dumps(tasks_of(Fleet(units, FitOptions(), None, None), tmp_path)[0])))
    assert sizes[0] == sizes[1] < 5000


def _dies_once(task: Task) -> FleetEntry:
    mark = task.out.parent / f"{task.unit.name}.died"
    if task.unit.name == "RLG-1" and not mark.exists():
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return do_unit(task)


def test_a_unit_whose_process_is_killed_is_done_again(
    lot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pools, "do_unit", _dies_once)
    entries = run_fleet(load_manifest(lot / "d"), tmp_path / "out", jobs=1)
    assert (tmp_path / "out" / "RLG-1.died").exists()
    assert [entry.status for entry in entries] == ["done", "done", "done", "failed"]


def _dies(task: Task) -> FleetEntry:
    if task.unit.name == "RLG-1":
        os.kill(os.getpid(), signal.SIGKILL)
    return do_unit(task)


def reported(out: Path, entries: list[FleetEntry], why: str) -> None:
    """Check that the deadly gyro and the one without recordings have failed, each with its reason in fleet.json."""
    reasons = [entry.reason for entry in entries]
    assert [entry.status for entry in entries] == ["done", "failed", "done", "failed"], reasons
    units = {unit["name"]: unit for unit in json.loads((out / "fleet.json").read_text())["serials"]}
    assert why in units["RLG-1"]["reason"] and "run-01.csv" in units["RLG-3"]["reason"]
    for name, unit in units.items():
        assert (unit["status"] == "done") == (out / name / "model.json").is_file()


def test_a_gyro_that_kills_every_process_has_failed_and_the_others_are_done(
    lot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pools, "do_unit", _dies)
    entries = run_fleet(load_manifest(lot / "d"), tmp_path / "out", jobs=2)
    reported(tmp_path / "out", entries, "its process died")


def test_a_gyro_that_kills_workers_of_a_cluster_has_failed_and_the_others_are_done(
    lot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One gyro at a time: Dask suspects every task that a lost worker had."""
    import dask
    import distributed

    monkeypatch.setattr(pools, "do_unit", _dies)
    one_by_one = {"distributed.scheduler.allowed-failures": 1, "distributed.scheduler.worker-saturation": 1.0}
    with (
        dask.config.set(one_by_one),
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as local,
    ):
        cluster = Cluster(local.scheduler_address, 60.0)
        entries = run_fleet(load_manifest(lot / "d"), tmp_path / "out", cluster=cluster)
    reported(tmp_path / "out", entries, "2 workers died with it")


def _held(task: Task) -> FleetEntry:
    folder = task.unit.dataset.parents[1]
    (folder / "begun").touch()
    while not (folder / "go").exists():
        time.sleep(0.05)
    return do_unit(task)


CLIENT = """
import sys
from pathlib import Path
sys.path[:] = sys.argv[3].split(":")
import test_fleet_processes as held
held.pools.do_unit = held._held
held.run_fleet(held.load_manifest(Path(sys.argv[4])), Path(sys.argv[1]), cluster=held.Cluster(sys.argv[2], 60.0))
"""


def test_a_killed_client_of_a_cluster_leaves_no_half_result_and_the_next_call_goes_on_to_the_same_bytes(
    lot: Path, tmp_path: Path
) -> None:
    import distributed

    out = tmp_path / "out"
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as local:
        address = local.scheduler_address
        command = [sys.executable, "-c", CLIENT, str(out), address, ":".join(sys.path), str(lot / "d")]
        with subprocess.Popen(command) as client:
            while not (lot / "begun").exists():
                assert client.poll() is None
                time.sleep(0.05)
            client.kill()
        (lot / "go").touch()
        entries = run_fleet(load_manifest(lot / "d"), out, cluster=Cluster(address, 60.0))
    statuses = [entry.status for entry in entries]
    assert statuses == ["done", "done", "done", "failed"], [entry.reason for entry in entries]
    assert not [path.name for path in out.iterdir() if path.name.startswith(".")], "no half result, no lock"
    assert contents(out) == contents(lot / "whole")
