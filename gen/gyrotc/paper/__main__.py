"""Every table and figure of docs/paper.md made again, or checked.

python -m gyrotc.paper docs            its part of docs/results/summary.json, page, figures, the run of simulation.md
python -m gyrotc.paper docs --check    the same measured again and compared with what is there; changes nothing
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..simulate.campaign import campaign, with_noise
from ..simulate.scenario import read
from ..store.files import write_atomically
from .figures import FIGURES, draw, draw_run
from .page import SEEDS, departures, filled, keep, measured, parts, recorded

_RUN = "5 C/min"


def record_of(docs: Path) -> dict[str, Any]:
    """What docs/results/summary.json has of the experiment."""
    found: dict[str, Any] = recorded(docs, "paper")
    return found


def page_of(docs: Path, record: Mapping[str, Any]) -> str:
    """docs/paper.md with its tables made from the record."""
    bench = recorded(docs, "bench")
    tables = bench["speed"]["learning"] if bench else []
    rows: list[dict[str, Any]] = next((table["rows"] for table in tables if table["scenario"] == "paper"), [])
    return filled((docs / "paper.md").read_text("utf-8"), parts(record, rows))


def stale(docs: Path) -> Iterator[str]:
    """What of the page and its figures is not made from the record beside them."""
    record = record_of(docs)
    there, made = (docs / "paper.md").read_text("utf-8"), page_of(docs, record)
    for old, new in zip(there.splitlines(), made.splitlines(), strict=False):
        if old != new:
            yield f"{docs / 'paper.md'}: {old!r}; the record gives {new!r}"
    if there.count("\n") != made.count("\n"):
        yield f"{docs / 'paper.md'}: {there.count(chr(10))} lines; the record gives {made.count(chr(10))}"
    for number in FIGURES:
        path = docs / "paper" / f"figure-{number:02d}.png"
        if not path.exists() or record["figures"].encode() not in path.read_bytes():
            yield f"{path}: does not show the series that the record is of"


def write(docs: Path) -> None:
    """Writes record, tables, `docs/paper/`, and one run into `docs/simulation/`."""
    record, series = measured()
    keep(docs, "paper", record)
    write_atomically(docs / "paper.md", page_of(docs, record))
    draw(series, docs / "paper")
    plan = with_noise(read("paper-5C-min")[1], "paper")
    draw_run(next(iter(campaign(plan, SEEDS[0]))), f"Chamber at {_RUN}", docs / "simulation" / "run.png")
    print(f"{docs / 'paper.md'} and the figures beside it")


def main() -> int:
    """0: done, or all is as recorded; 1: something is not."""
    parser = argparse.ArgumentParser(prog="gyrotc.paper", description=__doc__.splitlines()[0])
    parser.add_argument("docs", type=Path)
    parser.add_argument("--check", action="store_true", help="measure again and compare; write nothing")
    arguments = parser.parse_args()
    if not arguments.check:
        write(arguments.docs)
        return 0
    wrong = [*stale(arguments.docs), *departures(record_of(arguments.docs), measured()[0])]
    for line in wrong:
        print(line, file=sys.stderr)
    print(f"docs/paper.md: {len(wrong)} departures" if wrong else "docs/paper.md: as measured now")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
