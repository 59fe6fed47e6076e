"""Which small faults of the generator do its tests see?

Faults are drawn by cosmic-ray's operators (another comparison, another arithmetic operation, a number off by one, a
condition turned round, a loop that ends at once, ...) at places drawn with equal chance from all places of a part of
the package. Each is planted in a copy of the sources, where those tests of the part run that execute the place. It is
found if one of them fails. Texts are left out, and annotations, which are never executed.
"""

from __future__ import annotations

import json
import os
import queue
import subprocess
import tempfile
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tools.documents import copy_of_sources

from ..campaigns import Settings, say
from ..page import Figure, ResultsTable
from ..records import ROOT, Record
from .reach import OUTPUT

if TYPE_CHECKING:
    from .faults import Fault  # needs cosmic-ray, as only a measurement does

#: Faults that are drawn of each part, and of each with QUICK=1.
FAULTS, QUICK_FAULTS = 300, 20
#: Share of the faults that the tests should find.
AIM = 0.85
_SEED = 1
_PYTEST = (".venv/bin/python", "-m", "pytest", "-x", "-q", "-p", "no:randomly", "-p", "no:cacheprovider")
#: A fault is found if the tests with it take longer than so many times what they took without it ...
_MAX_SLOWDOWN = 10.0
#: ... and this, s, for the start of pytest and a machine that is busy.
_START_S = 60.0


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the package, and the tests that concern it.

    Attributes:
        modules: Patterns of its modules, below gen/gyrotc.
        tests: Patterns of test files, below tests; those of one run only if those before it found nothing.
    """

    modules: tuple[str, ...]
    tests: tuple[str, ...]


PARTS = {
    "assess": Part(
        ("assess/*.py",),
        (
            "cases/assess/test_decision_borders.py", "cases/assess/*.py", "journeys/test_figures_read_back.py",
            "journeys/jobs/*.py",
            "cases/jobs/*.py", "cases/results/test_json_keys.py",
        ),
    ),
    "quality": Part(
        ("quality/*.py",),
        (
            "cases/quality/test_check.py", "cases/quality/*.py", "cases/malformed/test_recordings.py",
            "cases/train/test_restarts.py", "journeys/quality/*.py", "properties/recordings/*.py",
        ),
    ),
    "tables": Part(
        ("tables/*.py",),
        (
            "cases/tables/*.py", "cases/mirror/*.py", "cases/model/*.py", "cases/verify/*.py",
            "journeys/repository/test_examples.py",
        ),
    ),
    "choice": Part(
        ("train/choice.py", "train/candidates.py", "train/folds.py", "train/objection.py"),
        (
            "cases/train/test_choice.py", "cases/train/test_ladder.py", "cases/train/*.py", "properties/train/*.py",
        ),
    ),
    "sigma": Part(
        ("train/uncertainty.py", "mirror/sigma.py"),
        (
            "cases/train/test_stated_sigma.py", "cases/mirror/test_sigma.py", "cases/train/*.py", "cases/mirror/*.py",
            "cases/runtime/*.py",
        ),
    ),
    "verdict": Part(
        ("diagnose/attribution.py", "diagnose/posterior.py", "diagnose/shipping.py", "diagnose/verdict.py"),
        (
            "cases/diagnose/test_diagnose_odds.py", "cases/diagnose/test_diagnose_attribute.py", "cases/diagnose/*.py",
            "properties/diagnose/*.py", "journeys/diagnose/*.py",
        ),
    ),
}  # fmt: skip


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


def _paths(part: Part) -> tuple[list[Path], list[list[str]]]:
    """Return the modules of a part, and its test files, a list for each pattern; each file once."""
    modules = [path for pattern in part.modules for path in _there(ROOT / "gen" / "gyrotc", pattern)]
    stages: list[list[str]] = []
    for pattern in part.tests:
        files = [str(path.relative_to(ROOT)) for path in _there(ROOT / "tests", pattern)]
        stages.append([file for file in files if not any(file in stage for stage in stages)])
    return modules, stages


def _there(folder: Path, pattern: str) -> list[Path]:
    found = sorted(folder.glob(pattern))
    if not found:
        raise SystemExit(f"{folder.relative_to(ROOT)}/{pattern} is not there: bench/mutation names it")
    return [path for path in found if path.stem != "__init__"]


@dataclass
class _TestsByLine:
    """Tests with the lines that they execute; each test file is followed once, when it is first asked for.

    Attributes:
        copy: The sources without a fault.
    """

    copy: Path
    known: dict[str, dict[str, Any]] = field(default_factory=dict)

    def reaching(self, fault: Fault, files: Sequence[str]) -> dict[str, float]:
        """Return the tests of some files that execute the place of a fault, and their seconds; quick files first.

        A place outside of functions counts as executed by the tests that execute any function of its module.
        """
        found: list[dict[str, float]] = []
        for file in files:
            reach = self._of(file)
            shared = fault.reached_by(reach["fixtures"])
            found.append(
                {
                    name: one["seconds"]
                    for name, one in reach["tests"].items()
                    if shared or fault.reached_by(one["lines"])
                }
            )
        return {
            name: seconds
            for tests in sorted(found, key=lambda one: sum(one.values()))
            for name, seconds in tests.items()
        }

    def _of(self, file: str) -> dict[str, Any]:
        if file not in self.known:
            with tempfile.NamedTemporaryFile() as output:
                environment = os.environ | {OUTPUT: output.name}
                if _pytest(self.copy, ["-p", "bench.mutation.reach", file], None, environment):
                    raise SystemExit(f"{file} fails without a fault")
                self.known[file] = json.load(output)
        return self.known[file]


def _tried(
    name: str, modules: Sequence[Path], stages: Sequence[Sequence[str]], count: int, seed: int, workers: int
) -> dict[str, Any]:
    from .faults import drawn

    faults = drawn(modules, count, np.random.default_rng([seed, *name.encode()]))
    missed: list[Fault] = []
    with tempfile.TemporaryDirectory(prefix="gyrotc-mutation-") as folder, ThreadPoolExecutor(workers) as threads:
        by_line, lock = _TestsByLine(copy_of_sources(Path(folder, "whole"))), threading.Lock()
        copies: queue.SimpleQueue[Path] = queue.SimpleQueue()
        for number in range(workers):
            copies.put(copy_of_sources(Path(folder, str(number))))

        def finds(fault: Fault) -> tuple[str, float]:
            copy = copies.get()
            spent = 0.0
            try:
                for files in stages:
                    with lock:
                        tests = by_line.reaching(fault, files)
                    begun = time.monotonic()
                    failed = _finding(copy, fault, tests)
                    spent += time.monotonic() - begun
                    if failed:
                        return failed, spent
                return "", spent
            finally:
                copies.put(copy)

        seconds = 0.0
        for number, (fault, (found, spent)) in enumerate(zip(faults, threads.map(finds, faults), strict=True), start=1):
            say(f"{name} {number} of {len(faults)}, {spent:.0f} s: {fault.place} {fault.after}: {found or 'not found'}")
            missed += [] if found else [fault]
            seconds += spent
    listed = [{"place": one.place, "before": one.before, "after": one.after} for one in missed]
    return {
        "part": name, "faults": len(faults), "found": len(faults) - len(missed), "seconds_each": seconds / len(faults),
        "missed": listed,
    }  # fmt: skip


def _finding(copy: Path, fault: Fault, tests: dict[str, float]) -> str:
    """Return the test that fails with a fault; empty if none does."""
    from .faults import planted

    if not tests:
        return ""
    with planted(copy, fault):
        try:
            return _pytest(copy, list(tests), _MAX_SLOWDOWN * sum(tests.values()) + _START_S)
        except subprocess.TimeoutExpired:
            return "it never ends"


def _pytest(copy: Path, words: Sequence[str], limit_s: float | None, environment: dict[str, str] | None = None) -> str:
    """Run tests in a copy of the sources until one fails; return the line that names it, empty if none does."""
    done = subprocess.run(
        [*_PYTEST, *words], cwd=copy, check=False, timeout=limit_s, stdin=subprocess.DEVNULL, capture_output=True,
        text=True, errors="replace", env=environment,
    )  # fmt: skip
    named = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return "" if done.returncode == 0 else next(iter(named), f"pytest ends with {done.returncode}")[:200]
