"""Branch coverage of libc/ by the C tests: every branch of every build must be taken both ways.

Compiles the runtime and each test with gcov's counters, once for each arithmetic and each set of options,
runs them, and adds up. Prints what was not reached; exit status 1 if there is anything.
"""

from __future__ import annotations

import argparse
import gzip
import json
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FLAGS = [
    "-std=c99",
    "-O0",
    "-ffp-contract=off",
    "--coverage",
    f"-I{ROOT / 'include'}",
    f"-I{ROOT / 'tests/c'}",
]
BUILDS = {
    "f32": ([], ["-DGTC_WITH_BANK=1", "-DGTC_OPEN_TERMS=1"]),
    "q31": (
        [],
        ["-DGTC_WITH_BANK=1", "-DGTC_OPEN_TERMS=1"],
        ["-DGTC_HALF_MULTIPLY=1", "-DGTC_WITH_BANK=1"],
        ["-DGTC_UNROLL=0"],
    ),
}

WRONG = {"f32": ("0x3ED6B6D8UL", "0x3ED6B6D9UL"), "q31": ("0x7FFFFFFEUL", "0x7FFFFFFFUL")}

Branch = tuple[str, int, int, int]  # source, line, number of the branch's decision on it, way


def build_and_run(folder: Path, numeric: str, options: list[str], *, broken: bool = False) -> None:
    """Compiles and runs every test of one arithmetic with one set of options.

    `broken`: only the negative control, with a copy of the runtime whose primitives expect something else.
    """
    libc = ROOT / "libc"
    if broken:
        libc = Path(shutil.copytree(libc, folder / "libc"))
        vectors = libc / f"gtc_selftest_{numeric}.h"
        text = vectors.read_text(encoding="ascii")
        vectors.write_text(text.replace(*WRONG[numeric]), encoding="ascii")
    objects = []
    for source in sorted(libc.glob("*.c")):
        objects.append(folder / f"{source.stem}.o")
        subprocess.run(["gcc", *FLAGS, *options, "-c", source, "-o", objects[-1]], check=True)
    tables = sorted((ROOT / "tests/c/table").glob("*.c"))
    include = f"-I{ROOT / 'tests/c/table'}"
    for test in sorted((ROOT / "tests/c").glob("test_*.c")):
        if (test.stem == "test_broken") != broken:
            continue
        program = folder / test.stem
        command = ["gcc", *FLAGS, *options, include, f"-DTEST_Q31={int(numeric == 'q31')}"]
        subprocess.run([*command, test, *tables, *objects, "-o", program], check=True, cwd=folder)
        subprocess.run([program], check=True, cwd=folder, stdout=subprocess.DEVNULL)


def branches(folder: Path, numeric: str) -> dict[Branch, int]:
    """How often each branch of one arithmetic was taken, from the counters in a folder."""
    counts: dict[Branch, int] = defaultdict(int)
    data = [str(p) for p in folder.glob("gtc_*.gcda") if p.name.startswith(("gtc_crc", f"gtc_{numeric}"))]
    subprocess.run(["gcov", "--json-format", "--branch-probabilities", *data], check=True, cwd=folder,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
    for report in folder.glob("*.gcov.json.gz"):
        for file in json.loads(gzip.decompress(report.read_bytes()))["files"]:
            source = Path(file["file"])
            if source.parent.name != "libc":
                continue
            for line in file["lines"]:
                for k, branch in enumerate(line["branches"]):
                    counts[source.name, line["line_number"], k // 2, k % 2] += branch["count"]
                counts[source.name, line["line_number"], -1, 0] += line["count"]
    return counts


def main() -> int:
    """Prints the figures of both arithmetics; 1 if a line or a branch was not reached."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures here")
    arguments = parser.parse_args()
    figures = {}
    missing = 0
    for numeric, option_sets in BUILDS.items():
        total: dict[Branch, int] = defaultdict(int)
        for options, broken in [*((o, False) for o in option_sets), ([], True)]:
            with tempfile.TemporaryDirectory(prefix="gyrotc-cov-") as name:
                build_and_run(Path(name), numeric, options, broken=broken)
                for branch, count in branches(Path(name), numeric).items():
                    total[branch] += count
        ways = {b: n for b, n in total.items() if b[2] >= 0}
        lines = {b: n for b, n in total.items() if b[2] < 0}
        never = sorted(b for b, n in total.items() if n == 0)
        missing += len(never)
        figures[numeric] = {"branches": len(ways), "taken": sum(n > 0 for n in ways.values()),
                            "lines": len(lines), "reached": sum(n > 0 for n in lines.values())}  # fmt: skip
        print(f"{numeric}: {figures[numeric]['taken']} of {len(ways)} branches taken, "
              f"{figures[numeric]['reached']} of {len(lines)} lines reached")  # fmt: skip
        for source, line, decision, way in never:
            what = "line never reached" if decision < 0 else f"decision {decision}, way {way} never taken"
            print(f"  libc/{source}:{line}: {what}")
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
