"""Faults planted among 300 healthy gyros, through `gyrotc fleet`: which are named, and which healthy ones accused."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

from gyrotc.fleet import load_manifest, run_fleet, summary_of
from lot import FAULTS, RUN_FAULTS, Lot

from ..campaigns import say

#: Units of three axes: of 348 gyros 300 are left without a fault.
UNITS = 116
#: Units that get each fault.
EACH = 3
_MANIFEST = 'schema = 1\ndatasets = ["IMU-*"]\naxis = "all"\nnumeric = ["f32"]\n'
_NAMED_AS = {  # else by the fault's own name; rows of 20 s do not tell a step from a change within 60 s
    "run_reversed": ("sign_reversed",),
    "step": ("step", "transition"),
}


def planted(seed: int, workers: int, units: int = UNITS, each: int = EACH) -> dict[str, Any]:
    """Return which planted faults were named, and how many healthy gyros were accused."""
    started = time.monotonic()
    lot = Lot(seed, units)
    places = iter(lot.draw.permutation(lot.units))
    faults = []
    for fault in (*(f for f in FAULTS if f != "copy_of_other"), *RUN_FAULTS) * each:
        before = set(lot.planted.get(fault, ()))
        lot.plant(fault, str(next(places)))
        faults.append((fault, lot.planted[fault] - before))
    with tempfile.TemporaryDirectory(prefix="gyrotc-planted-") as work:
        folder = Path(work)
        lot.write(folder / "data")
        (folder / "data" / "fleet.toml").write_text(_MANIFEST)
        manifest = load_manifest(folder / "data" / "fleet.toml")
        summary = summary_of(run_fleet(manifest, folder / "out", jobs=workers))
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
        "healthy": 3 * units - len(concerned),
        "accused": len(accused),
        "seed": seed,
        "elapsed_s": time.monotonic() - started,
    }
