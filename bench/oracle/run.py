"""`python -m bench.oracle.run OUT [SET ...]`: run sets with the gyrotc of this Python, and keep what each step gave."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import tempfile
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from .sets import SETS, run_set

#: On the path of programs alone, so that results do not depend on what is installed: of the targets those of gcc on
#: this machine are verified, all others are "missing", and no browser prints a certificate.
PROGRAMS = ("gcc", "as", "ld", "nm", "size", "sh")


def main() -> None:
    """Write OUT/<set>.json for each set."""
    parser = argparse.ArgumentParser(prog="python -m bench.oracle.run", description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("sets", nargs="*", default=list(SETS))
    parser.add_argument("--real", type=Path, required=True, help="folder of measured recordings")
    parser.add_argument("--workers", type=int, default=2)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="gyrotc-oracle-") as scratch:
        os.environ |= _environment(Path(scratch))
        with ProcessPoolExecutor(asked.workers, mp_context=get_context("spawn")) as pool:
            done = {pool.submit(run_set, n, Path(scratch) / n, asked.real): n for n in asked.sets}
            for future in as_completed(done):
                name, outcomes = done[future], future.result()
                (asked.out / f"{name}.json").write_text(json.dumps(outcomes, indent=1) + "\n", "utf-8")
                print(f"{name}: {len(outcomes)} steps", flush=True)


def _environment(scratch: Path) -> dict[str, str]:
    """Return what the user's environment must not decide; gyrotc reads it when it is imported."""
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


if __name__ == "__main__":
    main()
