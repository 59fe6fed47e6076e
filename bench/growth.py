"""`python -m bench.growth [--out FILE]`: CPU time and memory of `gyrotc fit` over runs and centers, a lot over units.

Each size is a process of its own with one thread, so that its memory is what it needs. The slope is that of a
line through the logarithms of size and processor time; the start of the program counts, too.
Units of the lot are drawn from the model of a lot itself, at the places of one simulated gyro: what learning costs
depends on their number and on the functions that count, not on how they were simulated.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

RUNS, CENTERS, UNITS = (12, 25, 51, 102), (16, 64, 256), (50, 200, 1000)
_SEED, _NOISE_DPH = 4711, 0.3
_PROFILES = ("20 C", "-40 C", "60 C", "1 C/min", "3 C/min", "5 C/min")
_CAMPAIGN = """extends = "paper"
title = "{0} runs"
[[set]]
role = "train"
started = 2026-03-02T08:00:00Z
every_h = 24.0
profiles = {1}
"""


def measured(command: list[str]) -> dict[str, float]:
    """CPU seconds and peak memory of a command."""
    one = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    process = subprocess.Popen(command, env=one, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if status != 0:
        raise RuntimeError(f"{' '.join(command)} ended with status {process.returncode}")
    return {"cpu_s": used.ru_utime + used.ru_stime, "memory_mib": used.ru_maxrss / 1024.0}


def slope(rows: list[dict[str, float]]) -> float:
    """Of processor time over size, on a log-log line."""
    size, cost = (np.log([row[key] for row in rows]) for key in ("size", "cpu_s"))
    return float(np.polyfit(size, cost, 1)[0])


def learn_lot(units: int, training: Path) -> None:
    """Learns a lot of so many drawn units, at the places of the means in a `training.json`."""
    from gyrotc.lot.basis import PRIOR_LOG, LotBasis
    from gyrotc.lot.learn import learn
    from gyrotc.train.means import UnitMeans

    means = json.loads(training.read_text("utf-8"))["means"]
    t, r, count = (np.array(means[key]) for key in ("temperature_c", "slope_c_per_min", "count"))
    rng = np.random.default_rng(_SEED)
    envelope = (float(t.min()) - 1.0, float(t.max()) + 1.0), (float(r.min()) - 0.1, float(r.max()) + 0.1)
    basis = LotBasis.over(*envelope)
    spread = np.sqrt(basis.variance(PRIOR_LOG))
    mean, directions = spread * rng.normal(size=len(spread)), spread * rng.normal(size=(2, len(spread)))

    def drawn() -> UnitMeans:
        at = t + rng.normal(0.0, 0.05, len(t)), r + rng.normal(0.0, 0.005, len(r))
        own = mean + rng.normal(size=2) @ directions + 0.2 * spread * rng.normal(size=len(spread))
        noise = rng.normal(size=len(t)) * _NOISE_DPH / np.sqrt(count)
        return UnitMeans(*at, basis.values(*at) @ own + noise, count, _NOISE_DPH)

    learn([drawn() for _ in range(units)], envelope, lambda _: None)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.growth")
    parser.add_argument("--out", type=Path, help="JSON file for the figures")
    parser.add_argument("--only", choices=["runs", "centers", "units"])
    parser.add_argument("--learn", nargs=2, help=argparse.SUPPRESS)  # a lot in a process of its own
    asked = parser.parse_args()
    if asked.learn:
        learn_lot(int(asked.learn[0]), Path(asked.learn[1]))
        return 0
    program = str(Path(sys.executable).with_name("gyrotc"))
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)

        def recorded(runs: int) -> str:
            campaign, data = folder / f"{runs}.toml", folder / f"{runs}"
            profiles = [_PROFILES[k % len(_PROFILES)] for k in range(runs)]
            campaign.write_text(_CAMPAIGN.format(runs, json.dumps(profiles)), "utf-8")
            measured([program, "simulate", str(campaign), "--seed", "1", "--out", str(data)])
            return str(data)

        def row(part: str, size: int, command: list[str]) -> None:
            found.setdefault(part, []).append({"size": size, **measured(command)})
            print(part, found[part][-1], flush=True)

        few, out = recorded(RUNS[0]), str(folder / "out")
        fit = [program, "fit", few, "--out", out]
        if asked.only in (None, "runs"):
            for n in RUNS:
                row("runs", n, [program, "fit", recorded(n), "--out", out])
        if asked.only in (None, "centers"):
            for n in CENTERS:
                row("centers", n, [*fit, "--centers", str(n)])
        if asked.only in (None, "units"):
            measured(fit)
            for n in UNITS:
                row(
                    "units",
                    n,
                    [sys.executable, "-m", "bench.growth", "--learn", str(n), f"{out}/training.json"],
                )
    for part, rows in found.items():
        print(f"{part}: slope {slope(rows):.2f}")
    if asked.out:
        asked.out.write_text(json.dumps(found, indent=1) + "\n", "utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
