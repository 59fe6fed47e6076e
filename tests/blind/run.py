"""A blind run of the own world: recordings are drawn, diagnosed by a process that does not know the truth, and graded.

The same seed makes the same recordings again, so that a printed seed is enough to replay what was seen.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from . import campaign as campaigns
from .draw import Order, campaign_of, orders, recording_of
from .grade import Row, grade

PER_CAMPAIGN = 32

Store = Callable[[Row], None]


@dataclass(frozen=True)
class Plan:
    """A run: everything follows from its seed and its size.

    Attributes:
        seed: Of everything that is drawn.
        records: How many recordings.
        per_campaign: How many of them share their temperature records.
        weakest: Smallest k of a cause that is hidden alone.
    """

    seed: int
    records: int
    per_campaign: int = PER_CAMPAIGN
    weakest: float = 0.5

    def orders(self) -> list[Order]:
        """What to hide in every recording."""
        return orders(self.records, np.random.default_rng([self.seed, 0]), self.weakest)

    def jobs(self, done: set[int]) -> list[tuple[int, list[tuple[int, Order]]]]:
        """Campaigns with the recordings that are still to be made."""
        wanted = self.orders()
        out = []
        for first in range(0, len(wanted), self.per_campaign):
            numbers = range(first, min(first + self.per_campaign, len(wanted)))
            todo = [(k, wanted[k]) for k in numbers if k not in done]
            if todo:
                out.append((first // self.per_campaign, todo))
        return out


class Tool:
    """The process under test. It gets no environment but where to keep its cache."""

    def __init__(self, cache: Path) -> None:
        environment = {
            "PATH": os.environ.get("PATH", ""),
            "HOME": str(cache),
            "XDG_CACHE_HOME": str(cache),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("tool.py"))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
            cwd=cache,
        )

    def __enter__(self) -> Tool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()

    def diagnose(self, folder: Path) -> dict[str, Any]:
        """The result for one folder of recordings."""
        assert self.process.stdin is not None and self.process.stdout is not None
        answer = folder.with_suffix(".json")
        self.process.stdin.write(f"{folder}\t{answer}\n")
        self.process.stdin.flush()
        if not self.process.stdout.readline():
            raise RuntimeError("the tool died")
        return dict(json.loads(answer.read_text(encoding="utf-8")))


def one_campaign(plan: Plan, number: int, todo: list[tuple[int, Order]], tool: Tool, store: Store) -> list[Row]:
    """Recordings of one campaign, one after the other."""
    campaign, yardstick = campaign_of(plan.seed, number)
    rows = []
    with tempfile.TemporaryDirectory(prefix="blind-") as name:
        for at, order in todo:
            hidden, declared = recording_of(plan.seed, at, order, campaign, yardstick)
            folder = Path(name) / f"u{at:04d}"
            campaigns.write(campaign, hidden, folder, declare=declared, serial=f"U-{at:04d}")
            row = grade(hidden, order.stratum, campaign, tool.diagnose(folder), declared)
            row["number"] = at
            rows.append(row)
            store(row)
            for file in folder.iterdir():
                file.unlink()
    return rows


def run(plan: Plan, folder: Path) -> list[Row]:
    """A whole run; rows that `folder` holds already are not made again.

    Args:
        plan: What to make.
        folder: Where rows are kept.
    """
    path = folder / f"{plan.seed}-{plan.records}.jsonl"
    done = {row["number"]: row for row in rows_of(path)}
    cache = folder / "cache"
    cache.mkdir(parents=True, exist_ok=True)
    with Tool(cache) as tool, path.open("a", encoding="utf-8") as stream:

        def store(row: Row) -> None:
            stream.write(json.dumps(row) + "\n")
            stream.flush()
            print(_line(row), flush=True)

        for number, todo in plan.jobs(set(done)):
            done.update({r["number"]: r for r in one_campaign(plan, number, todo, tool, store)})
    return [done[k] for k in sorted(done)]


def rows_of(path: Path) -> list[Row]:
    """Rows kept so far; a half-written last line is left out."""
    if not path.exists():
        return []
    rows = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return rows


def _line(row: Row) -> str:
    hidden = ", ".join(f"{n} {k:.2f}" for n, k in zip(row["truth"], row["k"], strict=True)) or "nothing"
    found = ", ".join([*row["named"], *row["noise"]]) or "-"
    return f"{row['number']:4d} {row['design']:10s} {hidden} {row['stress']} -> {row['verdict']}: {found}"


def written(plan: Plan, number: int, target: Path) -> str:
    """Writes one recording of a run and says what is hidden in it."""
    order = plan.orders()[number]
    campaign, yardstick = campaign_of(plan.seed, number // plan.per_campaign)
    hidden, declared = recording_of(plan.seed, number, order, campaign, yardstick)
    campaigns.write(campaign, hidden, target, declare=declared, serial=f"U-{number:04d}")
    truth = list(zip(hidden.names, hidden.k, hidden.parameters, strict=True))
    return f"{order.stratum} {truth} {hidden.stress}"
