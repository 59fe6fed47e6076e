"""Faults planted among 300 healthy gyros, through `gyrotc fleet`: which are named, and which healthy ones are accused."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gyrotc.fleet.manifest import load_manifest
from gyrotc.fleet.page import summary_of
from gyrotc.fleet.run import run_fleet
from lot import FAULTS, RUN_FAULTS, Lot
from results import table, write

_UNITS, _EACH, _SEED, _JOBS = (
    116,
    3,
    1,
    2,
)  # three axes each: 348 gyros, of which 300 are left without a fault
_MANIFEST = 'schema = 1\ndatasets = ["IMU-*"]\naxis = "all"\nnumeric = ["f32"]\n'
_NAMED_AS = {  # else by the fault's own name; rows of 20 s do not tell a step from a change within 60 s
    "run_reversed": ("sign_reversed",),
    "step": ("step", "transition"),
}


def write_planted(docs: Path, say: Callable[[str], None]) -> None:
    """The record `planted`."""
    write(docs, "planted", _planted(say), section)


def _planted(say: Callable[[str], None]) -> dict[str, Any]:
    started = time.monotonic()
    lot = Lot(_SEED, _UNITS)
    units = iter(lot.draw.permutation(lot.units))
    faults = []
    for fault in (*(f for f in FAULTS if f != "copy_of_other"), *RUN_FAULTS) * _EACH:
        before = set(lot.planted.get(fault, ()))
        lot.plant(fault, str(next(units)))
        faults.append((fault, lot.planted[fault] - before))
    with tempfile.TemporaryDirectory(prefix="gyrotc-planted-") as work:
        folder = Path(work)
        lot.write(folder / "data")
        (folder / "data" / "fleet.toml").write_text(_MANIFEST)
        manifest = load_manifest(folder / "data" / "fleet.toml")
        summary = summary_of(run_fleet(manifest, folder / "out", jobs=_JOBS))
    found = {reason.name: reason for reason in summary.reasons}
    barred = {unit.name for unit in summary.serials if unit.barred}
    rows: dict[str, dict[str, Any]] = {}
    for fault, names in faults:
        row = rows.setdefault(fault, {"fault": fault, "planted": 0, "named": 0, "barred": 0})
        wrong = {name: found[name].id if name in found else None for name in names}
        wrong = {name: id_ for name, id_ in wrong.items() if id_ not in _NAMED_AS.get(fault, (fault,))}
        row["planted"] += 1
        row["named"] += not wrong
        row["barred"] += names <= barred
        if wrong:
            say(f"{fault}: {wrong}")
    concerned = set().union(*(names for _, names in faults))
    accused = [f"{name}: {found[name].text}" for name in found if name not in concerned]
    for text in accused:
        say(f"accused: {text}")
    return {
        "rows": list(rows.values()),
        "planted": len(faults),
        "named": sum(row["named"] for row in rows.values()),
        "healthy": 3 * _UNITS - len(concerned),
        "accused": len(accused),
        "seed": _SEED,
        "elapsed_s": time.monotonic() - started,
    }


def section(result: dict[str, Any]) -> str:
    """The table as text."""
    rows = [(r["fault"].replace("_", " "), r["planted"], r["named"], r["barred"]) for r in result["rows"]]
    return (
        f"## Faults planted in a fleet (`python -m bench docs --only planted`)\n\nSeed {result['seed']}. Healthy gyros "
        f"accused: {result['accused']} of {result['healthy']}.\n\n"
        + table(("fault", "planted ", "named ", "barred "), rows)
    )
