"""How the cost of whole commands grows with rows, runs, centers and units: CPU seconds, peak memory, slopes."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from results import machine, table

from .fleet import under_serial

_RAW_HZ = (1, 10, 100)  # rows a second of the paper's twelve runs of 8 h
_SETS = (1, 4, 16)  # of the six runs of the paper, and one set to be judged by
_CENTERS = (4, 16, 64)
_SERIALS = (4, 16, 64)
_GYROS = 4  # whose recordings stand for all serials in turn
_HEAD = """## How cost grows (`make bench`)

{machine}. Whole commands, interpreter and imports included. Rows: twelve runs of 8 h (Parquet), of which a `fit` takes
every row through the front end. Runs: of 8 h, rows of 10 s. Centers: as many as are asked for, twelve runs. Units:
serials of the paper's size through one process. Slope: of the logarithm of the cost over that of the size, between the
two largest sizes; 1 is in proportion.
"""
_STARTER = """import os, sys
null = [(os.POSIX_SPAWN_OPEN, fd, os.devnull, os.O_WRONLY, 0) for fd in (1, 2)]
_, status, used = os.wait4(os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ, file_actions=null), 0)
if status:
    sys.exit(f"{' '.join(sys.argv[1:])} ended with status {status}")
print([used.ru_utime + used.ru_stime, used.ru_maxrss])
"""
_COLUMNS = ("what grows", "command", "sizes ", "CPU s ", "peak MiB ", "slope of CPU ", "slope of memory ")

Say = Callable[[str], None]
_Job = tuple[int, list[str]]  # size; words behind `gyrotc`


def growth(say: Say) -> dict[str, Any]:
    """Every command at every size."""
    rows = []
    with tempfile.TemporaryDirectory(prefix="gyrotc-growth-") as place:
        for what, jobs in _PARTS.items():
            for command, found in _measured(jobs(Path(place) / what), what, say).items():
                rows.append({"what": what, "command": command, "sizes": found})
    return {"machine": machine(), "rows": rows}


def _measured(jobs: Iterator[_Job], what: str, say: Say) -> dict[str, list[dict[str, float]]]:
    """By command, the cost at each size."""
    found: dict[str, list[dict[str, float]]] = {}
    for size, words in jobs:
        say(f"{what}: {size}, gyrotc {words[0]}")
        cost = _gyrotc(words)
        found.setdefault(words[0], []).append({"size": size, **cost})
    return found


def _gyrotc(words: Sequence[str]) -> dict[str, float]:
    """CPU seconds and peak memory of a command, started by a process that has next to none itself.

    A process begins with the peak of the one that started it.
    """
    command = [sys.executable, "-S", "-c", _STARTER, str(Path(sys.executable).with_name("gyrotc")), *words]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True)
    seconds, kib = json.loads(done.stdout)
    return {"seconds": seconds, "peak_mib": kib / 1024.0}


def _rows(folder: Path) -> Iterator[_Job]:
    for hz in _RAW_HZ:
        data = folder / str(hz)
        raw = ["--raw-hz", str(hz), "--format", "parquet"]
        _gyrotc(["simulate", "paper", *raw, "--out", str(data)])
        size = 12 * 8 * 3600 * hz
        yield size, ["check", str(data)]
        yield size, ["fit", str(data), "--out", f"{data}-out"]


def _runs(folder: Path) -> Iterator[_Job]:
    text = (files("gyrotc.simulate") / "scenarios" / "paper.toml").read_text("utf-8")
    profiles, train, judged = re.split(r"^(?=\[\[set\]\])", text, flags=re.MULTILINE)
    folder.mkdir()
    for sets in _SETS:
        scenario, data = folder / f"{sets}.toml", folder / str(sets)
        again = [train.replace("2026-03-02", f"{2000 + k}-03-02") for k in range(sets)]
        scenario.write_text("".join([profiles, *again, judged]), "utf-8")
        _gyrotc(["simulate", str(scenario), "--out", str(data)])
        yield 6 * sets, ["fit", str(data), "--out", f"{data}-out"]


def _centers(folder: Path) -> Iterator[_Job]:
    _gyrotc(["simulate", "paper-ripple-strong", "--out", str(folder)])
    for n in _CENTERS:
        chosen = ["--method", "mrbf", "--centers", str(n)]
        yield n, ["fit", str(folder), *chosen, "--out", f"{folder}-{n}"]


def _units(folder: Path) -> Iterator[_Job]:
    for k in range(_GYROS):
        _gyrotc(["simulate", "paper", "--seed", str(k + 1), "--out", str(folder / "gyros" / str(k))])
    for serials in _SERIALS:
        data = folder / str(serials)
        for k in range(serials):
            under_serial(folder / "gyros" / str(k % _GYROS), data / f"RLG-{k:04d}")
        yield serials, ["fleet", str(data), "--jobs", "1", "--out", f"{data}-out"]


_PARTS: dict[str, Callable[[Path], Iterator[_Job]]] = {
    "rows": _rows,
    "runs": _runs,
    "centers": _centers,
    "units": _units,
}


def section(result: dict[str, Any]) -> str:
    """The section of docs/results.md."""
    return "\n".join([_HEAD.format(**result), table(_COLUMNS, [_row(row) for row in result["rows"]])])


def _row(row: dict[str, Any]) -> list[str]:
    sizes = row["sizes"]
    cells = [" / ".join(format(one[key], form) for one in sizes) for key, form in _FORMS.items()]
    return [
        row["what"],
        f"`gyrotc {row['command']}`",
        *cells,
        _slope(sizes, "seconds"),
        _slope(sizes, "peak_mib"),
    ]


_FORMS = {"size": ",", "seconds": ".2f", "peak_mib": ".0f"}


def _slope(sizes: Sequence[dict[str, float]], key: str) -> str:
    """Between the two largest sizes."""
    small, large = sizes[-2:]
    return f"{math.log(large[key] / small[key]) / math.log(large['size'] / small['size']):.2f}"
