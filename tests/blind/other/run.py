"""Blind runs in the other world: each recording has its own temperatures; who diagnoses is not reported.

Whoever changes the detector runs with a new seed: what was drawn before may have been looked at.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path

from ..grade import Row
from ..run import Tool, rows_of
from .grade import graded
from .mechanisms import CATALOGUE
from .record import draw_recording, reported, write

_SHARES = (("clean", 0.45), ("foreign", 0.30), ("one", 0.25))


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
