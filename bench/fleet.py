"""A thousand gyros of a lot through `gyrotc fleet` and `gyrotc lot`, faults planted in lots, a million calibrations."""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import closing
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.fleet.catalogue import catalogued, hash_rows, opened
from gyrotc.fleet.manifest import load_manifest
from gyrotc.fleet.page import summary_of
from gyrotc.fleet.run import run_fleet
from gyrotc.model import load_model
from gyrotc.results.folder import kept_by_hash
from gyrotc.tables.emit import image_of
from gyrotc.tables.quantise import quantise
from lot import FAULTS, Lot
from results import machine, write

from .growth import gyrotc
from .sizes import MODEL

_SERIALS = 1000
_JOBS = 2
_SECTION = """## A fleet (`make fleet`)

{machine}. {serials} gyros of a simulated lot, of the paper's size (12 runs of 8 h, rows of 10 s), by `gyrotc fleet`
with {jobs} processes: each read, fitted (`mrbf`), emitted in float32 and fixed point, its files checked against the
reference, and judged on its exam runs; then `gyrotc lot` of them. The load is that of the machine before the job: what
else wanted its processors.

| elapsed | CPU | CPU a serial | failed | RMS ÷ noise floor, median / worst | load | `lot`: CPU, peak |
| --- | --- | --- | --- | --- | --- | --- |
"""
_ROW = (
    "| {elapsed_s:.1f} s | {cpu_s:.1f} s | {each_ms:.0f} ms | {failed} | {median:.4f} / {worst:.4f} | {load:.1f} "
    "| {lot_s:.1f} s, {lot_mib:.0f} MiB |\n"
)


def fleet_figures(serials: int) -> dict[str, Any]:
    """Costs of a fleet and of its lot, interpreter and imports of every process included."""
    with tempfile.TemporaryDirectory(prefix="gyrotc-fleet-") as work:
        data, out = Path(work) / "data", Path(work) / "out"
        print(f"simulating {serials} gyros", file=sys.stderr)
        gyrotc(["simulate", "lot", "--units", str(serials), "--out", str(data)])
        load, begun = os.getloadavg()[0], time.monotonic()
        cost = gyrotc(["fleet", str(data), "--out", str(out), "--jobs", str(_JOBS)])
        elapsed = time.monotonic() - begun
        lot = gyrotc(["lot", str(out), "--out", str(Path(work) / "lot.json")])
        summary = json.loads((out / "fleet.json").read_text("utf-8"))
    ratio = summary["figures"]["rms_over_floor"]
    return {
        "schema": "gyrotc.bench-fleet/1",
        "machine": machine(),
        "serials": serials,
        "jobs": _JOBS,
        "failed": summary["failed"],
        "elapsed_s": elapsed,
        "cpu_s": cost["seconds"],
        "load": load,
        "lot_s": lot["seconds"],
        "lot_mib": lot["peak_mib"],
        "rms_over_floor": {"median": ratio["median"], "worst": ratio["largest"]},
    }


def section(figures: dict[str, Any]) -> str:
    """The section of docs/results.md as text."""
    each_ms, ratio = 1e3 * figures["cpu_s"] / figures["serials"], figures["rms_over_floor"]
    row = _ROW.format(**figures, each_ms=each_ms, median=ratio["median"], worst=ratio["worst"])
    return _SECTION.format(**figures) + row


def write_fleet(docs: Path) -> None:
    """The section `fleet`; status 1, and nothing is written, where a serial failed."""
    write(docs, "fleet", fleet_figures(_SERIALS), section)


def kills_section(record: dict[str, Any]) -> str:
    """The section `fleet-kills`, whose record a test leaves."""
    return (
        "## A fleet on Dask whose workers are killed (`make fleet-kills`)\n\n"
        "{serials} gyros on two workers, of which {killed} processes were killed while they worked. Of {files} files "
        "(models and everything emitted) {differ} differ from those that processes of one machine make.\n"
    ).format(**record)


_UNITS, _DRAWS, _SEED, _LOT_JOBS = 20, 8, 1, 2  # three axes each
_MANIFEST = 'schema = 1\ndatasets = ["IMU-*"]\naxis = "all"\nnumeric = ["f32"]\n'
_LOT = """## Faults planted in a lot (`make lot`)

{draws} lots of {gyros} small simulated gyros ({units} units of three axes, six runs of two hours) with one unit of
each fault, from seed {seed}, through `gyrotc fleet` with {jobs} processes ({elapsed_s:.0f} s in all). Named: every axis
that the fault concerns has its reason. Healthy gyros accused: {accused} of {healthy}.

| fault | named |
| --- | --- |
{rows}
"""


def planted_lots(draws: int, seed: int) -> dict[str, Any]:
    """How often each fault was named, and how many healthy gyros were accused."""
    named, accused, healthy, start = dict.fromkeys(FAULTS, 0), [], 0, time.monotonic()
    for draw in range(draws):
        lot = Lot(seed + draw, _UNITS)
        for fault, unit in zip(FAULTS, lot.draw.permutation(lot.units), strict=False):
            lot.plant(fault, str(unit))
        with tempfile.TemporaryDirectory(prefix="gyrotc-lot-") as work:
            folder = Path(work)
            lot.write(folder / "data")
            (folder / "data" / "fleet.toml").write_text(_MANIFEST)
            entries = run_fleet(load_manifest(folder / "data" / "fleet.toml"), folder / "out", jobs=_LOT_JOBS)
            found = {reason.name: reason for reason in summary_of(entries).reasons}
        concerned = set().union(*lot.planted.values())
        for fault, names in lot.planted.items():
            missed = {
                name: reason.text if (reason := found.get(name)) else None
                for name in names
                if name not in found or found[name].id != fault
            }
            named[fault] += not missed
            if missed:
                print(f"draw {draw}: {fault} not named: {missed}", flush=True)
        accused += [f"draw {draw}: {found[name].text} ({name})" for name in found if name not in concerned]
        healthy += 3 * _UNITS - len(concerned)
    for text in accused:
        print("accused:", text)
    elapsed = time.monotonic() - start
    return {
        "named": named,
        "accused": len(accused),
        "healthy": healthy,
        "elapsed_s": elapsed,
        "draws": draws,
        "seed": seed,
    }


def lot_section(figures: dict[str, Any]) -> str:
    """The lot_section of docs/results.md."""
    rows = "\n".join(
        f"| {fault.replace('_', ' ')} | {n} of {figures['draws']} |" for fault, n in figures["named"].items()
    )
    return _LOT.format(rows=rows, units=_UNITS, gyros=3 * _UNITS, jobs=_LOT_JOBS, **figures)


def write_lot(docs: Path) -> None:
    """The section `lot`; status 1 where a fault was named in under seven of eight draws, or two gyros were accused."""
    figures = planted_lots(_DRAWS, _SEED)
    write(docs, "lot", figures, lot_section)
    if min(figures["named"].values()) < 7 * _DRAWS / 8 or figures["accused"] > 1:
        sys.exit(1)


_ROWS, _EACH, _ASKED = 1_000_000, 5, 200  # calibrations; of each gyro; gyros that are asked for
_FIRST = date(2020, 1, 1)
_CATALOGUE = """## The catalogue (`make fleet`)

"Which table may this gyro carry on this day, and from which data", asked for {asked} random gyros of a catalogue of
{rows} calibrations with two recordings each ({megabytes:.0f} MB), the file opened anew each time, as `gyrotc catalogue`
does it. The aim is 50 ms.

| median | 95 % | longest |
| --- | --- | --- |
| {median_ms:.2f} ms | {most_ms:.2f} ms | {longest_ms:.2f} ms |
"""


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _rows(rows: int, kept: dict[int, tuple[str, str, str]]) -> Iterator[tuple[Any, ...]]:
    """Calibrations; `kept`: hashes of model, image and file of those gyros whose payloads are there."""
    for k in range(rows):
        day = _FIRST + timedelta(days=365 * (k % _EACH))
        known = _hash(str(k))
        yield (
            f"RLG-{k // _EACH:06d}", "", day.isoformat(), (day + timedelta(days=400)).isoformat(), "lot", "done",
            "PASS", *kept.get(k // _EACH, (known, known, known)), known, 7e-4, 1e-4, "RLG",
        )  # fmt: skip


def _kept(folder: Path, gyros: Iterable[int]) -> dict[int, tuple[str, str, str]]:
    """Payloads of gyros, as a fleet leaves them: hashes of model, image and file."""
    kept, base, made = {}, load_model(MODEL), folder / "made"
    for k in gyros:
        model = base.model_copy(update={"serial": f"RLG-{k:06d}"})
        model.save(made)
        text = kept_by_hash(folder / "payloads", made).name
        made.write_bytes(image_of(quantise(model, "f32")))
        kept[k] = model.hash, kept_by_hash(folder / "payloads", made).name, text
    return kept


def times(rows: int) -> dict[str, Any]:
    """Times of the question, s, in a catalogue of so many calibrations."""
    asked = np.random.default_rng(1).integers(0, rows // _EACH, _ASKED)
    with tempfile.TemporaryDirectory(prefix="gyrotc-catalogue-") as work:
        path = Path(work) / "catalogue.sqlite"
        with opened(path):
            pass  # made as a fleet makes it; its statements end after a minute, those below need more
        with closing(sqlite3.connect(path)) as base, base:
            columns = base.execute("SELECT group_concat(name) FROM pragma_table_info('calibration')").fetchone()[0]
            names = columns.removeprefix("id,").removesuffix(",row_sha256")
            places = ", ".join("?" * 14)
            made = _rows(rows, _kept(path.parent, set(asked.tolist())))
            base.executemany(f"INSERT INTO calibration ({names}) VALUES ({places})", made)
            files = ((k + 1, f"run-{n}.csv", "train", _hash(f"{k} {n}")) for k in range(rows) for n in range(2))
            base.executemany("INSERT INTO recording VALUES (?, ?, ?, ?)", files)
            for k in range(rows // _EACH):
                hash_rows(base, f"RLG-{k:06d}")
        took = []
        for k in asked:
            begun = time.perf_counter()
            answer = catalogued(path, f"RLG-{k:06d}", "2022-06-01")
            took.append(1e3 * (time.perf_counter() - begun))
            assert [len(one.recordings) for one in answer.found] == [2]
        size = path.stat().st_size / 1e6
    return {
        "rows": rows, "asked": _ASKED, "megabytes": size, "median_ms": float(np.median(took)),
        "most_ms": float(np.quantile(took, 0.95)), "longest_ms": max(took),
    }  # fmt: skip


def catalogue_section(result: dict[str, Any]) -> str:
    """The catalogue_section of docs/results.md."""
    return _CATALOGUE.format(**result)


def write_catalogue(docs: Path) -> None:
    """The section `catalogue`; status 1 where one question in twenty takes longer than 50 ms."""
    result = times(_ROWS)
    write(docs, "catalogue", result, catalogue_section)
    if result["most_ms"] > 50.0:
        sys.exit(1)
