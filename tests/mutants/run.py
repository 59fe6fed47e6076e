"""Faults planted in the generator, one at a time, and who sees them: `make mutants`.

Each fault of `faults.toml` is a line of `gen/gyrotc/` that reads otherwise. With a fault that names a model the changed
generator emits it; the independent check (`tools/check_table.py`) looks at the result, then `gyrotc verify` of the
changed generator itself. With a fault that names tests these run on the changed package.
A fault that nobody sees is a hole in the proof: exit status 1. Unchanged, nobody may object to any of the models, and
all tests pass.
"""

from __future__ import annotations

import argparse
import compileall
import importlib
import json
import os
import py_compile
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

from .page import write_page

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
#: Models that together have all that a table can hold.
MODELS = {
    "plain": "examples/minimal/model.json",
    "uncertain": "examples/nav_loop/filter_model.json",
    "bank": "tests/c/model_bank.json",
    "terms": "tests/c/model_terms.json",
    "waves": "tests/c/model_narrow.json",
}


@dataclass(frozen=True)
class Fault:
    """A line of the generator that reads otherwise."""

    name: str
    file: str  # below gen/gyrotc
    old: str
    new: str
    model: str = ""  # key of MODELS; or ...
    tests: tuple[str, ...] = ()  # ... files or tests of tests/py that should see it
    survives: str = ""  # why nobody can see it


def faults() -> list[Fault]:
    """All of faults.toml, in order."""
    with (HERE / "faults.toml").open("rb") as file:
        entries = tomllib.load(file)["fault"]
    return [Fault(**{**entry, "tests": tuple(entry.get("tests", ()))}) for entry in entries]


class House:
    """A copy of the generator and the runtime in which one file at a time is spoilt."""

    def __init__(self, folder: Path) -> None:
        self.package = folder / "gen" / "gyrotc"
        for name in ("include", "libc"):
            shutil.copytree(ROOT / name, folder / name)
        shutil.copytree(ROOT / "gen" / "gyrotc", self.package, ignore=shutil.ignore_patterns("__pycache__"))
        core = Path(importlib.import_module("gyrotc._core").__file__ or "")
        shutil.copy(core, self.package / core.name)
        # By its content: a file that is changed and put back within a second is read anew.
        compileall.compile_dir(self.package, quiet=1, invalidation_mode=py_compile.PycInvalidationMode.CHECKED_HASH)

    def objection(self, model: str, fault: Fault | None = None, tests: Sequence[str] = ()) -> dict[str, Any]:
        """Who objects to what the generator, with the fault, makes of a model; or which of `tests` fails with it."""
        path = self.package / (fault.file if fault else "__init__.py")
        text = path.read_text("utf-8")
        if fault is not None:
            if text.count(fault.old) != 1:
                raise ValueError(f"{fault.name}: {fault.file} has its text {text.count(fault.old)} times, not once")
            path.write_text(text.replace(fault.old, fault.new), "utf-8")
        try:
            if tests:
                return self._driven(HERE / "drive_tests.py", *tests)
            with tempfile.TemporaryDirectory() as out:
                result = Path(out) / "result"
                return self._driven(HERE / "drive.py", ROOT / MODELS[model], result, ROOT / "tools/check_table.py")
        finally:
            path.write_text(text, "utf-8")

    def _driven(self, *command: str | Path) -> dict[str, Any]:
        environment = os.environ | {"PYTHONPATH": str(self.package.parent), "PYTHONDONTWRITEBYTECODE": "1"}
        done = subprocess.run(
            [sys.executable, *command],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            cwd=self.package.parent,
            timeout=600,
        )
        if done.returncode != 0:
            return {"seen_by": "generator", "reported": done.stderr.strip().splitlines()[-1]}
        found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
        return found


def tried(names: Sequence[str] = ()) -> Iterator[dict[str, Any]]:
    """Every fault (or those named) with who saw it, in order; first the generator as it is.

    Raises:
        ValueError: A fault's text is not there, or somebody objects to the generator as it is.
    """
    chosen = [fault for fault in faults() if not names or fault.name in names]
    with tempfile.TemporaryDirectory() as folder:
        house = House(Path(folder))
        for model, tests in dict.fromkeys((fault.model, fault.tests) for fault in chosen):
            found = house.objection(model, tests=tests)
            if found["seen_by"] is not None:
                what = model or ", ".join(tests)
                raise ValueError(f"{found['seen_by']} objects to the sound generator's {what}: {found['reported']}")
        for fault in chosen:
            yield asdict(fault) | house.objection(fault.model, fault, fault.tests)


def main() -> int:
    """Tries all faults, or those that are named, and writes the page where a folder is given."""
    parser = argparse.ArgumentParser(prog="tests.mutants.run", description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--docs", type=Path, help="folder whose results.md gets the table")
    arguments = parser.parse_args()
    results = []
    for result in tried(arguments.names):
        results.append(result)
        print(f"{result['seen_by'] or 'NOBODY':<12} {result['name']}: {result['reported'][:100]}", flush=True)
    unseen = [result["name"] for result in results if result["seen_by"] is None and not result["survives"]]
    if arguments.docs:
        write_page(arguments.docs, results, [fault.name for fault in faults()])
    print(f"{len(results)} faults, {len(unseen)} that nobody sees{': ' if unseen else ''}{', '.join(unseen)}")
    return 1 if unseen else 0


if __name__ == "__main__":
    sys.exit(main())
