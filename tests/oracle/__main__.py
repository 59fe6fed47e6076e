"""`python -m tests.oracle`: are all results the same as before? Exit status 1 where one differs."""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from .compare import Reference, differences
from .sets import SETS, run_set

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = Path(__file__).resolve().parent / "reference.json"
#: On the path of programs alone, so that results do not depend on what is installed: of the targets those of gcc on
#: this machine are verified, all others are "missing", and no browser prints a certificate.
PROGRAMS = ("gcc", "as", "ld", "nm", "size", "sh")
_EACH = 3  # differences shown of a file

Parts = Mapping[str, Mapping[str, Any]]  # of each step, by name


def main() -> int:
    """Runs all sets, or those named, and compares them with the reference or with another run."""
    asked = _arguments()
    reference = Reference(REFERENCE)
    absent = [name for name in asked.sets if SETS[name].measured and not asked.real.is_dir()]
    asked.out.mkdir(parents=True, exist_ok=True)
    steps, wrong = 0, 0
    for name, outcomes in _outcomes([n for n in asked.sets if n not in absent], asked):
        (asked.out / f"{name}.json").write_text(json.dumps(outcomes, indent=1) + "\n", "utf-8")
        steps += len(outcomes)
        if asked.write:
            reference.enter(name, outcomes)
        elif asked.against:
            earlier = json.loads((asked.against / f"{name}.json").read_text("utf-8"))
            wrong += _compared(name, earlier, outcomes, differences)
        else:
            wrong += _compared(name, reference.steps(name), outcomes, reference.differences)
    for name in absent:
        print(f"--  {name}: not run, {asked.real} is not there")
    if asked.write:
        reference.write(_made_with())
    elif wrong and not asked.against and reference.made_with != _made_with():
        print(f"The reference was made with {reference.made_with},\nthis run with {_made_with()}: see CONTRIBUTING.md.")
    print(f"{steps} steps, {wrong} differ; what they gave in full: {asked.out}")
    return 1 if wrong else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.oracle", description=__doc__)
    parser.add_argument("sets", nargs="*", default=list(SETS), metavar="SET", help=", ".join(SETS))
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "oracle", help="folder for full outcomes")
    parser.add_argument("--against", type=Path, help="--out of another run, instead of the tracked reference")
    parser.add_argument("--real", type=Path, default=ROOT.parent / "shared" / "data" / "real", help="measured sets")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--write", action="store_true", help="make the reference from this checkout")
    asked = parser.parse_args()
    unknown = [name for name in asked.sets if name not in SETS]
    if unknown:
        parser.error(f"no set is called {', '.join(unknown)}")
    if asked.against and not asked.against.is_dir():
        parser.error(f"{asked.against} is no folder")
    return asked


def _outcomes(names: Sequence[str], asked: argparse.Namespace) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each set with its outcomes, as they are done."""
    with tempfile.TemporaryDirectory(prefix="gyrotc-oracle-") as scratch:
        os.environ |= _environment(Path(scratch))
        with ProcessPoolExecutor(asked.workers, mp_context=get_context("spawn")) as pool:
            done = {pool.submit(run_set, n, Path(scratch) / n, asked.real.absolute()): n for n in names}
            for future in as_completed(done):
                yield done[future], future.result()


def _environment(scratch: Path) -> dict[str, str]:
    """What the user's environment must not decide; gyrotc reads it when it is imported."""
    (scratch / "bin").mkdir()
    for program in PROGRAMS:
        if place := shutil.which(program):
            (scratch / "bin" / program).symlink_to(place)
    fixed = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return fixed | {
        "PATH": str(scratch / "bin"),
        "XDG_CACHE_HOME": str(scratch / "cache"),  # what was kept of earlier diagnoses would hide a change
        "XDG_STATE_HOME": str(scratch / "state"),  # reports of internal faults
        "COLUMNS": "200",
        "NO_COLOR": "1",
        "PYTHONWARNINGS": "ignore",
    }


def _compared(name: str, earlier: Parts, found: Parts, differ: Callable[[Any, Any], Iterable[str]]) -> int:
    """Prints how the steps of a set compare; returns how many differ."""
    wrong = 0
    for step in dict.fromkeys([*earlier, *found]):
        lines = []
        one, other = earlier.get(step, {}), found.get(step, {})
        for part in dict.fromkeys([*one, *other]):
            if part not in one or part not in other:
                lines.append(f"{part}: only in {'the reference' if part in one else 'this run'}")
                continue
            reported = list(differ(one[part], other[part]))
            lines += [f"{part}  {line}" for line in reported[:_EACH]]
            lines += [f"{part}  and {len(reported) - _EACH} more"] * (len(reported) > _EACH)
        if lines:
            wrong += 1
            print(f"DIFFERS  {name}/{step}", *lines, sep="\n    ")
    print(f"ok  {name}: {len(found) - wrong} of {len(found)} steps", flush=True)
    return wrong


def _made_with() -> dict[str, str]:
    libraries = {name: version(name) for name in ("numpy", "scipy", "pyarrow", "pydantic", "rich", "typer")}
    return {"python": platform.python_version(), "machine": platform.machine()} | libraries


if __name__ == "__main__":
    sys.exit(main())
