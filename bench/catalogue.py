"""`python -m bench.catalogue docs [ROWS]`: how long a catalogue takes to say what a gyro may carry."""

from __future__ import annotations

import hashlib
import sqlite3
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.fleet.catalogue import SCHEMA, catalogued
from results import write

__all__ = ["section", "times"]

_ROWS, _EACH, _ASKED = 1_000_000, 5, 200  # calibrations; of each gyro; gyros that are asked for
_FIRST = date(2020, 1, 1)
_SECTION = """## The catalogue (`python -m bench.catalogue docs`)

"Which table may this gyro carry on this day, and from which data", asked for {asked} random gyros of a catalogue of
{rows} calibrations with two recordings each ({megabytes:.0f} MB), the file opened anew each time, as `gyrotc catalogue`
does it. The aim is 50 ms.

| median | 95 % | longest |
| --- | --- | --- |
| {median_ms:.2f} ms | {most_ms:.2f} ms | {longest_ms:.2f} ms |
"""


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _rows(rows: int) -> Iterator[tuple[Any, ...]]:
    for k in range(rows):
        day = _FIRST + timedelta(days=365 * (k % _EACH))
        known = _hash(str(k))
        yield (
            f"RLG-{k // _EACH:06d}", "", day.isoformat(), (day + timedelta(days=400)).isoformat(), "lot", "done",
            "PASS", known, known, known, known, 7e-4, 1e-4, "RLG",
        )  # fmt: skip


def times(rows: int) -> dict[str, Any]:
    """Times of the question, s, in a catalogue of so many calibrations."""
    draw = np.random.default_rng(1)
    with tempfile.TemporaryDirectory(prefix="gyrotc-catalogue-") as work:
        path = Path(work) / "catalogue.sqlite"
        with closing(sqlite3.connect(path)) as base, base:
            base.executescript(SCHEMA)
            columns = base.execute(
                "SELECT group_concat(name) FROM pragma_table_info('calibration')"
            ).fetchone()[0]
            names = columns.removeprefix("id,")
            base.executemany(f"INSERT INTO calibration ({names}) VALUES ({', '.join('?' * 14)})", _rows(rows))
            files = (
                (k + 1, f"run-{n}.csv", "train", _hash(f"{k} {n}")) for k in range(rows) for n in range(2)
            )
            base.executemany("INSERT INTO recording VALUES (?, ?, ?, ?)", files)
        took = []
        for k in draw.integers(0, rows // _EACH, _ASKED):
            begun = time.perf_counter()
            answer = catalogued(path, f"RLG-{k:06d}", "2022-06-01")
            took.append(1e3 * (time.perf_counter() - begun))
            assert [len(one.recordings) for one in answer.found] == [2]
        size = path.stat().st_size / 1e6
    return {
        "rows": rows, "asked": _ASKED, "megabytes": size, "median_ms": float(np.median(took)),
        "most_ms": float(np.quantile(took, 0.95)), "longest_ms": max(took),
    }  # fmt: skip


def section(result: dict[str, Any]) -> str:
    """The section of docs/results.md."""
    return _SECTION.format(**result)


def main(arguments: list[str]) -> int:
    """Status 1 where one question in twenty takes longer than 50 ms."""
    rows = int(arguments[1]) if len(arguments) > 1 else _ROWS
    result = times(rows)
    print(result)
    if rows == _ROWS:
        write(Path(arguments[0]), "catalogue", result, section)
    return int(result["most_ms"] > 50.0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
