"""What is compiled and run for others has a folder, limits and an environment of its own, and leaves no process."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest
from gyrotc.common.errors import CheckFailed
from gyrotc.verify.toolchain import confined, run_to_end


def _python(code: str, folder: Path) -> tuple[int, str]:
    done = run_to_end([sys.executable, "-I", "-c", code], folder, "the test")
    return done.returncode, done.stdout.decode() + done.stderr


def _ended(pid: int) -> None:
    """The process is gone, or waits for its parent to take note of its end."""
    stat = Path(f"/proc/{pid}/stat")
    for _ in range(6000):
        try:
            if stat.read_text().rpartition(")")[2].split()[0] == "Z":
                return
        except (FileNotFoundError, ProcessLookupError):
            return
        time.sleep(0.01)
    pytest.fail(f"process {pid} still runs")


def test_nothing_of_the_users_environment_but_the_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SECRET_TOKEN", "s3cret")
    done = run_to_end(["env"], tmp_path, "the test")
    seen = dict(line.split("=", 1) for line in done.stdout.decode().splitlines())
    assert set(seen) - {"PWD", "_", "SHLVL", "OLDPWD"} == {"PATH", "HOME", "TMPDIR", "LANG", "LC_ALL"}
    assert seen["HOME"] == seen["TMPDIR"] == str(tmp_path)


def test_works_in_its_folder_without_input_and_without_core_dumps(tmp_path: Path) -> None:
    code = "import os, sys, resource as r; print(os.getcwd(), sys.stdin.read() == '', r.getrlimit(r.RLIMIT_CORE))"
    assert _python(code, tmp_path) == (0, f"{tmp_path} True (0, 0)\n")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not have every limit")
def test_memory_and_files_are_limited(tmp_path: Path) -> None:
    status, said = _python("x = bytearray(3 * 2**30)", tmp_path)
    assert status == 1 and "MemoryError" in said
    assert _python("x = bytearray(2**28)", tmp_path) == (0, "")
    status, said = _python("open('big', 'wb').truncate(5 * 2**30)", tmp_path)
    assert status != 0


def test_an_argument_is_never_read_by_the_shell(tmp_path: Path) -> None:
    word = "'; touch here; $(touch there) `touch all` \"\\"
    assert run_to_end(["printf", "%s", word], tmp_path, "the test").stdout.decode() == word
    assert list(tmp_path.iterdir()) == []


def test_what_does_not_end_is_ended_with_all_its_children(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gyrotc.verify.toolchain.LIMIT_S", 1)
    command = ["sh", "-c", "sleep 1000 & echo $! > child; sleep 1000"]
    with pytest.raises(CheckFailed, match="the test did not end within 1 s"):
        run_to_end(command, tmp_path, "the test")
    _ended(int((tmp_path / "child").read_text()))


def test_a_child_that_was_left_behind_ends_with_the_program(tmp_path: Path) -> None:
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with confined(["sh", "-c", "sleep 1000 & echo $! > child"], tmp_path, cpu_s=10, **streams) as process:
        process.wait()
    _ended(int((tmp_path / "child").read_text()))
