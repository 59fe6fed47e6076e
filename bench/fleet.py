"""`python -m bench.fleet docs [SERIALS]`: a fleet of paper size, read, fitted, emitted and checked by `gyrotc fleet`.

Twenty gyros are simulated; their recordings stand for all serials in turn, each under a serial of its own, so that
every serial is read, fitted, emitted and checked for itself.
"""

from __future__ import annotations

import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from results import machine, write

__all__ = ["fleet_figures", "section"]

_GYROS = 20
_SERIALS = 1000
_JOBS = 2
_SECTION = """## A fleet (`make fleet`)

{machine}. {serials} serials of the paper's size (12 runs of 8 h, rows of 10 s) through `gyrotc fleet` with {jobs}
processes: each read, fitted (`mrbf`), emitted in float32 and fixed point, its files checked against the reference,
and judged on its exam runs. The load is that of the machine before the job: what else wanted its processors.

| elapsed | CPU | CPU ÷ processes | CPU a serial | failed | RMS ÷ estimated noise floor, median / worst | load |
| --- | --- | --- | --- | --- | --- | --- |
{row}
"""
_ROW = (
    "| {elapsed_s:.1f} s | {cpu_s:.1f} s | {per_process_s:.1f} s | {each_ms:.0f} ms | {failed} "
    "| {median:.4f} / {worst:.4f} | {load:.1f} |"
)


def fleet_figures(serials: int) -> dict[str, Any]:
    """Times of a fleet, interpreter and imports of every process included."""
    program = Path(sys.executable).with_name("gyrotc")
    with tempfile.TemporaryDirectory(prefix="gyrotc-fleet-") as work:
        folder = Path(work)
        print(f"simulating {_GYROS} gyros", file=sys.stderr)
        with ThreadPoolExecutor(_JOBS) as pool:
            list(pool.map(lambda gyro: _simulated(program, folder, gyro), range(_GYROS)))
        print(f"{serials} serials, {_JOBS} processes", file=sys.stderr)
        for k in range(serials):
            _under_serial(folder / "gyros" / str(k % _GYROS), folder / "data" / f"RLG-{k:04d}")
        load = os.getloadavg()[0]
        begun, used = time.monotonic(), _cpu_s()
        command = [program, "fleet", folder / "data", "--out", folder / "out", "--jobs", str(_JOBS)]
        done = subprocess.run(command, check=False, stdout=subprocess.DEVNULL)
        elapsed, cpu = time.monotonic() - begun, _cpu_s() - used
        summary = json.loads((folder / "out" / "fleet.json").read_text("utf-8"))
    ratio = summary["figures"]["rms_over_floor"]
    return {
        "schema": "gyrotc.bench-fleet/1",
        "machine": machine(),
        "serials": serials,
        "jobs": _JOBS,
        "exit_status": done.returncode,
        "failed": summary["failed"],
        "elapsed_s": elapsed,
        "cpu_s": cpu,
        "load": load,
        "rms_over_floor": {"median": ratio["median"], "worst": ratio["largest"]},
    }


def _simulated(program: Path, folder: Path, gyro: int) -> None:
    source = folder / "gyros" / str(gyro)
    command = [program, "simulate", "paper", "--seed", str(gyro + 1), "--out", source]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def _under_serial(source: Path, folder: Path) -> None:
    """The same recordings (links), under a serial of their own."""
    folder.mkdir(parents=True)
    for path in source.glob("*.csv"):
        (folder / path.name).hardlink_to(path)
    text = (source / "dataset.toml").read_text("utf-8")
    (folder / "dataset.toml").write_text(
        re.sub(r'^serial = ".*"$', f'serial = "{folder.name}"', text, flags=re.M), "utf-8"
    )


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def section(figures: dict[str, Any]) -> str:
    """The section of docs/results.md as text."""
    row = _ROW.format(
        **figures,
        per_process_s=figures["cpu_s"] / figures["jobs"],
        each_ms=1e3 * figures["cpu_s"] / figures["serials"],
        median=figures["rms_over_floor"]["median"],
        worst=figures["rms_over_floor"]["worst"],
    )
    return _SECTION.format(**figures, row=row)


def main(docs: Path, serials: int) -> None:
    figures = fleet_figures(serials)
    print(json.dumps(figures, indent=1), file=sys.stderr)
    print(f"{1e3 * figures['cpu_s'] / serials:.0f} ms of processor time a serial", file=sys.stderr)
    if figures["exit_status"]:
        sys.exit("a serial failed: nothing written")
    write(docs, "fleet", figures, section)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else _SERIALS)
