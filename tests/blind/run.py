"""`make blind`: a fresh blind run, resumable, its table appended to docs/results.md.

    python -m tests.blind.run [--records 640] [--seed N] [--workers 2] [--results docs/results.md]

The seed comes from the operating system and is printed; the same seed continues or repeats a run.
"""

from __future__ import annotations

import argparse
import json
import os
import secrets
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from . import campaign as campaigns
from .draw import Order, campaign_of, orders, recording_of
from .grade import Row, grade, text

PER_CAMPAIGN = 32
ROOT = Path(__file__).resolve().parents[2]


class Tool:
    """The process under test."""

    def __init__(self, cache: Path) -> None:
        environment = {
            "PATH": os.environ.get("PATH", ""),
            "HOME": str(cache),
            "XDG_CACHE_HOME": str(cache),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }
        if "PYTHONPATH" in os.environ:
            environment["PYTHONPATH"] = os.environ["PYTHONPATH"]
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("tool.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
            cwd=cache,
        )

    def diagnose(self, folder: Path) -> dict[str, Any]:
        assert self.process.stdin is not None and self.process.stdout is not None
        answer = folder.with_suffix(".json")
        self.process.stdin.write(f"{folder}\t{answer}\n")
        self.process.stdin.flush()
        if not self.process.stdout.readline():
            raise RuntimeError("the tool died")
        return dict(json.loads(answer.read_text(encoding="utf-8")))

    def close(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def one_campaign(
    seed: int, number: int, todo: list[tuple[int, Order]], cache: Path, store: Path | None, verbose: bool
) -> list[Row]:
    """All recordings of one campaign, one after the other."""
    campaign, yardstick = campaign_of(seed, number)
    tool = Tool(cache)
    rows = []
    with tempfile.TemporaryDirectory(prefix="blind-") as name:
        for at, order in todo:
            hidden, declared = recording_of(seed, at, order, campaign, yardstick)
            folder = Path(name) / f"u{at:04d}"
            campaigns.write(campaign, hidden, folder, declare=declared, serial=f"U-{at:04d}")
            row = grade(hidden, order.stratum, campaign, tool.diagnose(folder), declared)
            row["number"] = at
            rows.append(row)
            for file in folder.iterdir():
                file.unlink()
            if store is not None:
                with store.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps(row) + "\n")
            if verbose:
                print(
                    f"{at:4d} {row['truth']} {row['k']} {row['stress']} -> {row['verdict']} {row['named']} {row['noise']}",
                    flush=True,
                )
    tool.close()
    return rows


def run(
    seed: int,
    records: int,
    workers: int,
    folder: Path,
    *,
    per_campaign: int = PER_CAMPAIGN,
    verbose: bool = True,
) -> list[Row]:
    """A whole run; rows that `folder` holds already are not made again."""
    folder.mkdir(parents=True, exist_ok=True)
    store = folder / f"blind-{seed}-{records}.jsonl"
    done: dict[int, Row] = {}
    if store.exists():
        for line in store.read_text(encoding="utf-8").splitlines():
            row = json.loads(line)
            done[row["number"]] = row
    wanted = orders(records, np.random.default_rng([seed, 0]))
    cache = folder / "cache"
    cache.mkdir(exist_ok=True)
    jobs = []
    for number in range(0, len(wanted), per_campaign):
        todo = [
            (k, wanted[k]) for k in range(number, min(number + per_campaign, len(wanted))) if k not in done
        ]
        if todo:
            jobs.append((number // per_campaign, todo))
    with ThreadPoolExecutor(workers) as pool:
        parts = pool.map(lambda job: one_campaign(seed, job[0], job[1], cache, store, verbose), jobs)
        for part in parts:
            done |= {r["number"]: r for r in part}
    return [done[k] for k in sorted(done)]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--records", type=int, default=640)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "blind")
    parser.add_argument("--results", type=Path, default=None)
    arguments = parser.parse_args()
    seed = secrets.randbits(32) if arguments.seed is None else arguments.seed
    print(f"blind run, seed {seed} (continue or repeat with --seed {seed})", flush=True)
    began = time.time()
    rows = run(seed, arguments.records, arguments.workers, arguments.folder)
    report = text(rows)
    print(report)
    if arguments.results is not None:
        head = (
            f"\n### Blind run, seed {seed}, {len(rows)} recordings, {(time.time() - began) / 60:.0f} min\n\n"
        )
        with arguments.results.open("a", encoding="utf-8") as stream:
            stream.write(head + report + "\n")


if __name__ == "__main__":
    main()
