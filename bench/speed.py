"""Times and peak memory, each in a process of its own with one thread (bench.cell); the job on raw recordings."""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from . import learning, pieces, selection
from .cell import LIMIT_S

__all__ = ["raw", "speed"]

_SELECTIONS = (  # samples, grid, widths
    (1728, (25, 12), 7),
    (1728, (25, 12), 1),
    (1728, (48, 36), 1),
    (20000, (50, 40), 1),
    (172800, (50, 40), 1),
)
_CENTERS = 30
_RAW_RUNS = 6

Say = Callable[[str], None]


def speed(say: Say) -> dict[str, Any]:
    """All tables of the section on speed."""
    return {
        "raw": raw(say),
        "selection": [_selection(*cell, say) for cell in _SELECTIONS],
        "learning": [_learning(scenario, say) for scenario in ("paper", "paper-ripple-strong")],
        "kohonen": _each(pieces.KOHONEN, ["172800", "300"], "kohonen", say),
        "varpro": _each(pieces.VARPRO, [], "varpro", say),
    }


def _cell(arguments: Sequence[str]) -> dict[str, Any]:
    """Figures of one cell; {"over_s": CPU seconds} or {"failed": last line} where there are none."""
    command = [sys.executable, "-m", "bench.cell", *arguments]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    if made.returncode == -signal.SIGXCPU:
        return {"over_s": LIMIT_S}
    if made.returncode != 0:
        lines = made.stderr.strip().splitlines()
        return {"failed": lines[-1] if lines else f"status {made.returncode}"}
    figures: dict[str, Any] = json.loads(made.stdout)
    return figures


def _each(contestants: dict[str, Any], arguments: list[str], kind: str, say: Say) -> list[dict[str, Any]]:
    rows = []
    for name in contestants:
        say(f"{kind} {' '.join(arguments)}: {name}")
        rows.append({"name": name, **_cell([kind, name, *arguments])})
    return rows


def _selection(n: int, grid: tuple[int, int], widths: int, say: Say) -> dict[str, Any]:
    arguments = [str(x) for x in (n, *grid, widths, _CENTERS)]
    return {
        "samples": n,
        "candidates": grid[0] * grid[1],
        "widths": widths,
        "centers": _CENTERS,
        "rows": _each(selection.CONTESTANTS, arguments, "selection", say),
    }


def _learning(scenario: str, say: Say) -> dict[str, Any]:
    return {"scenario": scenario, "rows": _each(learning.CONTESTANTS, [scenario, "1"], "learning", say)}


def raw(say: Say) -> dict[str, Any]:
    """Six runs of 2.88 million rows (100 Hz, Parquet) to a C file that is proven on this machine."""
    program = str(Path(sys.executable).with_name("gyrotc"))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        say("raw recordings: simulating")
        simulated = _child(
            [program, "simulate", "paper", "--seed", "1", "--raw-hz", "100", "--format", "parquet",
             "--out", str(folder / "all")]
        )  # fmt: skip
        (folder / "data").mkdir()
        for k in range(_RAW_RUNS):
            shutil.move(folder / "all" / f"run-{k + 1:02d}.parquet", folder / "data")
        steps: list[dict[str, Any]] = []
        out = str(folder / "out")
        for step in (
            ["fit", str(folder / "data"), "--out", out],
            ["emit", f"{out}/model.json", "--out", out],
            ["verify", out, "--target", "host-gcc-O2"],
        ):
            say(f"raw recordings: {step[0]}")
            steps.append({"step": step[0], **_child([program, *step])})
    return {
        "simulated": simulated,
        "steps": steps,
        "seconds": sum(s["seconds"] for s in steps),
        "elapsed_s": sum(s["elapsed_s"] for s in steps),
        "peak_gib": max(s["peak_gib"] for s in steps),
    }


def _child(command: list[str]) -> dict[str, float]:
    """CPU and elapsed seconds and peak memory of one command."""
    began = time.monotonic()
    process = os.posix_spawn(command[0], command, os.environ, file_actions=[
        (os.POSIX_SPAWN_OPEN, fd, os.devnull, os.O_WRONLY, 0) for fd in (1, 2)
    ])  # fmt: skip
    _, status, used = os.wait4(process, 0)
    if status != 0:
        raise RuntimeError(f"{' '.join(command)} ended with status {status}")
    return {
        "seconds": used.ru_utime + used.ru_stime,
        "elapsed_s": time.monotonic() - began,
        "peak_gib": _gib(used),
    }


def _gib(used: resource.struct_rusage) -> float:
    return used.ru_maxrss / 2**20
