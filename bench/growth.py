"""How the cost of whole commands grows with rows, runs, centers and units, and what the stages of a build cost."""

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
from results import machine, table

_RAW_HZ = (1, 10, 300)  # rows a second of twelve runs of 8 h: 1e8 rows in all, the largest that is promised
_SETS = (1, 4, 17)  # of the six runs of the paper, and one set to be judged by
_CENTERS = (4, 16, 64)
_SERIALS = (4, 16, 64)
_HEAD = """## How cost grows (`make bench`)

{machine}. Whole commands, interpreter and imports included. Rows: twelve runs of 8 h (Parquet), of which a `fit` takes
every row through the front end. Gradient: as many rows, of a gyro whose diagnosis ships a state and is measured on exam
runs. Runs: of 8 h, rows of 10 s. Centers: as many as are asked for, twelve runs. Units:
serials of the paper's size through one process, and their lot. Slope: of the logarithm of the cost over that of the
size, between the two largest sizes; 1 is in proportion.
"""
_STAGES = """
## Stages of a build (`python -m bench docs --only growth`)

CPU seconds of `gyrotc build` of the paper's recordings on all targets found, compilers and emulators included: the
first, with an empty cache, and a later one of another gyro. Load before it: {load:.1f}.

"""
_CITED = """
## Before

CPU seconds (MB: megabytes) as they were measured on {commit}, on two processors; by size where there are several.

"""
_BUILD = """import json, resource, sys
from pathlib import Path
def used():
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in both)
marks = [("starting", 0.0)]
from gyrotc.jobs.build import build
from gyrotc.train.fitting import FitOptions
build(Path(sys.argv[1]), Path(sys.argv[2]), FitOptions(), progress=lambda text: marks.append((text.split()[0], used())))
print(json.dumps([*marks, ("", used())]))
"""
_STARTER = """import os, sys
null = [(os.POSIX_SPAWN_OPEN, fd, os.devnull, os.O_WRONLY, 0) for fd in (1, 2)]
_, status, used = os.wait4(os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ, file_actions=null), 0)
if status:
    sys.exit(f"{' '.join(sys.argv[1:])} ended with status {status}")
print([used.ru_utime + used.ru_stime, used.ru_maxrss])
"""
_COLUMNS = ("what grows", "command", "sizes ", "CPU s ", "peak MiB ", "slope of CPU ", "slope of memory ")

# Measured on commit 3e1e809 on a machine of two processors, before the cost was cut; cited, not measured here.
# By figure: CPU s by size, or one number (MB: megabytes).
_BEFORE: dict[str, Any] = {
    "commit": "3e1e809",
    "check of 1e8 rows": 87.0,
    "fit of 1e8 rows": 69.0,
    "diagnose of 1e8 rows": 112.0,
    "fit of runs": {"12": 1.44, "102": 9.2},
    "fit of centers": {"16": 1.9, "64": 9.8, "256": 30.8},
    "lot of 1000 units": 38.7,
    "lot of 1000 units, MB": 804.0,
    "fleet of 1000 serials": 212.0,
    "build": 21.9,
    "build, compiling": 12.9,
    "a serial's files, MB": 1.31,
}

Say = Callable[[str], None]
_Job = tuple[int, list[str]]  # size; words behind `gyrotc`


def growth(say: Say) -> dict[str, Any]:
    """Every command at every size."""
    rows = []
    with tempfile.TemporaryDirectory(prefix="gyrotc-growth-") as place:
        for what, jobs in _PARTS.items():
            for command, found in _measured(jobs(Path(place) / what), what, say).items():
                rows.append({"what": what, "command": command, "sizes": found})
        say("stages of a build")
        stages = _stages(Path(place) / "stages")
    slopes = {row["what"]: _slope(row["sizes"], "seconds") for row in rows if row["what"] in ("runs", "centers")}
    return {"machine": machine(), "rows": rows, "slopes": slopes, "before": _BEFORE, **stages}


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


def _measured(jobs: Iterator[_Job], what: str, say: Say) -> dict[str, list[dict[str, float]]]:
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
    for n in _CENTERS:
        chosen = ["--method", "mrbf", "--centers", str(n)]
        yield n, ["fit", str(folder), *chosen, "--out", f"{folder}-{n}"]


def _units(folder: Path) -> Iterator[_Job]:
    gyrotc(["simulate", "lot", "--units", str(max(_SERIALS)), "--out", str(folder)])
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


def section(result: dict[str, Any]) -> str:
    """The section of docs/results.md."""
    stages = [[one["stage"], f"{one['first_s']:.2f}", f"{one['later_s']:.2f}"] for one in result["stages"]]
    return "\n".join(
        [
            _HEAD.format(**result),
            table(_COLUMNS, [_row(row) for row in result["rows"]])
            + _STAGES.format(**result)
            + table(("stage", "first ", "later "), stages)
            + _CITED.format(**result["before"])
            + table(
                ("figure", "then "),
                [[name, _then(value)] for name, value in result["before"].items() if name != "commit"],
            ),
        ]
    )


def _then(value: float | dict[str, float]) -> str:
    return " / ".join(f"{size}: {one:g}" for size, one in value.items()) if isinstance(value, dict) else f"{value:g}"


def _row(row: dict[str, Any]) -> list[str]:
    sizes = row["sizes"]
    cells = [" / ".join(format(one[key], form) for one in sizes) for key, form in _FORMS.items()]
    return [
        row["what"],
        f"`gyrotc {row['command']}`",
        *cells,
        *(f"{_slope(sizes, key):.2f}" for key in ("seconds", "peak_mib")),
    ]


_FORMS = {"size": ",", "seconds": ".2f", "peak_mib": ".0f"}


def _slope(sizes: Sequence[dict[str, float]], key: str) -> float:
    """Between the two largest sizes."""
    small, large = sizes[-2:]
    return math.log(large[key] / small[key]) / math.log(large["size"] / small["size"])
