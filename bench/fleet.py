"""A thousand gyros of a lot through `gyrotc fleet` and `gyrotc lot`, faults planted in lots."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from gyrotc.fleet.manifest import load_manifest
from gyrotc.fleet.page import summary_of
from gyrotc.fleet.run import run_fleet
from lot import FAULTS, Lot
from results import machine, write

from .growth import gyrotc

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
