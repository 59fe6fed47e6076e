"""A fleet on a Dask cluster whose processes run in another folder: the recordings meant, or none; what is lost."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import distributed
import pytest
from conftest import ROOT, Command, on_terminal
from gyrotc.common import InputError
from gyrotc.fleet import Cluster, load_manifest, run_fleet
from gyrotc.fleet import run as running
from gyrotc.results import FleetEntry
from recordings import columns, toml, write_csv

SERIALS = ("RLG-1", "RLG-2", "RLG-3")
WORKERS = ("anna", "bert")
MANY = 40
LIMIT_S = 300.0 + 5.0 * MANY  # of what takes seconds, and a fraction of one a gyro, where nothing else runs
BIN = Path(sys.executable).parent


def gyro(folder: Path, serial: str, *, seed: int) -> None:
    write_csv(folder / "run-01.csv", columns(720, seed=seed))
    head = f'schema = 1\nserial = "{serial}"\nearth_rate = "none"'
    text = toml('file = "run-01.csv"', head=head, tail="[meta]\ncalibrated_on = 2026-03-01")
    (folder / "dataset.toml").write_text(text)


def wait_until(true: Callable[[], object], said: Callable[[], str]) -> None:
    end = time.monotonic() + LIMIT_S
    while not true():
        assert time.monotonic() < end, said()
        time.sleep(0.05)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`lab` with three gyros; `elsewhere`, where under the same relative path another three lie."""
    folder = tmp_path_factory.mktemp("world")
    for k, serial in enumerate(SERIALS, 1):
        gyro(folder / "lab" / "few" / serial, serial, seed=k)
        gyro(folder / "elsewhere" / "few" / serial, f"OTHER-{k}", seed=10 + k)
    (folder / "lab" / "fleet.toml").write_text('schema = 1\ndatasets = ["few/*"]\n')
    return folder


class Dask:
    """A scheduler and workers, each a process of its own in `elsewhere`; all of them end with the block."""

    def __init__(self, world: Path, logs: Path) -> None:
        self._cwd, self._logs = world / "elsewhere", logs
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.address = ""

    def __enter__(self) -> Dask:
        file = self._logs / "scheduler.json"
        own = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
        self.start("scheduler", ["dask", "scheduler", *own])
        wait_until(lambda: file.exists() and file.read_text().endswith("}"), self.said)
        self.address = json.loads(file.read_text())["address"]
        return self

    def worker(self, name: str, *options: str, preload: str = "") -> None:
        """Adds a worker and waits for it; `preload` is Python that it runs first."""
        script = self._logs / f"preload_{name}.py"
        script.write_text(preload)
        own = ["--nthreads", "1", "--name", name, "--preload", str(script), "--no-dashboard"]
        self.start(name, ["dask", "worker", self.address, *own, *options])
        with distributed.Client(self.address, timeout=LIMIT_S) as client:
            wait_until(lambda: name in self.names(client), self.said)

    @staticmethod
    def names(client: distributed.Client) -> list[str]:
        return [worker["name"] for worker in client.scheduler_info(n_workers=-1)["workers"].values()]

    def start(self, name: str, command: Sequence[str]) -> None:
        environment = os.environ | {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "2"}
        with (self._logs / f"log-{name}.txt").open("wb") as log:
            self.processes[name] = subprocess.Popen(
                [BIN / command[0], *command[1:]], cwd=self._cwd, env=environment, stdout=log, stderr=log,
                start_new_session=True,
            )  # fmt: skip

    def said(self) -> str:
        return "\n".join(path.read_text() for path in sorted(self._logs.glob("log-*.txt")))

    def kill(self, name: str) -> None:
        self.processes[name].kill()
        self.processes[name].wait()

    def __exit__(self, *_: object) -> None:
        for process in reversed(self.processes.values()):  # one that is asked to end may wait for ever
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # with what a nanny has started
            process.wait()


@pytest.fixture(scope="module")
def dask(world: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dask]:
    """A scheduler with two workers."""
    with Dask(world, tmp_path_factory.mktemp("dask")) as cluster:
        for name in WORKERS:
            cluster.worker(name, "--no-nanny")
        yield cluster


@pytest.fixture
def alone(world: Path, tmp_path: Path) -> Iterator[Dask]:
    """A scheduler of this test alone, without workers."""
    (tmp_path / "dask").mkdir()
    with Dask(world, tmp_path / "dask") as cluster:
        yield cluster


def test_relative_paths_name_the_recordings_of_who_types_them(world: Path, dask: Dask, gyrotc: Command) -> None:
    """Before: the worker took what lay under that path in its own folder, and the fleet said done, exit 0."""
    done = gyrotc("fleet", "fleet.toml", "--out", "fleet", "--scheduler", dask.address, cwd=world / "lab")
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{dask.address}: 2 workers, 2 threads, dashboard http://" in done.stdout
    summary = json.loads((world / "lab" / "fleet" / "fleet.json").read_text())
    assert [unit["serial"] for unit in summary["serials"]] == list(SERIALS)
    assert [unit["dataset"] for unit in summary["serials"]] == [f"few/{serial}" for serial in SERIALS]
    assert not (world / "elsewhere" / "fleet").exists()
    for serial in SERIALS:
        model = json.loads((world / "lab" / "fleet" / serial / "model.json").read_text())
        recording = (world / "lab" / "few" / serial / "run-01.csv").read_bytes()
        assert {data["sha256"] for data in model["data"]} == {hashlib.sha256(recording).hexdigest()}


def test_a_terminal_shows_how_many_gyros_of_a_cluster_are_done(world: Path, dask: Dask, tmp_path: Path) -> None:
    command = [BIN / "gyrotc", "fleet", "fleet.toml", "--out", tmp_path / "out", "--scheduler", dask.address]
    status, shown = on_terminal(command, cwd=world / "lab")
    assert status == 0, shown
    assert f"{dask.address}: 2 workers" in shown and "3 of 3 done, 0 failed" in shown
    lines = [line.strip() for line in re.split(r"[\r\n]", shown) if "gyros done" in line]
    assert any("0 of 3 gyros done" in line for line in lines), lines
    assert all(line.count(" %") <= 1 and line.count("left") <= 1 for line in lines), "one estimate"


def test_a_worker_that_finds_other_recordings_refuses_them(
    world: Path, dask: Dask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folder is exchanged behind the client's back, so that the worker sees what a wrong mount would show it."""
    lab = shutil.copytree(world / "lab" / "few", tmp_path / "few")
    on_dask = running.on_dask

    def mounted_wrongly(cluster: Cluster, tasks: Sequence[running.Task]) -> Iterator[tuple[int, FleetEntry]]:
        shutil.rmtree(lab / "RLG-1")
        shutil.copytree(world / "elsewhere" / "few" / "RLG-1", lab / "RLG-1")
        keys.extend(task.key for task in tasks)
        yield from on_dask(cluster, tasks)

    keys: list[str] = []
    monkeypatch.setattr(running, "on_dask", mounted_wrongly)
    entries = run_fleet(load_manifest(lab), tmp_path / "out", cluster=Cluster(dask.address, LIMIT_S))
    assert [entry.status for entry in entries] == ["failed", "done", "done"]
    reason = entries[0].reason or ""
    assert str(lab / "RLG-1") in reason and keys[0][:16] in reason
    assert any(f"on worker {name}" in reason for name in WORKERS), reason
    found = running.tasks_of(load_manifest(lab), tmp_path / "out")[0].found()
    assert found != keys[0] and found[:16] in reason
    assert not (tmp_path / "out" / "RLG-1").exists()


def test_without_a_worker_it_is_reported_what_is_waited_for(
    world: Path, alone: Dask, tmp_path: Path, gyrotc: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab, out, reported = world / "lab" / "few", tmp_path / "out", []
    with pytest.raises(InputError, match=f"{alone.address}: no worker in 1 s; expected dask worker {alone.address}"):
        run_fleet(load_manifest(lab), out, cluster=Cluster(alone.address, 1.0, reported.append))
    assert not (out / "fleet.json").exists()
    assert reported == [f"waiting for a worker of {alone.address} (0 now, 1 is enough), 1 s at most"]
    alone.kill("scheduler")
    monkeypatch.setattr(running, "_CONNECT_S", 1.0)
    done = gyrotc("fleet", lab, "--out", out, "--scheduler", alone.address)
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and alone.address in done.stderr


_HELD = """
import os, signal, time
from pathlib import Path
from gyrotc.fleet import unit
FOLDER = Path({folder!r})

def held(task, built=unit._built):
    with (FOLDER / "begun.txt").open("a") as file:
        file.write(f"{{task.unit.name}} {{os.getpid()}}\\n")
    if task.unit.name == {deadly!r}:
        os.kill(os.getpid(), signal.SIGKILL)
    while (FOLDER / task.unit.name).exists():
        time.sleep(0.05)
    return built(task)

if unit._built.__name__ != "held":  # Dask runs this twice
    unit._built = held
"""


class Held:
    """A fleet whose workers hold each gyro until it is let go; whoever begins with the deadly one is killed."""

    def __init__(
        self, world: Path, folder: Path, *, held: Sequence[str] = SERIALS, deadly: str = "", lab: Path | None = None
    ) -> None:
        self.folder, self.out, self.lab = folder, folder / "out", lab or world / "lab" / "few"
        for name in held:
            (folder / name).touch()
        self.preload = _HELD.format(folder=str(folder), deadly=deadly)
        self._log = folder / "said.txt"

    def begun(self, name: str = "") -> list[int]:
        """Processes that have begun a gyro, or any."""
        path = self.folder / "begun.txt"
        rows = [row.split() for row in path.read_text().splitlines()] if path.exists() else []
        return [int(pid) for unit, pid in rows if name in ("", unit)]

    def start(self, address: str, *more: str) -> None:
        """Starts the fleet in a process of its own."""
        program = [BIN / "gyrotc", "fleet", self.lab, "--out", self.out, "--scheduler", address, *more]
        with self._log.open("wb") as log:
            self.client = subprocess.Popen(program, stdout=log, stderr=log)

    def said(self) -> str:
        """What the client has told so far: what a worker is done with may be on its way still."""
        return self._log.read_text()

    def wait_until(self, true: Callable[[], object]) -> None:
        wait_until(lambda: true() or self.client.poll() is not None, self.said)
        assert true(), self.said()

    def let_go(self, *names: str) -> None:
        for name in names or SERIALS:
            (self.folder / name).unlink(missing_ok=True)

    def end(self) -> tuple[int, list[str], str]:
        """Exit status, what the summary says of the gyros, and output, in which no program tells of itself."""
        status = self.client.wait(LIMIT_S)
        said = self.said()
        assert "Traceback" not in said and "distributed" not in said, said
        units = json.loads((self.out / "fleet.json").read_text())["serials"]
        return status, [unit["status"] for unit in units], said


def test_a_gyro_whose_worker_is_killed_is_done_by_another(world: Path, alone: Dask, tmp_path: Path) -> None:
    held = Held(world, tmp_path)
    for name in WORKERS:
        alone.worker(name, "--no-nanny", preload=held.preload)
    held.start(alone.address)
    held.wait_until(lambda: len(held.begun()) == 2)
    os.kill(held.begun()[0], signal.SIGKILL)
    held.let_go()
    status, states, said = held.end()
    assert status == 0 and states == ["done"] * 3, said


def test_what_a_lost_scheduler_leaves_is_unfinished_and_done_by_the_next_call(
    world: Path, alone: Dask, tmp_path: Path, gyrotc: Command
) -> None:
    held = Held(world, tmp_path, held=SERIALS[1:])
    alone.worker("anna", "--no-nanny", preload=held.preload)
    held.start(alone.address)
    held.wait_until(lambda: held.begun("RLG-2") and "RLG-1: done" in held.said())
    alone.kill("scheduler")
    status, states, said = held.end()
    assert status == 1 and states == ["done", "unfinished", "unfinished"], said
    assert "0 of 3 gyros failed, 2 are not done yet" in said
    assert f"RLG-3: unfinished; {alone.address}: the scheduler was lost" in said
    alone.kill("anna")
    done = gyrotc("fleet", held.lab, "--out", held.out)
    assert done.returncode == 0 and "RLG-1: done (done before)" in done.stdout


def test_a_worker_with_another_gyrotc_refuses_with_both_versions(world: Path, alone: Dask, tmp_path: Path) -> None:
    older = 'from gyrotc.fleet import unit\nunit.__version__, unit.program_of = "0.0.1", lambda: 64 * "0"\n'
    alone.worker("anna", "--no-nanny", preload=older)
    fleet = load_manifest(world / "lab" / "few")
    entries = run_fleet(fleet, tmp_path / "out", cluster=Cluster(alone.address, LIMIT_S))
    [task, *_] = running.tasks_of(fleet, tmp_path / "out")
    for entry in entries:
        assert entry.status == "failed"
        assert f"worker anna: is 0.0.1 ({16 * '0'}), and {task.version} ({task.program[:16]})" in (entry.reason or "")


def test_every_command_of_the_page_runs(world: Path, alone: Dask, tmp_path: Path, gyrotc: Command) -> None:
    text = (ROOT / "docs" / "fleet.md").read_text("utf-8")
    for words, here in (
        ("tcp://host:8786", alone.address), ("--nworkers 8", "--nworkers 2"), ("DIR", "fleet"),
    ):  # fmt: skip
        text = text.replace(words, here)
    blocks = "".join(re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S))
    inline = [line for line in re.findall(r"`(gyrotc [^`]*)`", text) if len(line.split()) > 2]
    commands = [shlex.split(line, comments=True) for line in [*blocks.splitlines(), *inline]]
    shutil.copytree(world / "lab" / "few", tmp_path / "recordings")
    (tmp_path / "fleet.toml").write_text('schema = 1\ndatasets = ["recordings/*"]\n')
    for program, command, *words in commands:
        if command == "worker":
            alone.start("workers", [program, command, *words])
        if (program, command) != ("gyrotc", "fleet"):  # the scheduler has been started with a port of its own
            continue
        shutil.rmtree(tmp_path / "fleet", ignore_errors=True)
        done = gyrotc(command, *words, cwd=tmp_path)
        assert done.returncode == 0, (command, words, done.stdout, done.stderr)
        assert "3 of 3 done" in done.stdout
    found = [" ".join(words[:2]) for words in commands]
    assert set(found) >= {"dask scheduler", "dask worker", "gyrotc fleet"}
