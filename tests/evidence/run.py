"""What is found of drawn sets: copies of runs, and faults of timing, holding and pairing; and what of clean ones.

`python -m tests.evidence.run --clean 500 --copies 200 --faults 200 --seed 1` (`make evidence`) prints a table. A set is
made again by its seed and number.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from gyrotc.common.errors import CheckFailed, InputError
from gyrotc.jobs.build import build_into
from gyrotc.recordings.load import load
from gyrotc.train.fitting import FitOptions

from .sets import EXPORTS, FAULTS, drawn_set, exported_again, faulty, written

ABOUT = frozenset(
    {
        "shared_rows", "rate_held", "temperature_late", "residual_above_noise", "residual_below_noise",
        "runs_contradict", "run_outlier", "sign_reversed",
    }
)  # fmt: skip
"""Findings that say that recordings are no evidence of their own, or do not belong together."""
KINDS = {"clean": ("clean",), "copies": EXPORTS, "faults": FAULTS}


def found(kind: str, way: str, seed: int, number: int) -> set[str]:
    """Ids of findings (or `refused`) of a drawn set; a copy is an exam in half of the cases."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind), number])
    gyro, runs = drawn_set(rng)
    if kind == "copies":
        place = 4 if number % 2 else 3  # the exam, or a training run
        runs[place] = exported_again(runs[int(rng.integers(3))], way, gyro, rng)
    elif kind == "faults":
        runs = faulty(runs, way, rng)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        out = Path(folder, "out")
        out.mkdir()
        try:
            dataset = load(written(Path(folder, "data"), runs))
            if kind == "copies":
                return {"shared_rows"} if dataset.shared else set()
            built = build_into(out, dataset, FitOptions(method="cubic"), compiled=False)
        except CheckFailed as error:
            return {str(error)}
        except InputError as error:
            return {"refused"} if "rows of an exam that" in str(error) else {str(error)}
        return {finding.id for finding in built.evaluation.findings}


def _one(task: tuple[str, str, int, int]) -> tuple[str, str, int, set[str]]:
    kind, way, seed, number = task
    return kind, way, number, found(kind, way, seed, number)


def tasks(counts: dict[str, int], seed: int) -> list[tuple[str, str, int, int]]:
    """All sets: each way as often as the others."""
    return [(k, KINDS[k][n % len(KINDS[k])], seed, n) for k, count in counts.items() for n in range(count)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for kind, count in (("clean", 500), ("copies", 200), ("faults", 200)):
        parser.add_argument(f"--{kind}", type=int, default=count)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    every = tasks({kind: getattr(given, kind) for kind in KINDS}, given.seed)
    drawn: Counter[tuple[str, str]] = Counter()
    named: Counter[tuple[str, str]] = Counter()
    with ProcessPoolExecutor(given.workers) as pool:
        for kind, way, number, ids in pool.map(_one, every):
            drawn[kind, way] += 1
            named[kind, way] += bool(ids & (ABOUT | {"refused"}))
            if bool(ids & (ABOUT | {"refused"})) == (kind == "clean"):
                print(f"  {kind} {way}, set {number}: {', '.join(sorted(ids)) or 'nothing'}", flush=True)
    print("| sets | drawn | named |\n| --- | ---: | ---: |")
    for kind, way in drawn:
        print(f"| {kind}{f', {way}' if way != kind else ''} | {drawn[kind, way]} | {named[kind, way]} |")
    totals = {
        k: sum(n for (kind, _), n in named.items() if kind == k) / max(getattr(given, k), 1) for k in KINDS
    }
    print(f"false {totals['clean']:.1%}, copies {totals['copies']:.1%}, faults {totals['faults']:.1%}")
    good = totals["clean"] <= 0.01 and all(
        totals[k] >= 0.95 for k in ("copies", "faults") if getattr(given, k)
    )
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
