"""Folders of work that is thrown away: what a killed job left goes with the next, and nothing else does."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from gyrotc.store.folder import scratch_folder

JOB = """
import time
from gyrotc.store.folder import scratch_folder
with scratch_folder() as folder:
    print(folder, flush=True)
    time.sleep(600)
"""
MANY = """
from gyrotc.store.folder import scratch_folder
for _ in range(300):
    with scratch_folder() as folder:
        (folder / "x").write_text("1")
"""


@pytest.fixture(autouse=True)
def _place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def _left_by_a_killed_job(tmp_path: Path) -> Path:
    job = subprocess.Popen(
        [sys.executable, "-c", JOB], env={"TMPDIR": str(tmp_path)}, stdout=subprocess.PIPE, text=True
    )
    with job:
        assert job.stdout is not None
        left = Path(job.stdout.readline().strip())
        assert left.is_dir() and left.parent == tmp_path
        with scratch_folder():
            assert left.is_dir(), "its job lives"
        job.kill()
    return left


def test_what_a_killed_job_left_goes_with_the_next(tmp_path: Path) -> None:
    left = _left_by_a_killed_job(tmp_path)
    (left / "program").write_text("whatever it made")
    assert left.is_dir()
    with scratch_folder() as folder:
        assert not left.exists() and folder.is_dir() and not any(folder.iterdir())
        with scratch_folder() as other:
            assert folder.is_dir() and other != folder
    assert not any(tmp_path.iterdir())


def test_nothing_else_is_removed(tmp_path: Path) -> None:
    thesis = tmp_path / "thesis"
    thesis.mkdir()
    for name in ("gyrotc-12345678", ".gyrotc-scratch-notes", ".gyrotc-scratch-123456789"):
        (tmp_path / name).mkdir(mode=0o700)
        (tmp_path / name / "thesis").write_text("years")
    (tmp_path / ".gyrotc-scratch-12345678").mkdir(mode=0o755)  # not as gyrotc makes it
    (tmp_path / ".gyrotc-scratch-abcdefgh").symlink_to(thesis)
    (tmp_path / ".gyrotc-scratch-file1234").write_text("a file")
    before = sorted(tmp_path.rglob("*"))
    with scratch_folder():
        pass
    assert sorted(tmp_path.rglob("*")) == before


def test_two_that_begin_at_once_have_a_folder_each(tmp_path: Path) -> None:
    jobs = [subprocess.Popen([sys.executable, "-c", MANY], env={"TMPDIR": str(tmp_path)}) for _ in range(3)]
    assert [job.wait(300) for job in jobs] == [0, 0, 0]
    assert not any(tmp_path.iterdir())
