"""What `--out` does to what is there, as users type it: nothing of theirs is ever lost."""

from __future__ import annotations

import errno
import io
import json
import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import HOST, Command, quick_and_slow
from gyrotc.cli import main
from gyrotc.store.files import Lock
from gyrotc.store.marker import MARKER, faults
from recordings import columns, toml, write_csv


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, gyrotc: Command) -> Path:
    """Two small gyros in `A` and `B`, and a result of the first in `result`."""
    folder = tmp_path_factory.mktemp("outputs")
    table = columns(360)
    for serial in ("A", "B"):
        write_csv(folder / serial / "run-01.csv", table | {"rate_dph": table["rate_dph"] - 20.0})
        head = f'schema = 1\nserial = "{serial}"\nearth_rate = "removed"'
        (folder / serial / "dataset.toml").write_text(toml('file = "run-01.csv"', head=head))
    assert gyrotc("fit", folder / "A", "--out", folder / "result").returncode == 0
    return folder


def tree(folder: Path) -> dict[str, bytes]:
    return {
        p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()
    }


def refused(command: Command, folder: Path, *arguments: object, told: str) -> None:
    """The command ends with 2 and one line, and nothing in the folder has changed."""
    before = tree(folder)
    done = command(*arguments)
    assert done.returncode == 2 and told in done.stderr, done.stdout + done.stderr
    assert done.stderr.count("\n") == 1 and "Traceback" not in done.stderr
    assert tree(folder) == before


@pytest.mark.parametrize("decoy", ["model.json", "manifest.json", "c"])
def test_a_firmware_project_is_not_taken_for_a_result(
    decoy: str, made: Path, tmp_path: Path, gyrotc: Command
) -> None:
    project = tmp_path / "firmware"
    (project / ".git").mkdir(parents=True)
    (project / ".git" / "HEAD").write_text("ref")
    (project / decoy).mkdir() if decoy == "c" else (project / decoy).write_text("{}")
    (project / "thesis.tex").write_text("years of work")
    for command in ("build", "fit", "compare", "diagnose") if decoy == "c" else ("build",):
        refused(gyrotc, tmp_path, command, made / "A", "--out", project, told="was not written by gyrotc")
    if decoy != "c":
        return
    refused(gyrotc, tmp_path, "simulate", "paper", "--out", project, told="was not written by gyrotc")
    refused(gyrotc, tmp_path, "plan", "paper", "--out", project, told="was not written by gyrotc")


def test_recordings_are_no_place_for_a_result(made: Path, gyrotc: Command) -> None:
    data = made / "A"
    for command in ("build", "fit", "compare", "diagnose"):
        refused(gyrotc, made, command, data, "--out", data, told="is the data set")
        refused(gyrotc, made, command, data, "--out", data / "x", told="inside the data set")
        refused(gyrotc, made, command, data, "--out", made, told="above the data set")
    refused(
        gyrotc, made, "fit", data, "--out", made / "new", "--json", data / "run-01.csv", told="run-01.csv"
    )
    refused(
        gyrotc, made, "emit", made / "result", "--out", data / ".." / "A" / "run-01.csv", told="is a file"
    )


def test_emit_puts_code_beside_the_users_own_and_deletes_none(
    made: Path, tmp_path: Path, gyrotc: Command
) -> None:
    (tmp_path / "src.c").write_text("mine")
    for _ in range(2):
        assert gyrotc("emit", made / "result", "--out", tmp_path, "--numeric", "f32").returncode == 0
    assert (tmp_path / "src.c").read_text() == "mine" and (tmp_path / "c" / "gtc.c").is_file()
    (tmp_path / "c" / "main.c").write_text("edited")
    refused(gyrotc, tmp_path, "emit", made / "result", "--out", tmp_path, told="c/main.c")


def test_a_job_of_another_kind_or_serial_is_refused(made: Path, tmp_path: Path, gyrotc: Command) -> None:
    out = tmp_path / "result"
    assert gyrotc("fit", made / "A", "--out", out).returncode == 0
    refused(gyrotc, tmp_path, "fit", made / "B", "--out", out, told="holds the result of serial A")
    refused(gyrotc, tmp_path, "plan", "paper", "--out", out, told="holds the result of gyrotc fit")
    refused(gyrotc, tmp_path, "compare", made / "A", "--out", out, told="holds the result of gyrotc fit")
    (out / MARKER).unlink()
    refused(gyrotc, tmp_path, "fit", made / "A", "--out", out, told=MARKER)


def test_steps_add_to_one_folder_and_a_new_fit_begins_anew(
    made: Path, tmp_path: Path, gyrotc: Command
) -> None:
    out = tmp_path / "result"
    steps = (
        ("fit", made / "A", "--out", out),
        ("emit", out / "model.json", "--out", out, "--numeric", "f32"),
        ("evaluate", out, made / "A", "--trace", out / "trace", "--json", out / "more.json"),
        ("report", out),
        ("verify", out, "--target", "host-gcc-O2"),
    )
    for step in (*steps, *steps[1:4]):
        done = gyrotc(*step)
        assert done.returncode == 0, done.stderr
        assert not faults(out)
    assert {p.name for p in out.iterdir()} == {
        MARKER, "model.json", "training.json", "c", "evaluate.json", "trace", "report.html", "more.json", "verify.json",
    }  # fmt: skip
    (out / "trace" / "notes.txt").write_text("mine")
    refused(gyrotc, tmp_path, *steps[2], told="trace/notes.txt")
    (out / "trace" / "notes.txt").unlink()
    for trace in (out, out / "c"):
        refused(gyrotc, tmp_path, "evaluate", out, made / "A", "--trace", trace, told="--trace")
    refused(gyrotc, tmp_path, "evaluate", out, made / "A", "--trace", made / "A", told="is the data set")
    assert gyrotc(*steps[0]).returncode == 0
    assert {p.name for p in out.iterdir()} == {MARKER, "model.json", "training.json"}
    assert json.loads((out / MARKER).read_text())["serial"] == "A"


def test_two_jobs_into_one_place(made: Path, tmp_path: Path, gyrotc: Command) -> None:
    lock = Lock(tmp_path / "out", "build")
    try:
        refused(
            gyrotc, tmp_path, "fit", made / "A", "--out", tmp_path / "out", told=f"process {os.getpid()} on"
        )
    finally:
        lock.release()
    assert gyrotc("fit", made / "A", "--out", tmp_path / "out").returncode == 0


def test_a_full_disk_and_a_place_that_cannot_be_written(made: Path, tmp_path: Path, gyrotc: Command) -> None:
    refused(gyrotc, tmp_path, "check", made / "A", "--json", "/dev/full", told="No space left")
    refused(gyrotc, tmp_path, "fit", made / "A", "--out", "/proc/out", told="/proc")
    refused(gyrotc, tmp_path, "fit", made / "A", "--out", made / "A" / "run-01.csv" / "x", told="run-01.csv")
    program = Path(sys.executable).with_name("gyrotc")
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [program, "check", made / "A"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert (done.returncode, done.stderr) == (2, "gyrotc: standard output: No space left on device\n")


def test_output_that_cannot_be_written_is_told_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Some releases of Python keep what they could not write, and try again at the end."""

    class Full(io.StringIO):
        def flush(self) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(sys, "stdout", Full())
    assert [main._flushed(status) for status in (2, 0)] == [2, 2]
    assert capsys.readouterr().err == "gyrotc: standard output: No space left on device\n"


def test_a_closed_pipe_is_told_as_shells_expect(made: Path) -> None:
    program = Path(sys.executable).with_name("gyrotc")
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [program, "check", made / "A"], stdout=writer, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, "")


@pytest.mark.parametrize("number", quick_and_slow([signal.SIGTERM], [signal.SIGINT, signal.SIGHUP]))
def test_a_signal_cleans_up_and_ends_as_shells_expect(
    number: signal.Signals, made: Path, tmp_path: Path
) -> None:
    """While it waits for a compiler, which says that it was started and then never ends."""
    tools, started, place = tmp_path / "tools", tmp_path / "started", tmp_path / "place"
    for folder in (tools, place):
        folder.mkdir()
    os.mkfifo(started)
    waiting = os.open(started, os.O_RDONLY | os.O_NONBLOCK)
    (tools / "gcc").write_text(f"#!/bin/sh\necho >'{started}'\nexec sleep 600\n")
    (tools / "gcc").chmod(0o755)
    program = Path(sys.executable).with_name("gyrotc")
    # A job in the background of a shell inherits that SIGINT is ignored; env undoes it, and becomes the program.
    job = subprocess.Popen(
        ["env", "--default-signal", program, "build", made / "A", *HOST, "--out", place / "out"],
        env=os.environ | {"PATH": f"{tools}:{os.environ['PATH']}"},
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    select.select([waiting, job.stderr], [], [])  # it ends or complains where no compiler is called
    writing = list(place.glob(".out.gyrotc-part-*"))
    job.send_signal(number)
    _, told = job.communicate()
    os.close(waiting)
    assert (job.returncode, told) == (-number, f"gyrotc: interrupted ({number.name})\n")
    assert writing and list(place.iterdir()) == []
