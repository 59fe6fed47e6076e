"""Measure how the cost of commands grows with rows, runs, centers and units, and what the stages of a build cost."""

from __future__ import annotations

import compileall
import itertools
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import gyrotc as package

from ..campaigns import say

_RAW_HZ = (1, 10, 300)  # rows a second of twelve runs of 8 h: 1e8 rows in all, the largest that is promised
_SETS = (1, 4, 17)  # of the six runs of the paper, and one set to be judged by
_CENTERS = (4, 16, 64)
_SERIALS = (4, 16, 64)
_BUILD = """import json, resource, sys
from pathlib import Path
def used():
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in both)
marks = [("starting", 0.0)]
from gyrotc.jobs.calibration import build
def note(stage, *_):
    marks.append((stage.split()[0].rstrip(":"), used()))
build(Path(sys.argv[1]), Path(sys.argv[2]), progress=note)
print(json.dumps([*marks, ("", used())]))
"""
_STARTER = """import os, sys
null = [(os.POSIX_SPAWN_OPEN, fd, os.devnull, os.O_WRONLY, 0) for fd in (1, 2)]
_, status, used = os.wait4(os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ, file_actions=null), 0)
if status:
    sys.exit(f"{' '.join(sys.argv[1:])} ended with status {status}")
print([used.ru_utime + used.ru_stime, used.ru_maxrss])
"""
_Job = tuple[int, list[str]]  # size; words behind `gyrotc`


def growth(*, quick: bool = False) -> dict[str, Any]:
    """Return the cost of every command at every size, and of the stages of a build.

    Args:
        quick: Only commands over the number of centers.
    """
    rows = []
    with tempfile.TemporaryDirectory(prefix="gyrotc-growth-") as place:
        for what, jobs in _PARTS.items():
            if quick and what != "centers":
                continue
            for command, found in _measured(jobs(Path(place) / what), what).items():
                rows.append({"what": what, "command": command, "sizes": found})
        say("stages of a build")
        return {"rows": rows, **_stages(Path(place) / "stages")}


def _stages(folder: Path) -> dict[str, Any]:
    """CPU seconds by what `build` says that it is doing: the first with an empty cache, and one of another gyro."""
    load, costs = os.getloadavg()[0], []
    environment = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")}
    for seed in (1, 2):
        data = folder / str(seed)
        gyrotc(["simulate", "paper", "--seed", str(seed), "--out", str(data)])
        command = [sys.executable, "-c", _BUILD, str(data), f"{data}-out"]
        marks = json.loads(subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True).stdout)
        cost: dict[str, float] = {}
        for (name, began), (_, ended) in itertools.pairwise(marks):
            cost[name] = cost.get(name, 0.0) + ended - began
        costs.append(cost)
    first, later = costs
    stages = [{"stage": name, "first_s": first[name], "later_s": later.get(name, 0.0)} for name in first]
    whole = {"first_s": sum(first.values()), "later_s": sum(later.values())}
    return {"load": load, "stages": [*stages, {"stage": "all", **whole}]}


def _measured(jobs: Iterator[_Job], what: str) -> dict[str, list[dict[str, float]]]:
    """By command, the cost at each size."""
    found: dict[str, list[dict[str, float]]] = {}
    for size, words in jobs:
        say(f"{what}: {size}, gyrotc {words[0]}")
        cost = gyrotc(words)
        found.setdefault(words[0], []).append({"size": size, **cost})
    return found


def gyrotc(words: Sequence[str]) -> dict[str, float]:
    """CPU seconds and peak memory of a command, started by a process that has next to none itself.

    A process begins with the peak of the one that started it. Bytecode is there, as after an installation.
    """
    compileall.compile_dir(Path(package.__file__).parent, quiet=2)
    command = [sys.executable, "-S", "-c", _STARTER, str(Path(sys.executable).with_name("gyrotc")), *words]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True)
    seconds, kib = json.loads(done.stdout)
    return {"seconds": seconds, "peak_mib": kib / 1024.0}


def _rows(folder: Path) -> Iterator[_Job]:
    for hz in _RAW_HZ:
        data = folder / str(hz)
        raw = ["--raw-hz", str(hz), "--format", "parquet"]
        gyrotc(["simulate", "paper", *raw, "--out", str(data)])
        size = 12 * 8 * 3600 * hz
        yield size, ["check", str(data)]
        yield size, ["fit", str(data), "--out", f"{data}-out"]
        yield size, ["build", str(data), "--out", f"{data}-build"]
        yield size, ["diagnose", str(data), "--out", f"{data}-diagnosis"]
        shutil.rmtree(data)


def _gradient(folder: Path) -> Iterator[_Job]:
    for hz in _RAW_HZ[1:]:
        data = folder / str(hz)
        gyrotc(["simulate", "thermal-gradient", "--raw-hz", str(hz), "--format", "parquet", "--out", str(data)])
        yield 12 * 8 * 3600 * hz, ["diagnose", str(data), "--out", f"{data}-diagnosis"]
        shutil.rmtree(data)


def _runs(folder: Path) -> Iterator[_Job]:
    text = (files("gyrotc.simulate") / "scenarios" / "paper.toml").read_text("utf-8")
    profiles, train, judged = re.split(r"^(?=\[\[set\]\])", text, flags=re.MULTILINE)
    folder.mkdir()
    for sets in _SETS:
        scenario, data = folder / f"{sets}.toml", folder / str(sets)
        again = [train.replace("2026-03-02", f"{2000 + k}-03-02") for k in range(sets)]
        scenario.write_text("".join([profiles, *again, judged]), "utf-8")
        gyrotc(["simulate", str(scenario), "--out", str(data)])
        yield 6 * sets, ["fit", str(data), "--out", f"{data}-out"]


def _centers(folder: Path) -> Iterator[_Job]:
    gyrotc(["simulate", "paper-ripple-strong", "--out", str(folder)])
    stated = (folder / "dataset.toml").read_text("utf-8")
    for n in _CENTERS:
        (folder / "dataset.toml").write_text(f'{stated}[fit]\nmethod = "mrbf"\ncenters = {n}\n', "utf-8")
        yield n, ["fit", str(folder), "--out", f"{folder}-{n}"]


def _units(folder: Path) -> Iterator[_Job]:
    gyrotc(["simulate", "paper", "--units", str(max(_SERIALS)), "--out", str(folder)])
    for serials in _SERIALS:
        manifest, out = folder / f"{serials}.toml", folder / f"out-{serials}"
        names = sorted(path.parent.name for path in folder.glob("*/dataset.toml"))[:serials]
        manifest.write_text(f"schema = 1\ndatasets = {json.dumps(names)}\n", "utf-8")
        yield serials, ["fleet", str(manifest), "--jobs", "1", "--out", str(out)]
        yield serials, ["lot", str(out), "--out", f"{out}.json"]


_PARTS: dict[str, Callable[[Path], Iterator[_Job]]] = {
    "rows": _rows,
    "gradient": _gradient,
    "runs": _runs,
    "centers": _centers,
    "units": _units,
}


def slope(sizes: Sequence[dict[str, float]], key: str) -> float:
    """Return the slope of the logarithm of a cost over that of the size, between the two largest sizes."""
    small, large = sizes[-2:]
    return math.log(large[key] / small[key]) / math.log(large["size"] / small["size"])
