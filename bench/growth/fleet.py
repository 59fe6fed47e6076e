"""Many gyros of a simulated lot through `gyrotc fleet` and `gyrotc lot`."""

from __future__ import annotations

import json
import os
import tempfile
import time
from pathlib import Path
from typing import Any

from ..campaigns import say
from .commands import gyrotc

_JOBS = 2


def fleet(serials: int) -> dict[str, Any]:
    """Return the cost of a fleet of so many gyros and of its lot, interpreter and imports of every process included."""
    with tempfile.TemporaryDirectory(prefix="gyrotc-fleet-") as work:
        data, out = Path(work) / "data", Path(work) / "out"
        say(f"simulating {serials} gyros")
        gyrotc(["simulate", "paper", "--units", str(serials), "--out", str(data)])
        load, begun = os.getloadavg()[0], time.monotonic()
        cost = gyrotc(["fleet", str(data), "--out", str(out), "--jobs", str(_JOBS)])
        elapsed = time.monotonic() - begun
        lot = gyrotc(["lot", str(out), "--out", str(Path(work) / "lot.json")])
        units = [path for folder in out.iterdir() if (folder / "entry.json").is_file() for path in folder.rglob("*")]
        sizes = [path.stat().st_size for path in units if path.is_file()]
        summary = json.loads((out / "fleet.json").read_text("utf-8"))
    ratio = summary["figures"]["rms_over_floor"]
    return {
        "serials": serials,
        "jobs": _JOBS,
        "failed": summary["failed"],
        "elapsed_s": elapsed,
        "cpu_s": cost["seconds"],
        "bytes": sum(sizes),
        "load": load,
        "lot_s": lot["seconds"],
        "lot_mib": lot["peak_mib"],
        "rms_over_floor": {"median": ratio["median"], "worst": ratio["largest"]},
    }
