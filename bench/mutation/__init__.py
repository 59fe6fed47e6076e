"""Which small faults of the generator do its tests see?

Faults are drawn by cosmic-ray's operators (another comparison, another arithmetic operation, a number off by one, a
condition turned round, a loop that ends at once, ...) at places drawn with equal chance from all places of a part of
the package. Each is planted in a copy of the sources, where the tests that concern the part run, the quickest first. It
is found if a test fails. Texts are left out, and annotations, which are never executed.
"""

from __future__ import annotations

import queue
import subprocess
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tools.documents import copy_of_sources

from ..campaigns import Settings, say
from ..page import Figure, ResultsTable
from ..records import ROOT, Record

if TYPE_CHECKING:
    from .faults import Fault  # needs cosmic-ray, as only a measurement does

#: Faults that are drawn of each part, and of each with QUICK=1.
FAULTS, QUICK_FAULTS = 300, 20
#: Share of the faults that the tests should find.
AIM = 0.85
_SEED = 1
_PYTEST = (".venv/bin/python", "-m", "pytest", "-x", "-q", "-p", "no:randomly", "-p", "no:cacheprovider")
#: A fault that makes the tests of one pattern run for longer, s, is found; without a fault they take a few minutes.
_LIMIT_S = 1800


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the package, and the tests that concern it.

    Attributes:
        modules: Patterns of its modules, below gen/gyrotc.
        tests: Patterns of test files or folders, below tests; each runs only if those before it found nothing.
    """

    modules: tuple[str, ...]
    tests: tuple[str, ...]


PARTS = {
    "assess": Part(
        ("assess/*.py",),
        ("cases/assess", "journeys/test_figures_read_back.py", "journeys/jobs", "cases/results/test_json_keys.py"),
    ),
    "quality": Part(
        ("quality/*.py",),
        ("cases/quality", "cases/malformed/test_recordings.py", "journeys/quality", "properties/recordings"),
    ),
    "tables": Part(
        ("tables/*.py",),
        ("cases/tables", "cases/mirror", "cases/model", "cases/verify", "journeys/repository/test_examples.py"),
    ),
    "choice": Part(
        ("train/choice.py", "train/candidates.py", "train/folds.py", "train/objection.py"),
        ("cases/train/test_choice.py", "cases/train", "properties/train"),
    ),
    "sigma": Part(
        ("train/uncertainty.py", "mirror/sigma.py"),
        ("cases/train/test_stated_sigma.py", "cases/mirror", "cases/train", "cases/runtime"),
    ),
    "verdict": Part(
        ("diagnose/attribution.py", "diagnose/posterior.py", "diagnose/shipping.py", "diagnose/verdict.py"),
        ("cases/diagnose", "properties/diagnose", "journeys/diagnose"),
    ),
}


def measure(settings: Settings) -> Record:
    """Plant drawn faults in each part, and list those that no test finds.

    Raises:
        SystemExit: a part does not exist, a pattern of one fits no file, or its tests fail without a fault.
    """
    names = list(settings.only or PARTS)
    if unknown := [name for name in names if name not in PARTS]:
        raise SystemExit(f"no part is called {', '.join(unknown)}; there are {', '.join(PARTS)}")
    seed = _SEED if settings.seed is None else settings.seed
    count = QUICK_FAULTS if settings.quick else FAULTS
    paths = {name: _paths(PARTS[name]) for name in names}  # a wrong pattern ends the campaign before its first hour
    return {"seed": seed, "parts": [_tried(name, *paths[name], count, seed, settings.workers) for name in names]}


def table(record: Record) -> ResultsTable:
    """Return the share that is found of each part, and every fault that is not."""
    rows: list[Sequence[object]] = []
    for part in record["parts"]:
        share = Figure(part["found"] / part["faults"], ".0%", at_least=AIM)
        rows.append((part["part"], f"{part['faults']} faults, {part['found']} found", share))
        rows += [("", f"{one['place']}: `{one['before']}` → `{one['after']}`", "") for one in part["missed"]]
    return ResultsTable(__doc__.split("\n\n", 1)[1], ("part", "faults, and those that no test finds", "found "), rows)


def _paths(part: Part) -> tuple[list[Path], list[str]]:
    """Return the modules of a part, and its tests as pytest takes them."""
    modules = [path for pattern in part.modules for path in _there(ROOT / "gen" / "gyrotc", pattern)]
    tests = [str(path.relative_to(ROOT)) for pattern in part.tests for path in _there(ROOT / "tests", pattern)]
    return modules, tests


def _tried(
    name: str, modules: Sequence[Path], tests: Sequence[str], count: int, seed: int, workers: int
) -> dict[str, Any]:
    from .faults import drawn

    faults = drawn(modules, count, np.random.default_rng([seed, *name.encode()]))
    missed: list[Fault] = []
    with tempfile.TemporaryDirectory(prefix="gyrotc-mutation-") as folder, ThreadPoolExecutor(workers) as threads:
        copies: queue.SimpleQueue[Path] = queue.SimpleQueue()
        for number in range(workers):
            copies.put(copy_of_sources(Path(folder, str(number))))

        def finds(fault: Fault | None) -> str:
            copy = copies.get()
            try:
                return _finding(copy, fault, tests)
            finally:
                copies.put(copy)

        if failed := finds(None):
            raise SystemExit(f"{name}: {failed} fails without a fault")
        for number, (fault, found) in enumerate(zip(faults, threads.map(finds, faults), strict=True), start=1):
            say(f"{name} {number} of {len(faults)}: {fault.place} {fault.after}: {found or 'not found'}")
            missed += [] if found else [fault]
    listed = [{"place": one.place, "before": one.before, "after": one.after} for one in missed]
    return {"part": name, "faults": len(faults), "found": len(faults) - len(missed), "missed": listed}


def _there(folder: Path, pattern: str) -> list[Path]:
    found = sorted(folder.glob(pattern))
    if not found:
        raise SystemExit(f"{folder.relative_to(ROOT)}/{pattern} is not there: bench/mutation names it")
    return [path for path in found if path.stem != "__init__"]


def _finding(copy: Path, fault: Fault | None, tests: Sequence[str]) -> str:
    """Return the tests that fail with a fault; empty if none does."""
    from .faults import planted

    with planted(copy, fault):
        for test in tests:
            try:
                done = subprocess.run(
                    [*_PYTEST, test], cwd=copy, check=False, timeout=_LIMIT_S, stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                )  # fmt: skip
            except subprocess.TimeoutExpired:
                return test
            if done.returncode != 0:
                return test
    return ""
