"""Times and peak memory, each in a process of its own with one thread; the job on raw recordings.

`python -m bench.accuracy.speed KIND NAME [ARGUMENT]...` is such a process and prints JSON: CPU seconds, the best of
several batches where a run is short; peak memory of the whole process.
"""

from __future__ import annotations

import json
import math
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from gyrotc.train import joined

from ..campaigns import say
from . import contestants

_SELECTIONS = (  # samples, grid, widths
    (1728, (25, 12), 7),
    (1728, (25, 12), 1),
    (1728, (48, 36), 1),
    (20000, (50, 40), 1),
    (172800, (50, 40), 1),
)
_CENTERS = 30
_RAW_RUNS = 6


def speed() -> dict[str, Any]:
    """Return CPU seconds and memory of selection, of whole methods, and of the job on raw recordings."""
    return {
        "raw": raw(),
        "selection": [_selection(*cell) for cell in _SELECTIONS],
        "learning": [_learning(scenario) for scenario in ("paper", "paper-ripple-strong")],
        "kohonen": _each(contestants.KOHONEN, ["172800", "300"], "kohonen"),
        "varpro": _each(contestants.VARPRO, [], "varpro"),
    }


def _cell(arguments: Sequence[str]) -> dict[str, Any]:
    """Figures of one cell; {"over_s": CPU seconds} or {"failed": last line} where there are none."""
    command = [sys.executable, "-m", "bench.accuracy.speed", *arguments]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    if made.returncode == -signal.SIGXCPU:
        return {"over_s": LIMIT_S}
    if made.returncode != 0:
        lines = made.stderr.strip().splitlines()
        return {"failed": lines[-1] if lines else f"status {made.returncode}"}
    figures: dict[str, Any] = json.loads(made.stdout)
    return figures


def _each(names: Iterable[str], arguments: list[str], kind: str) -> list[dict[str, Any]]:
    rows = []
    for name in names:
        say(f"{kind} {' '.join(arguments)}: {name}")
        rows.append({"name": name, **_cell([kind, name, *arguments])})
    return rows


def _selection(n: int, grid: tuple[int, int], widths: int) -> dict[str, Any]:
    arguments = [str(x) for x in (n, *grid, widths, _CENTERS)]
    return {
        "samples": n,
        "candidates": grid[0] * grid[1],
        "widths": widths,
        "centers": _CENTERS,
        "rows": _each(contestants.SELECTIONS, arguments, "selection"),
    }


def _learning(scenario: str) -> dict[str, Any]:
    return {"scenario": scenario, "rows": _each(contestants.METHODS, [scenario, "1"], "learning")}


def raw() -> dict[str, Any]:
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


WIDTHS = (0.15, 0.22, 0.33, 0.5, 0.75, 1.1, 1.6)
LIMIT_S = 150  # CPU seconds of a process; the system ends it there
_SHORT_S = 1.0
_REPEATS = 5
_BATCH_S = 0.2


def measured(run: Callable[[], Any]) -> tuple[float, Any]:
    """(CPU seconds, result); of short runs the best of five batches, as the clock ticks in 4 ms."""
    began = time.process_time()
    result = run()
    best = time.process_time() - began
    if best > _SHORT_S:
        return best, result
    batch = math.ceil(_BATCH_S / max(best, 1e-3))
    batches = []
    for _ in range(_REPEATS):
        began = time.process_time()
        for _ in range(batch):
            run()
        batches.append((time.process_time() - began) / batch)
    return min(batches), result


def _select(name: str, n: str, n_t: str, n_r: str, widths: str, centers: str) -> dict[str, Any]:
    run = contestants.SELECTIONS[name]
    t, r, y = contestants.cloud(200)
    run((t, r, y, (4, 3), (0.5,), 3))  # imports
    t, r, y = contestants.cloud(int(n))
    factors = WIDTHS if int(widths) == len(WIDTHS) else (0.5,)
    seconds, rms = measured(lambda: run((t, r, y, (int(n_t), int(n_r)), factors, int(centers))))
    return {"seconds": seconds, "rms": rms}


def _learn(name: str, scenario: str, seed: str) -> dict[str, Any]:
    unit = contestants.gyro(scenario, int(seed))
    data = joined(unit.train)
    learn = contestants.METHODS[name]
    learn(data.select(slice(None, None, 60)))  # type: ignore[arg-type]  # imports
    seconds, (predictor, size) = measured(lambda: learn(data))
    return {"seconds": seconds, "ratio": contestants.ratio(predictor, unit), "bytes": size}


def _kohonen(name: str, n: str, m: str) -> dict[str, Any]:
    seconds, distance = measured(contestants.KOHONEN[name](int(n), int(m)))
    return {"seconds": seconds, "rms_distance": distance}


def _varpro(name: str) -> dict[str, Any]:
    seconds, rms = measured(contestants.VARPRO[name]())
    return {"seconds": seconds, "rms": rms}


KINDS: dict[str, Callable[..., dict[str, Any]]] = {
    "selection": _select,
    "learning": _learn,
    "kohonen": _kohonen,
    "varpro": _varpro,
}


def main(arguments: list[str]) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT_S, LIMIT_S + 10))
    result = KINDS[arguments[0]](*arguments[1:])
    result["peak_gib"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(json.dumps(result))


if __name__ == "__main__":
    main(sys.argv[1:])
