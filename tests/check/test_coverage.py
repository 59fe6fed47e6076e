"""The coverage of the C library can fail."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from conftest import require

ROOT = Path(__file__).resolve().parents[2]


def test_without_the_tests_of_a_file_its_lines_are_reported(tmp_path: Path) -> None:
    for folder in ("include", "libc", "tests/c"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    for test in (tmp_path / "tests/c").glob("test_*.c"):
        if test.stem not in ("test_map", "test_broken", "test_least"):  # the script names the last two
            test.unlink()
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools" / "coverage.sh", tmp_path / "tools")
    gcovr = Path(sys.executable).with_name("gcovr")
    require(None if gcovr.is_file() else "gcovr")
    done = subprocess.run(
        [tmp_path / "tools" / "coverage.sh"],
        env=os.environ | {"GCOVR": str(gcovr)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    rows = {row.split()[0]: row.split()[1:] for row in done.stdout.splitlines() if row.startswith("libc/")}
    branches, taken, _, missed = rows["libc/gtc_save.inl"]
    assert int(taken) < int(branches) and missed
