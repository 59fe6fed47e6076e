"""Results of all commands on many recordings, compared with those of another commit.

The other commit is checked out into build/oracle/<commit> and installed there with its own core; both then run the same
sets (`sets.py`). What depends on the machine or on the names of sources is left out (`normalise.py`).
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from ..campaigns import Settings, say
from ..page import Figure, ResultsTable
from ..records import ROOT, Record
from .compare import moved
from .sets import SETS

_PLACE = ROOT / "build" / "oracle"
#: Differences of one file that are shown; all are in build/oracle/differences.txt.
_EACH = 4
_QUICK = ("graded",)


def measure(settings: Settings) -> Record:
    """Run the sets on both sides, and list what differs.

    Raises:
        SystemExit: a set or the commit does not exist.
    """
    names = list(settings.only or (_QUICK if settings.quick else SETS))
    if unknown := [name for name in names if name not in SETS]:
        raise SystemExit(f"no set is called {', '.join(unknown)}; there are {', '.join(SETS)}")
    absent = [name for name in names if SETS[name].measured and not settings.real.is_dir()]
    for name in absent:
        say(f"{name}: left out, {settings.real} is not there")
    names = [name for name in names if name not in absent]
    commit = _git("rev-parse", "--short", "--verify", f"{settings.base}^{{commit}}")
    before = _earlier(commit, names, settings)
    now = _PLACE / "here"
    shutil.rmtree(now, ignore_errors=True)
    _run(Path(sys.executable), now, names, settings)
    return {"base": commit, "sets": names, **_compared(before, now, names)}


def table(record: Record) -> ResultsTable:
    """Return every step that differs, with the first differences of each file."""
    text = f"Commit {record['base']} against this tree: {record['steps']} steps of {len(record['sets'])} sets."
    rows: list[tuple[object, ...]] = [(*row, "") for row in record["moved"]]
    rows.append(("steps that differ", "", "", "", "", Figure(record["differ"], at_most=0)))
    return ResultsTable(text, ("set", "step", "file", "place", "change", "count "), rows)


def _compared(before: Path, now: Path, names: list[str]) -> dict[str, Any]:
    steps, differ, shown = 0, 0, []
    with (_PLACE / "differences.txt").open("w", encoding="utf-8") as every:
        for name in names:
            one, other = (json.loads((folder / f"{name}.json").read_text("utf-8")) for folder in (before, now))
            steps += len(other)
            steps_of_set = set()
            for step, file, found in moved(one, other):
                steps_of_set.add(step)
                every.writelines(f"{name}, {step}: {file}: {place}: {change}\n" for place, change in found)
                shown += [(name, step, file, place, change) for place, change in found[:_EACH]]
                if len(found) > _EACH:
                    shown.append((name, step, file, "", f"and {len(found) - _EACH} more"))
            differ += len(steps_of_set)
    return {"steps": steps, "differ": differ, "moved": shown}


def _earlier(commit: str, names: list[str], settings: Settings) -> Path:
    """Return the folder of the commit's results, which are made for sets that it does not have yet."""
    results = _PLACE / commit / f"results-{_digest_of_sets()}"
    missing = [name for name in names if not (results / f"{name}.json").is_file()]
    if missing:
        _run(_installed(commit), results, missing, settings)
    return results


def _digest_of_sets() -> str:
    """Return a hash of everything that makes the recordings and commands."""
    own = (Path(__file__).with_name(f"{name}.py") for name in ("normalise", "run", "sets", "steps"))
    files = [*own, *sorted((ROOT / "tests" / "support").glob("*.py"))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:8]


def _installed(commit: str) -> Path:
    """Return the Python of an environment with that commit's gyrotc; other packages are those of this Python."""
    tree, environment = _PLACE / commit / "tree", _PLACE / commit / "environment"
    python = environment / "bin" / "python"
    if not (environment / "ready").exists():
        say(f"building gyrotc of {commit}")
        if not tree.is_dir():
            _git("worktree", "prune")
            _git("worktree", "add", "--detach", str(tree), commit)
        subprocess.run([sys.executable, "-m", "venv", environment], check=True)
        install = ["-m", "pip", "install", "-q", "--disable-pip-version-check", "--no-deps", tree / "gen"]
        subprocess.run([python, *install], check=True)
        # A path in a .pth file brings the packages there, but not this tree's gyrotc, which has a .pth file of its own.
        site = next(environment.glob("lib/python*/site-packages"))
        (site / "others.pth").write_text(f"{sysconfig.get_path('purelib')}\n")
        (environment / "ready").touch()
    return python


def _run(python: Path, out: Path, names: list[str], settings: Settings) -> None:
    say(f"{len(names)} sets into {out}")
    command = [python, "-m", "bench.oracle.run", out, *names, "--real", settings.real]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    subprocess.run([*command, "--workers", str(settings.workers)], cwd=ROOT, env=environment, check=True)


def _git(*words: str) -> str:
    done = subprocess.run(["git", "-C", ROOT, *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"git {' '.join(words)}: {done.stderr.strip()}")
    return done.stdout.strip()
