"""Whatever a file of a logger holds: it is read or refused within limits, and nothing else is read or written."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import ROOT

TESTS = ROOT / "tests" / "py"
SEED = 26
MOST_S, MOST_MIB = 30.0, 4096.0
_CALL = re.compile(r'\b(\w+)\((?:AT_FDCWD, |\d+(?:<[^>]*>)?, )?"([^"]*)"(.*)\) = (-?\d+)')
_CHANGING = {
    "unlink", "unlinkat", "rename", "renameat", "renameat2", "mkdir", "mkdirat", "rmdir", "link", "linkat", "symlink",
    "symlinkat", "truncate", "chmod", "fchmodat", "mknod", "mknodat",
}  # fmt: skip


def _opened(log: Path) -> Iterator[tuple[str, Path, bool]]:
    """Call, path and whether it writes, of each call that did what it should."""
    for line in log.read_text("utf-8", "replace").splitlines():
        call = _CALL.search(line)
        if call and int(call[4]) >= 0 and call[2].startswith("/"):
            name, path, rest = call[1], Path(os.path.normpath(call[2])), call[3]
            if name in ("open", "openat", "openat2", "creat"):
                yield name, path, bool(re.search(r"O_WRONLY|O_RDWR|O_CREAT|O_TRUNC", rest))
            elif name in _CHANGING:
                yield name, path, True


def _foreign(log: Path, folder: Path) -> Iterator[str]:
    """Calls that read or wrote what is neither the input, nor the output, nor Python's own."""
    own = [folder, *(Path(p) for p in ("/dev/null", "/dev/shm", "/tmp", os.environ.get("TMPDIR", "/tmp")))]
    python = [Path(p).resolve() for p in (sys.prefix, sys.base_prefix, sysconfig.get_path("stdlib"), ROOT)]
    system = [Path(p) for p in ("/usr", "/lib", "/lib64", "/etc", "/proc", "/sys", "/dev/urandom", "/dev/null", "/bin")]
    for name, path, writes in _opened(log):
        places = own if writes else [*own, *python, Path(sys.prefix), *system]
        caches = path.suffix in (".pyc",) or "__pycache__" in path.parts
        if not caches and not any(path == place or place in path.parents for place in places):
            yield f"{name} {path}"
        if path.name == "years-of-work" and not writes:
            yield f"{name} {path}"


@pytest.mark.slow
def test_500_hostile_files_are_read_or_refused_within_limits(tmp_path: Path) -> None:
    print(f"seed {SEED}")
    count = int(os.environ.get("GYROTC_HOSTILE_FILES", "500"))
    command = [sys.executable, "hostile_files.py", str(tmp_path / "work"), str(count), str(SEED)]
    log = tmp_path / "calls.txt"
    assert shutil.which("strace"), "strace is not installed: tools/setup.sh test installs it"
    command = ["strace", "-f", "-qq", "-e", "trace=%file", "-o", str(log), *command]
    (tmp_path / "work").mkdir()
    environment = os.environ | {"PYTHONPATH": str(TESTS), "XDG_CACHE_HOME": str(tmp_path / "work" / "cache")}
    done = subprocess.run(command, cwd=TESTS, env=environment, capture_output=True, text=True, check=False)
    results = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    assert len(results) == count, done.stderr[-2000:]
    print(Counter(one["status"] for one in results), f"slowest {max(one['seconds'] for one in results):.1f} s")
    assert [one for one in results if one["status"] not in (0, 2)] == []
    assert [one for one in results if one["seconds"] > MOST_S] == []
    assert max(one["own_mib"] for one in results) <= MOST_MIB
    calls = sum(1 for _ in _opened(log))
    assert calls > count, "nothing was traced"
    assert sorted(set(_foreign(log, tmp_path))) == []
