"""What a shell may do to a command: streams that are closed, links in a loop, a format that there is not."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import Command


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", ">&- 2>&- <&-"])
def test_closed_streams_are_no_fault(closed: str) -> None:
    line = f"{sys.executable} -m gyrotc --version {closed}"
    done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr


def test_a_loop_of_links_is_one_line(tmp_path: Path, gyrotc: Command) -> None:
    (tmp_path / "a.csv").symlink_to("b.csv")
    (tmp_path / "b.csv").symlink_to("a.csv")
    done = gyrotc("import", tmp_path / "a.csv", "--serial", "a", "--out", tmp_path / "R")
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1, done.stderr


def test_an_unknown_format_is_refused(tmp_path: Path, gyrotc: Command) -> None:
    done = gyrotc("simulate", "paper", "--format", "x", "--out", tmp_path / "R")
    assert done.returncode == 2 and not (tmp_path / "R").exists()
