"""One gyro cannot stop a fleet, and what counts as done is what is there, whole and of these very recordings."""

from __future__ import annotations

import csv
import ctypes
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from gyrotc.assess import load_limits
from gyrotc.common import InputError
from gyrotc.fleet import SUMMARY, Fleet, Task, Unit, do_unit, load_manifest, run, run_fleet
from gyrotc.fleet import unit as units
from gyrotc.recordings import input_hashes
from gyrotc.results import MARKER, FleetEntry, held, program_of
from gyrotc.train import FitOptions
from recordings import columns, toml, write_csv

PROGRAM = Path(sys.executable).with_name("gyrotc")
HEAD = 'schema = 1\nserial = "{}"\nearth_rate = "none"'


def gyro(folder: Path, serial: str, *, seed: int = 1) -> None:
    """An hour of a small gyro."""
    rows = columns(360, seed=seed)
    write_csv(folder / "run-01.csv", rows | {"rate_dph": rows["rate_dph"] - 20.0})
    (folder / "dataset.toml").write_text(toml('file = "run-01.csv"', head=HEAD.format(serial)))


def done_before(task: Task) -> FleetEntry | None:
    """As a fleet asks it: by what the recordings hold now."""
    entry = units.made_before(task.keyed())
    return entry if entry is not None and entry.status == "done" else None


@pytest.fixture
def task(tmp_path: Path) -> Task:
    """One gyro, not done yet."""
    gyro(tmp_path / "data" / "RLG-1", "RLG-1")
    fleet = Fleet((Unit(tmp_path / "data" / "RLG-1", None),), FitOptions(), ("f32",), None)
    return Task(fleet.units[0], "RLG-1", fleet, tmp_path / "out" / "RLG-1", program_of())


def test_done_is_done_until_a_byte_of_a_recording_changes(task: Task) -> None:
    assert done_before(task) is None
    made = do_unit(task)
    assert made.status == "done", made
    assert done_before(task) == made
    path = task.unit.dataset / "run-01.csv"
    data, facts = bytearray(path.read_bytes()), path.stat()
    data[-2] = ord("1") if data[-2] != ord("1") else ord("2")
    path.write_bytes(data)
    os.utime(path, ns=(facts.st_atime_ns, facts.st_mtime_ns))
    assert (path.stat().st_size, path.stat().st_mtime_ns) == (facts.st_size, facts.st_mtime_ns)
    assert done_before(task) is None, "another recording of the same size and time"


def test_options_limits_and_program_are_part_of_what_is_done(task: Task, tmp_path: Path) -> None:
    do_unit(task)
    (tmp_path / "limits.toml").write_text("schema = 1\n[at_most]\ncenters = 20\n")
    others = {"options": FitOptions(seed=1), "numerics": None, "limits": load_limits(tmp_path / "limits.toml")}
    for name, value in others.items():
        assert done_before(replace(task, fleet=replace(task.fleet, **{name: value}))) is None, name
    assert done_before(replace(task, program="0" * 64)) is None
    other = do_unit(replace(task, program="0" * 64))
    assert other.status == "failed" and "where the fleet was started" in (other.reason or "")
    assert done_before(task) is not None


def _edit(name: str, old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new, 1))

    return change


TAMPERED: dict[str, Callable[[Path], object]] = {
    "a weight": _edit("c/gtc_rlg_1.c", "0x", "0X"),
    "the model": _edit("model.json", '"RLG-1"', '"RLG-2"'),
    "a figure of the entry": _edit("entry.json", '"after_rms_dph": ', '"after_rms_dph": 1'),
    "its status": _edit("entry.json", '"status": "done"', '"status": "dune"'),
    "a type of the entry": _edit("entry.json", '"findings": [', '"findings": [1, '),
    "deep nesting": lambda folder: (folder / "entry.json").write_text("[" * 100_000),
    "the marker": _edit(MARKER, '"kind"', '"kine"'),
    "a list of the marker": _edit(MARKER, "  model.json", "  mode1.json"),
    "an empty entry": lambda folder: (folder / "entry.json").write_text(""),
    "half the files": lambda folder: [p.unlink() for p in sorted((folder / "c").iterdir())[::2]],
    "the evaluation": lambda folder: (folder / "evaluate.json").unlink(),
}


def _stable(folder: Path) -> dict[str, bytes]:
    """Files of a result but those that tell how long it took, or hold hashes of these."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {
        path.name: path.read_bytes()
        for path in files
        if path.name not in ("training.json", "entry.json", "manifest.json", MARKER)
    }


@pytest.mark.parametrize("case", TAMPERED)
def test_a_tampered_result_is_not_done(case: str, task: Task) -> None:
    do_unit(task)
    before = _stable(task.out)
    TAMPERED[case](task.out)
    assert done_before(task) is None
    damaged = {path.relative_to(task.out): path.read_bytes() for path in task.out.rglob("*.*")}
    again = do_unit(task)
    if case == "a list of the marker":  # model.json is then a file that gyrotc did not write
        assert again.status == "failed" and "model.json" in (again.reason or "")
        return
    assert again.status == "done"
    assert _stable(task.out) == before
    if again.moved_to:  # nobody's file is lost
        moved = task.out.with_name(again.moved_to)
        assert {path.relative_to(moved): path.read_bytes() for path in moved.rglob("*.*")} == damaged
    else:
        assert case in ("half the files", "the evaluation")
    assert {p.name for p in task.out.parent.iterdir()} <= {"RLG-1", "RLG-1.changed-1"}


def test_a_foreign_file_in_a_result_stays_and_stops_its_gyro_alone(task: Task) -> None:
    do_unit(task)
    (task.out / "notes.txt").write_text("mine")
    assert done_before(task) is not None
    other = replace(task, fleet=replace(task.fleet, options=FitOptions(seed=1)))
    entry = do_unit(other)
    assert entry.status == "failed" and "notes.txt" in (entry.reason or "")
    assert "its folder holds an earlier result" in (entry.reason or "")
    assert done_before(task) is not None and (task.out / "notes.txt").read_text() == "mine"


def test_one_fleet_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gyro(tmp_path / "d" / "RLG-1", "RLG-1")
    fleet, out = load_manifest(tmp_path / "d"), tmp_path / "out"
    reported = []

    def meanwhile(_jobs: int, tasks: list[Task]) -> Any:
        with pytest.raises(InputError, match="another job writes there") as caught:
            run_fleet(fleet, out)
        reported.append(caught.value)
        yield 0, do_unit(tasks[0])

    monkeypatch.setattr(run, "on_processes", meanwhile)
    assert run_fleet(fleet, out)[0].status == "done"
    assert reported and {path.name for path in out.iterdir()} == {"RLG-1", "runtime", *SUMMARY}


@pytest.mark.parametrize("place", ["d", "d/RLG-1", "d/RLG-1/out", "."])
def test_recordings_are_never_the_place_for_results(place: str, tmp_path: Path) -> None:
    gyro(tmp_path / "d" / "RLG-1", "RLG-1")
    with pytest.raises(InputError, match="the data set"):
        run_fleet(load_manifest(tmp_path / "d"), tmp_path / place)
    assert {path.name for path in (tmp_path / "d" / "RLG-1").iterdir()} == {"run-01.csv", "dataset.toml"}


@pytest.mark.usefixtures("in_this_process")
def test_a_result_is_no_data_set(task: Task) -> None:
    data = task.unit.dataset.parent
    run_fleet(load_manifest(data), data / "out")
    assert [unit.name for unit in load_manifest(data).units] == ["RLG-1"]


@pytest.mark.usefixtures("in_this_process")
def test_a_summary_of_somebody_else_stays(tmp_path: Path) -> None:
    gyro(tmp_path / "d" / "RLG-1", "RLG-1")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "fleet.csv").write_text("aircraft,pilot\n")
    with pytest.raises(InputError, match=r"fleet\.csv"):
        run_fleet(load_manifest(tmp_path / "d"), tmp_path / "out")
    assert (tmp_path / "out" / "fleet.csv").read_text() == "aircraft,pilot\n"
    assert not (tmp_path / "out" / "RLG-1").exists(), "refused before any work"


@pytest.mark.usefixtures("in_this_process")
def test_what_a_killed_job_left_is_cleaned_also_beside_what_is_done(task: Task) -> None:
    out = task.out.parent
    run_fleet(task.fleet, out)
    before = {path.name for path in out.iterdir()}
    shutil.copytree(task.out, out / ".RLG-1.gyrotc-part-01234567")
    (out / ".RLG-1.lock").touch()
    with held(out / "RLG-1"):
        assert run_fleet(task.fleet, out)[0].kept
    assert run_fleet(task.fleet, out)[0].kept
    assert {path.name for path in out.iterdir()} == before


def test_limits_are_inside_the_result(task: Task, tmp_path: Path) -> None:
    (tmp_path / "limits.toml").write_text("schema = 1\n[at_most]\ncenters = 20\n")
    limited = replace(task, fleet=replace(task.fleet, limits=load_limits(tmp_path / "limits.toml")))
    assert do_unit(limited).status == "done"
    (limited.out / "limits.json").unlink()
    assert done_before(limited) is None


def test_recordings_that_change_while_they_are_read_are_refused(task: Task, monkeypatch: pytest.MonkeyPatch) -> None:
    from gyrotc.fleet import unit

    def load(folder: Path, **given: Any) -> Any:
        dataset = whole(folder, **given)
        with (folder / "run-01.csv").open("a") as file:
            file.write("1e9,20.0,-20.0\n")
        return dataset

    whole = unit.load
    monkeypatch.setattr(unit, "load", load)
    entry = do_unit(task)
    assert entry.status == "failed" and "changed while they were read" in (entry.reason or "")
    assert not task.out.exists()


def test_inputs_are_the_files_that_a_job_reads(tmp_path: Path) -> None:
    data, elsewhere = tmp_path / "data", tmp_path / "elsewhere"
    data.mkdir()
    elsewhere.mkdir()
    (elsewhere / "run.csv").write_text("1")
    (data / "here").symlink_to(elsewhere)
    (data / "round").symlink_to(data)
    (data / "everything").symlink_to("/")
    (data / "gone.csv").symlink_to(tmp_path / "nothing")
    os.mkfifo(data / "pipe.csv")
    (data / "notes.txt").write_text("not read")
    names = ["dataset.toml", "gone.csv", "pipe.csv"]
    assert list(input_hashes(data)) == names
    runs = "".join(f'[[run]]\nfile = "{name}"\n' for name in ("here/run.csv", "pipe.csv"))
    (data / "dataset.toml").write_text(f'schema = 1\nserial = "R"\n{runs}')
    before = input_hashes(data)
    assert list(before) == ["dataset.toml", "here/run.csv", "pipe.csv"]
    (elsewhere / "run.csv").write_text("2")
    assert [name for name in before if input_hashes(data)[name] != before[name]] == ["here/run.csv"]


def test_a_link_to_all_files_of_the_machine_does_not_stop_a_fleet(tmp_path: Path) -> None:
    gyro(tmp_path / "data" / "RLG-1", "RLG-1")
    for name in ("up", "everything"):
        (tmp_path / "data" / "RLG-1" / name).symlink_to("/" if name == "everything" else tmp_path / "data")
        (tmp_path / "data" / name).symlink_to("/" if name == "everything" else tmp_path / "data")
    command = [PROGRAM, "fleet", tmp_path / "data", "--out", tmp_path / "out", "--jobs", "1"]
    done = subprocess.run(command, capture_output=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    assert [unit["name"] for unit in json.loads((tmp_path / "out" / "fleet.json").read_text())["serials"]] == ["RLG-1"]


def _without_rights() -> None:
    """Root reads everything: take that from a child process (prctl(PR_CAPBSET_DROP), linux/capability.h)."""
    if os.geteuid() == 0:
        for capability in (1, 2):  # CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH
            ctypes.CDLL(None).prctl(24, capability, 0, 0, 0)


def test_strange_folders_concern_themselves_alone(tmp_path: Path) -> None:
    data, out = tmp_path / "data", tmp_path / "out"
    names = ["RLG-1", "fleet.json", "Fleet.CSV", "locked", os.fsdecode(b"RLG-\xff"), "two\nlines"]
    for k, name in enumerate(names):
        gyro(data / name, f"S-{k}", seed=k)
    (data / "locked").chmod(0)
    done = subprocess.run(
        [PROGRAM, "fleet", data, "--out", out, "--jobs", "1"],
        capture_output=True, check=False, preexec_fn=_without_rights,
    )  # fmt: skip
    (data / "locked").chmod(0o755)
    assert done.returncode == 1, done.stderr
    assert done.stderr == b"gyrotc: 3 of 6 gyros failed\n"
    summary = json.loads((out / "fleet.json").read_text("utf-8"))
    rows = {entry["name"]: entry for entry in summary["serials"]}
    assert {name for name, entry in rows.items() if entry["status"] == "done"} == {
        "RLG-1", r"RLG-\xff", r"two\nlines",
    }  # fmt: skip
    assert "Permission denied" in rows["locked"]["reason"] or "cannot be read" in rows["locked"]["reason"]
    for name in ("fleet.json", "Fleet.CSV"):
        assert "is a name in the folder of a fleet" in rows[name]["reason"]
    assert len(list(csv.DictReader((out / "fleet.csv").read_text("utf-8").splitlines()))) == 6
    assert r"RLG-\xff" in (out / "fleet.html").read_text("utf-8")
    assert len(done.stdout.splitlines()) == 8, "a line for each, whatever its name, the page, the next step"


def test_names_that_are_no_names(tmp_path: Path) -> None:
    for dataset in ("/", "..", str(tmp_path / "a" / ".hidden")):
        unit = Unit(Path(dataset), None)
        assert bool(unit.refused) == (dataset != "..")
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    (tmp_path / "fleet.toml").write_text('schema = 1\naxis = "all"\n[[unit]]\ndataset = "loop"\naxis = "all"\n')
    assert [unit.name for unit in load_manifest(tmp_path / "fleet.toml").units] == ["loop"]


@pytest.mark.parametrize(
    "line",
    [
        'datasets = ["a\\u0000b"]',
        "datasets = [1]",
        'datasets = [""]',
        'numeric = []\ndatasets = ["*"]',
        'datasets = ["*"]\n[options]\nmethod = "magic"',
        'datasets = ["*"]\n[options]\nseed = true',
        'datasets = ["*"]\n[options]\nblock_s = "10"',
        'datasets = ["*"]\n[options]\nblock_s = nan',
        'datasets = ["*"]\n[options]\nrho = 1.0',
    ],
)
def test_wrong_types_in_a_manifest_are_refused(line: str, tmp_path: Path) -> None:
    gyro(tmp_path / "RLG-1", "RLG-1")
    (tmp_path / "fleet.toml").write_text(f"schema = 1\n{line}\n")
    with pytest.raises(InputError, match=r"fleet\.toml"):
        load_manifest(tmp_path / "fleet.toml")


@pytest.mark.usefixtures("in_this_process")
def test_a_summary_never_speaks_of_what_is_being_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fleet that is stopped anywhere leaves a summary that says so."""
    for k in range(2):
        gyro(tmp_path / "d" / f"RLG-{k}", f"RLG-{k}", seed=k)
    fleet, out = load_manifest(tmp_path / "d"), tmp_path / "out"
    run_fleet(fleet, out)
    assert json.loads((out / "fleet.json").read_text())["done"] == 2
    gyro(tmp_path / "d" / "RLG-1", "RLG-1", seed=5)

    def stopped(_jobs: int, tasks: list[Task]) -> Any:
        assert [task.unit.name for task in tasks] == ["RLG-1"]
        do_unit(tasks[0])
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(run, "on_processes", stopped)
    with pytest.raises(KeyboardInterrupt):
        run_fleet(fleet, out)
    summary = json.loads((out / "fleet.json").read_text())
    assert [entry["status"] for entry in summary["serials"]] == ["done", "unfinished"]
    assert (summary["done"], summary["failed"], summary["unfinished"]) == (1, 0, 1)
    for name in ("fleet.csv", "fleet.html"):
        assert "unfinished" in (out / name).read_text()


def _alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_no_process_outlives_its_fleet(tmp_path: Path) -> None:
    for k in range(40):
        gyro(tmp_path / "d" / f"RLG-{k}", f"RLG-{k}", seed=k)
    job = subprocess.Popen(
        [PROGRAM, "fleet", tmp_path / "d", "--out", tmp_path / "out", "--jobs", "2"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    while not list((tmp_path / "out").glob("RLG-*/entry.json")):
        assert job.poll() is None
        time.sleep(0.02)
    children = [int(c) for t in Path(f"/proc/{job.pid}/task").iterdir() for c in (t / "children").read_text().split()]
    assert len(children) >= 2
    job.kill()
    job.wait()
    end = time.monotonic() + 60.0
    while any(_alive(pid) for pid in children):
        assert time.monotonic() < end, "a process goes on writing for a fleet that is gone"
        time.sleep(0.05)
