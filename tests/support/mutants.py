"""Damaged and hostile files through every reader: a message or a result, never another exception, a hang, or 2 GiB.

`python tests/support/mutants.py --count 20000 --seed 1` (`make fuzz`). Workers have a limit of memory, mutants 10 s.
A failure is printed with its number: `--seed S --only K` makes it again.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")

import numpy as np
from gyrotc.common import GyrotcError

sys.path.insert(0, str(Path(__file__).parent))

from mutation import mutated
from readers import READERS, Reader, make_seeds, seeds_in

SECONDS = 10
REPORTED_EVERY = 500
WAITING = 60  # on a busy machine; SIGALRM ends the worker
SHOW = bool(os.environ.get("SHOW"))  # every refusal, too
MOST_BYTES = 2 * 2**30


def case(readers: dict[str, Reader], seed: int, number: int) -> tuple[str, bytes]:
    """The mutant of a number: its reader and its bytes."""
    rng = np.random.default_rng([seed, number])
    name = list(readers)[number % len(readers)]
    reader = readers[name]
    return name, mutated(reader.seeds[int(rng.integers(len(reader.seeds)))], reader.form, rng)


def tried(read: Callable[[bytes], None], data: bytes) -> str:
    """What came of it: read, refused, or the traceback of anything else."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            read(data)
    except GyrotcError as error:
        str(error).encode("utf-8", "strict")
        if SHOW:
            print(f"| {error}", flush=True)
        return "refused"
    except Exception:
        return traceback.format_exc()
    return "read"


def work(seeds: Path, seed: int, first: int, last: int) -> None:
    """Numbers first ... last - 1, one line each on stdout before and after."""
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_BYTES, MOST_BYTES))
    with tempfile.TemporaryDirectory(prefix="gyrotc-mutants-") as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        readers = seeds_in(seeds, Path(folder))
        for name, reader in readers.items() if first == 0 else ():
            for data in reader.seeds:
                assert (came := tried(reader.read, data)) == "read", f"{name} as it is: {came}"
        for number in range(first, last):
            name, data = case(readers, seed, number)
            print(f"try {number} {name}", flush=True)
            signal.setitimer(signal.ITIMER_PROF, SECONDS)  # of work; SIGPROF ends the worker
            signal.alarm(WAITING)
            start = time.monotonic()
            result = tried(readers[name].read, data)
            signal.alarm(0)
            signal.setitimer(signal.ITIMER_PROF, 0)
            kind = result if result in ("read", "refused") else "failed"
            print(f"{kind} {time.monotonic() - start:.3f}", flush=True)
            if kind == "failed":
                print("".join(f"| {line}\n" for line in result.splitlines()), end="", flush=True)


def run(seed: int, count: int, jobs: int, first: int = 0) -> int:
    """All numbers over `jobs` processes; the number of failures, each reported."""
    with tempfile.TemporaryDirectory(prefix="gyrotc-seeds-") as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        make_seeds(Path(folder))
        seeds_in(Path(folder), Path(folder) / "first")  # whatever is made once
        return _run(Path(folder), seed, count, jobs, first)


def _run(seeds: Path, seed: int, count: int, jobs: int, first: int) -> int:
    share = -(-count // jobs)
    parts = [(first + k * share, first + min((k + 1) * share, count)) for k in range(jobs)]
    counts: Counter[str] = Counter()
    with ThreadPoolExecutor(jobs) as pool:
        for found in pool.map(lambda part: _part(seeds, seed, *part), parts):
            counts += found
    print(f"seed {seed}: " + ", ".join(f"{n} {what}" for what, n in sorted(counts.items())))
    return sum(n for what, n in counts.items() if what.endswith(("failed", "killed")))


def _part(seeds: Path, seed: int, first: int, last: int) -> Counter[str]:
    """What came of a part; a worker that a mutant ends is started again behind it."""
    counts: Counter[str] = Counter()
    at: int | None = first - 1
    while at is not None and at + 1 < last:
        at = _collected(_started(seeds, seed, at + 1, last), counts)
    return counts


def _started(seeds: Path, seed: int, first: int, last: int) -> subprocess.Popen[str]:
    arguments = ["--seed", str(seed), "--part", f"{first}:{last}", "--seeds", str(seeds)]
    command = [sys.executable, str(Path(__file__).resolve()), *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def _collected(process: subprocess.Popen[str], counts: Counter[str]) -> int | None:
    """Reads what a worker says to its end; the number at which it was killed, None if it was not."""
    at, name, shown = -1, "start", False
    assert process.stdout is not None
    for line in process.stdout:
        word, _, rest = line.rstrip("\n").partition(" ")
        if word == "try":
            number, name = rest.split()
            at, shown = int(number), True
        elif word == "|":
            print(line, end="")
        else:
            shown = False
            counts[f"{name} {word}"] += 1
            if word == "failed":
                print(f"mutant {at} of {name} failed:", flush=True)
            elif at % REPORTED_EVERY == 0:
                print(f"  {at} ...", file=sys.stderr, flush=True)
    status = process.wait()
    if status == 0:
        return None
    print(f"mutant {at} of {name}: the worker ended with status {status} (-27: {SECONDS} s of work, -14: {WAITING} s)")
    counts[f"{name} killed"] += 1
    if not shown:
        raise SystemExit(f"a worker did not start, status {status}")
    return at


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=len(READERS) * 20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", type=int)
    parser.add_argument("--part", help=argparse.SUPPRESS)
    parser.add_argument("--seeds", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.part is not None:
        first, _, last = given.part.partition(":")
        work(given.seeds, given.seed, int(first), int(last))
        return 0
    if given.only is not None:
        return run(given.seed, 1, 1, first=given.only) > 0
    return run(given.seed, given.count, given.jobs) > 0


if __name__ == "__main__":
    sys.exit(main())
