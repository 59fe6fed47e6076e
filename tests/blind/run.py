"""Blind runs: recordings are drawn, diagnosed by a process that does not know the truth, and graded.

    python -m tests.blind.run [--records 640] [--seed N] [--workers 1] [--docs docs]

The seed comes from the operating system and is printed. The same seed makes the same recordings again
(`--seed N`, and `--only 17` for one of them), so a printed seed is enough to replay what was seen. A run that
was stopped goes on with its seed; without one, the newest unfinished run of the same code goes on. With
`--docs` the table of what is done stands in docs/results.md after every campaign.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import secrets
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from . import campaign as campaigns
from .draw import Order, campaign_of, orders, recording_of
from .grade import Row, grade
from .page import write_page
from .table import ended, table, text

PER_CAMPAIGN = 32
ROOT = Path(__file__).resolve().parents[2]
CODE = ROOT / "gen" / "gyrotc"

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


def run(
    plan: Plan, folder: Path, *, workers: int = 1, after: Callable[[list[Row]], None] = lambda _: None
) -> list[Row]:
    """A whole run; rows that `folder` holds already are not made again.

    Args:
        plan: What to make.
        folder: Where rows and cached banks are kept.
        workers: Processes side by side.
        after: Called after every campaign with the rows so far.
    """
    path = folder / f"{plan.seed}-{plan.records}.jsonl"
    done = {row["number"]: row for row in rows_of(path)}
    cache = folder / "cache"
    cache.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as stream:

        def store(row: Row) -> None:
            stream.write(json.dumps(row) + "\n")
            stream.flush()
            print(_line(row), flush=True)

        jobs = plan.jobs(set(done))

        def several(first: int) -> None:
            with Tool(cache) as tool:
                for number, todo in jobs[first::workers]:
                    rows = one_campaign(plan, number, todo, tool, store)
                    done.update({r["number"]: r for r in rows})
                    after([done[k] for k in sorted(done)])

        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(several, range(workers)))
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


def code_version() -> str:
    """Hash of the package's Python sources."""
    digest = hashlib.sha256()
    for path in sorted(CODE.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def commit() -> str:
    found = subprocess.run(
        ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False
    )
    return found.stdout.strip() or "unknown"


def _begin(arguments: argparse.Namespace) -> tuple[Plan, dict[str, Any]]:
    """A new run, or the one to go on with, and its head."""
    folder: Path = arguments.folder
    folder.mkdir(parents=True, exist_ok=True)
    version = code_version()
    heads = [json.loads(p.read_text(encoding="utf-8")) for p in sorted(folder.glob("*.head.json"))]
    for head in sorted(heads, key=lambda h: str(h["started"]), reverse=True):
        plan = Plan(head["seed"], head["records"], arguments.per_campaign, arguments.weakest)
        same = head["code"] == version and head["records"] == arguments.records
        left = plan.jobs({r["number"] for r in rows_of(folder / f"{plan.seed}-{plan.records}.jsonl")})
        if head["seed"] == arguments.seed or (arguments.seed is None and same and left):
            return plan, head
    seed = secrets.randbits(32) if arguments.seed is None else arguments.seed
    head = {
        "seed": seed,
        "records": arguments.records,
        "code": version,
        "commit": commit(),
        "started": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
    }
    (folder / f"{seed}-{arguments.records}.head.json").write_text(json.dumps(head), encoding="utf-8")
    return Plan(seed, arguments.records, arguments.per_campaign, arguments.weakest), head


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--records", type=int, default=640)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--only", type=int, default=None, help="write this recording of --seed and stop")
    parser.add_argument("--per-campaign", type=int, default=PER_CAMPAIGN)
    parser.add_argument("--weakest", type=float, default=0.5, help="smallest k of a cause hidden alone")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "blind")
    parser.add_argument("--docs", type=Path, default=None)
    arguments = parser.parse_args()
    if arguments.only is not None:
        plan = Plan(arguments.seed, arguments.records, arguments.per_campaign, arguments.weakest)
        print(_replay(plan, arguments.only, arguments.folder))
        return
    plan, head = _begin(arguments)
    print(f"blind run, seed {plan.seed} (go on or repeat with --seed {plan.seed})", flush=True)

    def after(rows: list[Row]) -> None:
        if arguments.docs is not None:
            write_page(arguments.docs, head, rows)

    rows = run(plan, arguments.folder, workers=arguments.workers, after=after)
    after(rows)
    print(text(rows))
    sys.exit(ended(table(rows)))


def _replay(plan: Plan, number: int, folder: Path) -> str:
    """Writes one recording of a run and says what is hidden in it."""
    order = plan.orders()[number]
    campaign, yardstick = campaign_of(plan.seed, number // plan.per_campaign)
    hidden, declared = recording_of(plan.seed, number, order, campaign, yardstick)
    target = folder / f"{plan.seed}-{number:04d}"
    campaigns.write(campaign, hidden, target, declare=declared, serial=f"U-{number:04d}")
    truth = list(zip(hidden.names, hidden.k, hidden.parameters, strict=True))
    return f"{target}: {order.stratum} {truth} {hidden.stress}"


if __name__ == "__main__":
    main()
