"""Fresh seeds of both blind worlds: recordings with hidden effects, diagnosed by a process that does not know them.

    python -m tests.blind [--seed "N M"] [--records 200] [--docs docs]

Two seeds come from the operating system and are printed. The same seeds make the same recordings again, and a run that
was stopped goes on with them. `--world own --seed N --only 17` writes one recording with its truth. With `--docs` the
rows of all recordings and the tables made of them are kept.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import secrets
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from .both import WORLDS, kept, tables, write_both
from .grade import Row
from .other import run as other
from .run import PER_CAMPAIGN, Plan, run, written
from .table import ended, markdown

ROOT = Path(__file__).resolve().parents[2]
CODE = ROOT / "gen" / "gyrotc"
_FOLDERS = {"own": "blind", "other": "blind-other"}  # of build/


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


def head_of(folder: Path, seed: int, records: int) -> dict[str, Any]:
    """What a run began with; a run that goes on keeps it."""
    path = folder / f"{seed}-{records}.head.json"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        started = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
        head = {"seed": seed, "records": records, "code": code_version(), "commit": commit(), "started": started}
        path.write_text(json.dumps(head), encoding="utf-8")
    return dict(json.loads(path.read_text(encoding="utf-8")))


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--records", type=int, default=200, help="of each world and seed")
    parser.add_argument("--seed", type=lambda text: [int(word) for word in text.split()], default=None)
    parser.add_argument("--world", choices=WORLDS, default=None, help="this one alone, and no table of both")
    parser.add_argument("--only", type=int, default=None, help="write this recording of --world and --seed and stop")
    parser.add_argument("--per-campaign", type=int, default=PER_CAMPAIGN)
    parser.add_argument("--weakest", type=float, default=0.5, help="own world: smallest k of a cause hidden alone")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=ROOT / "build")
    parser.add_argument("--docs", type=Path, default=None)
    given = parser.parse_args()
    if given.docs is not None and given.world is not None:
        parser.error("--docs keeps the recordings of both worlds: leave --world out")
    seeds = given.seed or [secrets.randbits(32) for _ in range(2)]
    worlds = [given.world] if given.world else list(WORLDS)

    def plan(seed: int) -> Plan:
        return Plan(seed, given.records, given.per_campaign, given.weakest)

    if given.only is not None:
        for world in worlds:
            target = given.folder / _FOLDERS[world] / f"{seeds[0]}-{given.only:04d}"
            truth = (
                written(plan(seeds[0]), given.only, target)
                if world == "own"
                else other.written(seeds[0], given.records, given.only, target)
            )
            print(f"{target}: {truth}")
        return
    print(f"blind run, seeds {' '.join(map(str, seeds))} (go on or repeat with --seed)", flush=True)

    def one(task: tuple[int, str]) -> list[Row]:
        seed, world = task
        folder = given.folder / _FOLDERS[world]
        head_of(folder, seed, given.records)
        return run(plan(seed), folder) if world == "own" else other.run(seed, given.records, folder)

    tasks = [(seed, world) for seed in seeds for world in worlds]
    with ThreadPoolExecutor(given.workers) as pool:
        found = list(pool.map(one, tasks))
    rows = [(world, seed, row) for (seed, world), of in zip(tasks, found, strict=True) for row in of]
    if given.docs is not None:
        head = head_of(given.folder / _FOLDERS["own"], seeds[0], given.records)
        write_both(given.docs, {"seeds": seeds, **{name: head[name] for name in ("commit", "code")}}, rows)
    short = [kept(*row) for row in rows]
    missed = 0
    for world in worlds:
        entries = tables(short)[world]["all"]
        print(f"\n{WORLDS[world][0]}\n\n{markdown(entries)}")
        missed |= ended(entries)
    sys.exit(missed)


if __name__ == "__main__":
    main()
