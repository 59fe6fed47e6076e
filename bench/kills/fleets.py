"""A small fleet to be killed: each unit is as before or whole and new, and every summary file agrees with the units."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gyrotc.fleet import SUMMARY, Task, do_unit, load_manifest
from gyrotc.results import FleetEntry, program_of, result_faults

from .driver import run
from .jobs import GYROTC, Case, command

UNITS = ("A", "B", "C")
_MANIFEST = 'schema = 1\ndatasets = ["gyros/*"]\nnumeric = ["f32"]\n[options]\nseed = {}\n'
_ROW = re.compile(r'<tr data-state="([a-z]+)"[^>]*><td class="name">(?:<a [^>]*>)?([A-Z])<(.*?)</tr>', re.DOTALL)
_VALUE = re.compile(r'data-value="([^"]+)"')


def fleet(root: Path, scenario: Path) -> Case:
    """Three gyros, done again with another seed; now and then for the first time, or without the earlier summary."""
    manifest, out = root / "fleet.toml", root / "fleet"
    for seed, name in enumerate(UNITS, 11):
        place = root / "gyros" / name
        subprocess.run(
            [*GYROTC, "simulate", scenario, "--seed", str(seed), "--out", place],
            check=True,
            stdout=subprocess.DEVNULL,
        )

    def prepare(version: int) -> None:
        manifest.write_text(_MANIFEST.format(version))
        if version % 5 == 1:
            shutil.rmtree(out, ignore_errors=True)
        elif version % 5 == 2:
            for name in SUMMARY:
                (out / name).unlink(missing_ok=True)

    prepare(0)
    return Case(
        "fleet",
        lambda _: command("fleet", manifest, "--out", out, "--jobs", 2),
        tuple(out / name for name in UNITS),
        prepare,
        lambda: _disagreement(out),
        _calls_of_a_unit(root, manifest),
    )


def _calls_of_a_unit(root: Path, manifest: Path) -> int:
    wanted = load_manifest(manifest)
    task = Task(wanted.units[0], "alone", wanted, root / "alone", program=program_of())
    end = run(lambda: _refuse_failed(do_unit(task)), root)
    shutil.rmtree(root / "alone")
    if end.status != 0:
        raise SystemExit(f"a unit fails by itself: {end.reported}")
    return end.calls


def _refuse_failed(entry: FleetEntry) -> None:
    if entry.status != "done":
        raise SystemExit(str(entry.reason))


def _disagreement(out: Path) -> list[str]:
    """What a file of the summary says of a unit that does not hold; that one is unfinished may always be said."""
    readers = {"fleet.json": _of_json, "fleet.csv": _of_csv, "fleet.html": _of_page}
    found = []
    for name, read in readers.items():
        if (out / name).exists():
            rows = dict(read(out / name))
            if set(rows) != set(UNITS):
                found.append(f"{name} is about {sorted(rows)}")
            found += [f"{name}: {what}" for unit, row in rows.items() for what in _untrue(out / unit, *row)]
    return found


Row = tuple[str, dict[str, str]]


def _untrue(unit: Path, status: str, figures: Mapping[str, str]) -> list[str]:
    if status == "unfinished":
        return [f"figures of {unit.name}, which is unfinished"] if figures else []
    if status == "failed":
        return []
    if result_faults(unit):
        return [f"{unit.name} is {status}, and {result_faults(unit)}"]
    entry = json.loads((unit / "entry.json").read_text())
    reported = {name: f"{entry[name]:.4g}" if name.endswith("_dph") else str(entry[name]) for name in figures}
    return [] if reported == figures and figures else [f"{unit.name}: {figures}, and its result says {reported}"]


def _of_json(path: Path) -> Iterator[tuple[str, Row]]:
    for row in json.loads(path.read_text())["serials"]:
        yield row["name"], (row["status"], _figures(row))


def _of_csv(path: Path) -> Iterator[tuple[str, Row]]:
    with path.open() as stream:
        for row in csv.DictReader(stream):
            yield row["name"], (row["status"], _figures({k: v for k, v in row.items() if v}))


def _figures(row: Mapping[str, Any]) -> dict[str, str]:
    figures = {k: f"{float(row[k]):.4g}" for k in ("constant_rms_dph", "after_rms_dph", "bias_dph") if k in row}
    return figures | ({"model_hash": row["model_hash"]} if "model_hash" in row else {})


def _of_page(path: Path) -> Iterator[tuple[str, Row]]:
    for status, name, rest in _ROW.findall(path.read_text()):
        values = [f"{float(value):.4g}" for value in _VALUE.findall(rest)]
        yield name, (status, dict(zip(("constant_rms_dph", "after_rms_dph"), values, strict=False)))
