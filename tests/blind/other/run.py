"""Blind runs in the other world: each recording has its own temperatures; who diagnoses is not reported.

Whoever changes the detector runs with a new seed: what was drawn before may have been looked at.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..grade import Row
from ..page import answer_lines, run_lines, write_section
from ..run import Tool, rows_of
from .grade import answers, graded, table
from .mechanisms import CATALOGUE
from .record import draw_recording, reported, write

_SHARES = (("clean", 0.45), ("foreign", 0.30), ("one", 0.25))
_HEAD = """## Hidden effects in a world that is no sibling (`make blind`)

Gyros of another make (tests/blind/other, which imports nothing of gyrotc): heat by finite volumes through case, glass
and mirror with properties that depend on temperature, a chamber that switches, relays of Preisach, an etalon's waves,
noise of 1/f^alpha with alpha from 0.5 to 1.5, converters with steps, rows of 1, 10 or 60 s, the noise declared wrong
in half, parameters that may lie beyond what is searched, and a campaign of temperatures for each recording. Foreign
effects are drawn from a grammar of operators (integrate, saturate, threshold, delay, relax, multiply); of none of them
can one cause of the catalogue imitate more than half of the energy beside the map. Up to seed 1636088912 lags and late
clocks were held to imitate by polynomials of degree 6 and at six shifts, so that maps of a late temperature passed for
foreign; now they have the same functions as the plain map, at 36 shifts. That map is finer now: what counts for k lies
beside lines between nodes 4 C apart, before beside a polynomial of degree 9. k = d / 6 as above. Limits: 95 %, by
recording (Clopper and Pearson). The detector was not tuned on this world.
"""


def orders(records: int) -> list[tuple[str, str]]:
    """Stratum and name of every recording: strata take turns, so that a run that is stopped is a smaller run."""
    made = {stratum: 0 for stratum, _ in _SHARES}
    names = list(CATALOGUE)
    out = []
    for k in range(records):
        stratum = max(_SHARES, key=lambda s: s[1] * (k + 1) - made[s[0]])[0]
        out.append((stratum, names[made[stratum] % len(names)] if stratum == "one" else ""))
        made[stratum] += 1
    return out


def run(seed: int, records: int, folder: Path, *, hours: float = 5.0) -> list[Row]:
    """Recordings of a run, one after the other; rows that `folder` holds already are not made again."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{seed}-{records}.jsonl"
    done = {row["number"]: row for row in rows_of(path)}
    with (
        tempfile.TemporaryDirectory(prefix="blind-other-") as name,
        Tool(Path(name)) as tool,
        path.open("a", encoding="utf-8") as stream,
    ):
        for number, (stratum, wanted) in enumerate(orders(records)):
            if number in done:
                continue
            recording = draw_recording(seed, number, stratum, wanted, hours=hours)
            target = Path(name) / f"u{number:04d}"
            write(recording, target, f"V-{number:04d}")
            row = {**graded(recording, tool.diagnose(target)), "number": number}
            done[number] = row
            stream.write(json.dumps(row) + "\n")
            stream.flush()
            print(_line(row), flush=True)
            _sweep(Path(name))
    return [done[k] for k in sorted(done)]


def written(seed: int, records: int, number: int, target: Path) -> str:
    """Writes one recording of a run and says what is hidden in it."""
    recording = draw_recording(seed, number, *orders(records)[number])
    write(recording, target, f"V-{number:04d}")
    return str(reported(recording.truth))


def _sweep(folder: Path) -> None:
    """Removes recordings, and what was cached of temperatures that do not come again."""
    for left in folder.iterdir():
        if left.is_dir():
            shutil.rmtree(left)
        else:
            left.unlink()


def _line(row: Row) -> str:
    hidden = f"{row['name'] or row['kind'] or 'nothing'} {row['k']:.2f}"
    found = ", ".join([*row["named"], *row["noise"]]) or "-"
    return f"{row['number']:4d} {row['row_s']:2d} s {row['declared']:5s} {hidden} -> {row['verdict']}: {found}"


def write_page(docs: Path, head: dict[str, Any], rows: Sequence[Row]) -> None:
    """The section of docs/results.md on the other world: every run that was started."""
    kept = ("kind", "k", "named")
    mistaken = [row for row in rows if row["stratum"] == "foreign" and row["named"]]
    foreign = [{name: row[name] for name in kept} for row in mistaken]
    reported = {"table": table(rows), "answers": answers(rows), "foreign": foreign}
    write_section(docs, "blind-other", head | {"done": len(rows)}, reported, section)


def section(record: dict[str, Any]) -> str:
    """The section as text."""
    return "\n".join([_HEAD, *map(_section, record["runs"])])


def _section(run: dict[str, Any]) -> str:
    lines = [*run_lines(run, "Other world"), *answer_lines(run["answers"], "answers")]
    if named := run["foreign"]:
        lines += [
            "",
            "Foreign kinds that were given a name:",
            "",
            "| kind | k | named |",
            "| --- | --- | --- |",
        ]
        lines += [f"| `{one['kind']}` | {one['k']:.1f} | {' + '.join(one['named'])} |" for one in named]
    return "\n".join([*lines, "", ""])
