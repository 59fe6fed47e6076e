"""From a file of each format to the report, as a user types it, with the seconds."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from ..campaigns import say

_ROWS = 2880  # 8 h of a row each 10 s
_CASES = {
    "CSV": "German, semicolons, decimal commas, cp1252",
    "CSV, gzip": "CSV packed by gzip, decimal commas",
    "Excel": "Excel, a sheet of stamps behind one of notes",
    "Parquet": "Parquet, units in names",
    "MATLAB": "MATLAB 5, vectors",
    "HDF5": "HDF5, a table",
    "NetCDF": "NetCDF 3, milliseconds of CF",
    "TDMS": "TDMS, waveforms",
}
"""Files of the tests by format."""


def formats() -> dict[str, Any]:
    """Return seconds of import, check and build of each format, by the clock."""
    from logger_analysis import ANALYSIS_CASES
    from logger_binaries import BINARY_CASES
    from logger_files import CSV_CASES, truth

    known = {case.id: case for case in (*CSV_CASES, *BINARY_CASES, *ANALYSIS_CASES)}
    seen = truth(_ROWS)
    found = {}
    for name, id in _CASES.items():
        case = known[id]
        say(name)
        with tempfile.TemporaryDirectory(prefix="gyrotc-formats-") as work:
            case.write(Path(work) / case.file, seen)
            commands = {
                "import": ["import", case.file, "--out", "RLG-1", *case.options],
                "check": ["check", "RLG-1"],
                "build": ["build", "RLG-1", "--out", "result"],
            }
            seconds = {step: _seconds(command, work) for step, command in commands.items()}
            page = (Path(work) / "result" / "report.html").stat().st_size
            typed = [" ".join(["gyrotc", *command]) for command in commands.values()]
            found[name] = {
                "file": case.file,
                "typed": typed,
                "page_bytes": page,
                "axes": 3 if case.axes else 1,
            } | seconds
            found[name]["seconds"] = sum(seconds.values())
    return found


def _seconds(command: list[str], work: str) -> float:
    program = Path(sys.executable).with_name("gyrotc")
    begun = time.monotonic()
    done = subprocess.run([program, "-q", *command], cwd=work, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) or (command[0] != "check" and done.returncode):
        raise RuntimeError(f"{command}: {done.stderr}")
    return time.monotonic() - begun
