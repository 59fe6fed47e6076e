"""Memory that commands take for long recordings: bytes a row, from the peaks of two processes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROWS = (100_000, 300_000)
PROGRAM = """
import sys
from gyrotc.cli import main
status = main.run(sys.argv[1:])
peak_kib = dict(line.split(":") for line in open("/proc/self/status"))["VmHWM"]  # ru_maxrss has the parent's, too
print(status, peak_kib.split()[0])
"""


def peak_bytes(*words: str | Path) -> int:
    done = subprocess.run([sys.executable, "-c", PROGRAM, *words], capture_output=True, text=True, check=True)
    status, peak_kib = done.stdout.splitlines()[-1].split()
    assert status == "0", done.stderr
    return 1024 * int(peak_kib)


@pytest.fixture(scope="module")
def peaks(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[int]]:
    """Peaks of an import and of a check, by rows."""
    found: dict[str, list[int]] = {"import": [], "check": []}
    for rows in ROWS:
        folder = tmp_path_factory.mktemp("long")
        with (folder / "a.csv").open("w") as file:
            file.write("time_s,temperature_c,rate_dph,supply_v\n")
            file.writelines(f"{k / 100},{20.0 + k % 1000 / 1000:.3f},20.123456,0.123456\n" for k in range(rows))
        found["import"].append(peak_bytes("import", folder / "a.csv", "--out", folder / "RLG-1"))
        found["check"].append(peak_bytes("check", folder / "RLG-1"))
    return found


@pytest.mark.parametrize(("command", "most"), [("import", 64.0), ("check", 220.0)])
def test_a_row_takes_few_bytes(command: str, most: float, peaks: dict[str, list[int]]) -> None:
    """An import holds parts of a file (27 bytes a row were measured), a check one run of four columns (146)."""
    few, many = peaks[command]
    assert (many - few) / (ROWS[1] - ROWS[0]) < most
