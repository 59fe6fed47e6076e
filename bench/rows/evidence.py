"""Sets with a run that is no evidence of its own: a copy, or a fault of timing, holding, pairing or order."""

from __future__ import annotations

import tempfile
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.common import CheckFailed, InputError
from gyrotc.recordings import load
from gyrotc.train import FitOptions
from jobs import built_for_fleet

from ..campaigns import say
from .sets import FAULTS, drawn_set, faulty, written

#: Findings that say that recordings are no evidence of their own, or do not belong together.
ABOUT = frozenset(
    {
        "shared_rows", "rate_held", "temperature_late", "residual_above_noise", "residual_below_noise",
        "runs_contradict", "run_outlier", "sign_reversed", "refused",
    }
)  # fmt: skip
KINDS = ("clean", *FAULTS)


def found(kind: str, seed: int, number: int) -> set[str]:
    """Return the ids of findings of a drawn set; "refused" if it is not read."""
    rng = np.random.default_rng([seed, KINDS.index(kind), number])
    runs = drawn_set(rng)
    if kind != "clean":
        runs = faulty(runs, kind, rng)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        out = Path(folder, "out")
        try:
            dataset = load(written(Path(folder, "data"), runs))
            built = built_for_fleet(out, dataset, FitOptions(method="cubic"))
        except CheckFailed as error:
            return {str(error)}
        except InputError:
            return {"refused"}
        return {finding.id for finding in built.evaluation.findings}


def _one(task: tuple[str, int, int]) -> set[str]:
    return found(*task)


def evidence(seed: int, clean: int, each: int, workers: int) -> list[dict[str, Any]]:
    """Return how many sets of each kind are named, or, of the clean ones, accused."""
    rows = []
    with ProcessPoolExecutor(workers) as pool:
        for kind in KINDS:
            tasks = [(kind, seed, number) for number in range(clean if kind == "clean" else each)]
            ids = list(pool.map(_one, tasks))
            rows.append({"kind": kind, "sets": len(ids), "named": sum(bool(of & ABOUT) for of in ids)})
            say(str(rows[-1]))
    return rows
