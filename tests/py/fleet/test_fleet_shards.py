"""A fleet in shares: the same bytes as in one piece, whatever is killed in between."""

from __future__ import annotations

import os
import pickle
import re
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from conftest import Command
from gyrotc.assess.limits import load_limits
from gyrotc.common.errors import InputError
from gyrotc.fleet import run as pools
from gyrotc.fleet.manifest import Fleet, Share, Unit, load_manifest, mine, share_of
from gyrotc.fleet.run import Cluster, gather, run_fleet, run_share, tasks_of
from gyrotc.fleet.unit import Task, do_unit
from gyrotc.results.fleet import FleetEntry
from gyrotc.results.marker import MARKER
from gyrotc.train.fitting import FitOptions
from recordings import columns, toml, write_csv

N = 3


def gyro(folder: Path, serial: str, *, seed: int) -> None:
    write_csv(folder / "run-01.csv", columns(720, seed=seed))
    head = f'schema = 1\nserial = "{serial}"\nearth_rate = "none"'
    (folder / "dataset.toml").write_text(toml('file = "run-01.csv"', head=head))


def contents(out: Path) -> dict[str, bytes]:
    """All files of a fleet but markers and the catalogue's pages; without the seconds that training took."""
    found = {}
    for path in out.rglob("*"):
        name = path.relative_to(out).as_posix()
        if not path.is_file() or path.name == MARKER or ".sqlite" in name:
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


@pytest.mark.slow
def test_shares_are_the_same_to_the_byte(lot: Path, gyrotc: Command) -> None:
    fleet, out = load_manifest(lot / "d"), lot / "shares"
    reported = gyrotc("fleet", lot / "d", "--out", out, "--shard", f"1/{N}")
    assert f"share 1/{N}" in reported.stdout and not (out / "fleet.json").exists()
    early = gather(fleet, out)
    assert {e.status for e in early if e.name not in reported.stdout} <= {"unfinished"}
    failed = [e for k in range(2, N + 1) for e in run_share(fleet, out, Share(k, N), jobs=1) if e.status != "done"]
    assert not (out / "fleet.json").exists(), "a summary outlasts what it says"
    assert ("RLG-3: failed" in reported.stdout) != ([entry.name for entry in failed] == ["RLG-3"])
    done = gyrotc("fleet", lot / "d", "--out", out, "--gather")
    assert done.returncode == 1 and "RLG-3: unfinished; no share has made it" in done.stdout
    assert "3 of 4 done, 0 failed" in done.stdout
    run_fleet(fleet, out)
    assert contents(out) == contents(lot / "whole")


def test_a_share_leaves_its_results_and_nothing_else(tmp_path: Path) -> None:
    for k, serial in enumerate(("RLG-1", "RLG-2")):
        gyro(tmp_path / "d" / serial, serial, seed=k)
    (tmp_path / "d" / "RLG-2" / "run-01.csv").write_text("time_s,rate_dph\n")
    fleet, out = load_manifest(tmp_path / "d"), tmp_path / "out"
    assert [entry.status for entry in run_share(fleet, out, Share(1, 1), jobs=1)] == ["done", "failed"]
    assert sorted(path.name for path in out.iterdir()) == ["RLG-1", "catalogue"]
    assert [path.name for path in (out / "catalogue").iterdir()] == ["payloads"], "of the runtime"
    found = gather(fleet, out)
    assert [(entry.status, entry.kept) for entry in found] == [("done", True), ("unfinished", False)]
    assert "no share" in (found[1].reason or "")
    assert (out / "fleet.html").exists() and (out / "catalogue").exists()


def test_a_result_that_misses_its_limits_is_gathered_as_failed(tmp_path: Path) -> None:
    gyro(tmp_path / "d" / "RLG-1", "RLG-1", seed=1)
    (tmp_path / "limits.toml").write_text("schema = 1\n[at_most]\ntable_bytes = 1\n")
    fleet = replace(load_manifest(tmp_path / "d"), limits=load_limits(tmp_path / "limits.toml"))
    made = run_share(fleet, tmp_path / "out", Share(1, 1), jobs=1)
    assert [entry.status for entry in made] == ["failed"] and "table_bytes" in (made[0].reason or "")
    assert [e.content() for e in gather(fleet, tmp_path / "out")] == [e.content() for e in made]


@pytest.mark.slow
def test_on_dask_it_is_the_same_to_the_byte(lot: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local:
        cluster = Cluster(local.scheduler_address, 60.0)
        entries = run_fleet(load_manifest(lot / "d"), lot / "dask", cluster=cluster)
    assert [entry.status for entry in entries] == ["done", "done", "done", "failed"]
    assert contents(lot / "dask") == contents(lot / "whole")


def test_every_unit_is_in_one_share_of_any_number() -> None:
    units = tuple(Unit(Path(f"/lot/RLG-{k:05d}"), None) for k in range(1000))
    fleet = Fleet(units, FitOptions(), None, None)
    for of in (1, 2, 7, 50):
        parts = [mine(fleet, Share(k, of)).units for k in range(1, of + 1)]
        assert sorted(u.folder for part in parts for u in part) == [u.folder for u in units]
        assert max(map(len, parts)) < 1000 / of + 6.0 * (1000 / of) ** 0.5 + 1


def test_a_task_does_not_carry_the_fleet(tmp_path: Path) -> None:
    sizes = []
    for count in (10, 10000):
        units = tuple(Unit(tmp_path / f"RLG-{k:05d}", None) for k in range(count))
        sizes.append(len(pickle.dumps(tasks_of(Fleet(units, FitOptions(), None, None), tmp_path, False)[0])))
    assert sizes[0] == sizes[1] < 5000


def _dies_once(task: Task) -> FleetEntry:
    mark = task.out.parent / f"{task.unit.name}.died"
    if task.unit.name == "RLG-1" and not mark.exists():
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return do_unit(task)


@pytest.mark.slow
def test_a_unit_whose_process_is_killed_is_done_again(
    lot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pools, "do_unit", _dies_once)
    entries: Any = run_fleet(load_manifest(lot / "d"), tmp_path / "out", jobs=1)
    assert (tmp_path / "out" / "RLG-1.died").exists()
    assert [entry.status for entry in entries] == ["done", "done", "done", "failed"]


@pytest.mark.parametrize("text", ["0/3", "4/3", "1", "a/b", "1/3/5", "-1/3", "1/1000000"])
def test_what_is_no_share_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="--shard"):
        share_of(text)
