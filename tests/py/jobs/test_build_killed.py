"""A build that is killed at any moment leaves no half-written result: none, the older one, or the whole new one."""

from __future__ import annotations

import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from recordings import columns, described, write_csv

pytestmark = pytest.mark.slow

KILLS = 6


def start(folder: Path, out: Path) -> subprocess.Popen[bytes]:
    """The installed command in a process group of its own, so that its compilers end with it."""
    program = Path(sys.executable).with_name("gyrotc")
    command = [str(program), "build", str(folder), "--out", str(out), "--numeric", "f32"]
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def whole(out: Path) -> bool:
    """Every file that the manifest names is there with its hash."""
    files = json.loads((out / "manifest.json").read_text())["files"]
    return len(files) > 10 and all(
        hashlib.sha256((out / name).read_bytes()).hexdigest() == digest for name, digest in files.items()
    )


def test_a_build_killed_at_random_times(tmp_path: Path) -> None:
    seed = random.SystemRandom().randrange(10**6)
    print(f"seed {seed}")
    draw = random.Random(seed)
    described(tmp_path / "RLG-1")
    small = columns(360) | {"rate_dph": columns(360)["rate_dph"] - 20.0}
    write_csv(tmp_path / "RLG-1" / "run-01.csv", small)
    begun = time.monotonic()
    assert start(tmp_path / "RLG-1", tmp_path / "first").wait() == 0
    length_s = time.monotonic() - begun
    assert whole(tmp_path / "first")
    for kill in range(KILLS):
        out = tmp_path / "out"
        process = start(tmp_path / "RLG-1", out)
        time.sleep(draw.uniform(0.0, 1.05) * length_s)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        assert not out.exists() or whole(out), f"kill {kill}, seed {seed}"
    assert start(tmp_path / "RLG-1", tmp_path / "out").wait() == 0, "what was left behind is in nobody's way"
    assert whole(tmp_path / "out")
