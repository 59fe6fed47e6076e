"""A slice of `make kills`: jobs ended between two system calls leave the earlier result or the new one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.skipif(sys.platform != "linux", reason="the shim counts system calls of Linux")
def test_a_slice_of_the_kills(tmp_path: Path) -> None:
    """Every 101st call of each way of writing, ended by KILL, TERM, INT, EIO and ENOSPC."""
    command = [sys.executable, "-m", "tests.kills.run", "--commands", "0", "--every", "101", "--json"]
    done = subprocess.run(
        [*command, tmp_path / "kills.json"],
        cwd=ROOT, env=os.environ | {"TMPDIR": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads((tmp_path / "kills.json").read_text())
    assert result["ended"] >= 40 and result["wrong"] == 0
    assert all(counted["calls"] > 250 for counted in result["counts"].values()), "the shim sees the calls"
