"""What is found of drawn sets: faults of timing, holding and pairing, and clean ones.

`python -m tests.evidence.run --clean 500 --faults 200 --seed 1 --docs docs` (`make evidence`)
prints a table and keeps it as a record. A set is made again by its seed and number.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.common.errors import CheckFailed, InputError
from gyrotc.jobs.build import build_into
from gyrotc.recordings.load import load
from gyrotc.train.fitting import FitOptions

from ..events import table, write_record
from .sets import FAULTS, drawn_set, faulty, written

ABOUT = frozenset(
    {
        "shared_rows", "rate_held", "temperature_late", "residual_above_noise", "residual_below_noise",
        "runs_contradict", "run_outlier", "sign_reversed",
    }
)  # fmt: skip
"""Findings that say that recordings are no evidence of their own, or do not belong together."""
KINDS = {"clean": ("clean",), "faults": FAULTS}


def found(kind: str, way: str, seed: int, number: int) -> set[str]:
    """Ids of findings of a drawn set."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind), number])
    _, runs = drawn_set(rng)
    if kind == "faults":
        runs = faulty(runs, way, rng)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        out = Path(folder, "out")
        out.mkdir()
        try:
            dataset = load(written(Path(folder, "data"), runs))
            built = build_into(out, dataset, FitOptions(method="cubic"), compiled=False)
        except (CheckFailed, InputError) as error:
            return {str(error)}
        return {finding.id for finding in built.evaluation.findings}


def _one(task: tuple[str, str, int, int]) -> tuple[str, str, int, set[str]]:
    kind, way, seed, number = task
    return kind, way, number, found(kind, way, seed, number)


def tasks(counts: dict[str, int], seed: int) -> list[tuple[str, str, int, int]]:
    """All sets: each way as often as the others."""
    return [(k, KINDS[k][n % len(KINDS[k])], seed, n) for k, count in counts.items() for n in range(count)]


def section(record: dict[str, Any]) -> str:
    rows = [
        (f"{r['kind']}{', ' + r['way'] if r['way'] != r['kind'] else ''}", r["drawn"], r["named"])
        for r in record["rows"]
    ]
    return f"## Evidence that is its own\n\nSeed {record['seed']}.\n\n{table(('sets', 'drawn ', 'named '), rows)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for kind, count in (("clean", 500), ("faults", 200)):
        parser.add_argument(f"--{kind}", type=int, default=count)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--docs", type=Path, help="the folder docs, whose record is written")
    given = parser.parse_args()
    every = tasks({kind: getattr(given, kind) for kind in KINDS}, given.seed)
    drawn: Counter[tuple[str, str]] = Counter()
    named: Counter[tuple[str, str]] = Counter()
    with ProcessPoolExecutor(given.workers) as pool:
        for kind, way, number, ids in pool.map(_one, every):
            drawn[kind, way] += 1
            named[kind, way] += bool(ids & ABOUT)
            if bool(ids & ABOUT) == (kind == "clean"):
                print(f"  {kind} {way}, set {number}: {', '.join(sorted(ids)) or 'nothing'}", flush=True)
    rows = [{"kind": k, "way": way, "drawn": n, "named": named[k, way]} for (k, way), n in drawn.items()]
    record = {"seed": given.seed, "rows": rows}
    print(section(record))
    if given.docs:
        write_record(given.docs, "evidence", record, section)
    totals = {k: sum(n for (kind, _), n in named.items() if kind == k) / max(getattr(given, k), 1) for k in KINDS}
    print(", ".join(f"{'false' if k == 'clean' else k} {share:.1%}" for k, share in totals.items()))
    good = totals["clean"] <= 0.01 and all(totals[k] >= 0.95 for k in KINDS if k != "clean" and getattr(given, k))
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
