"""`python -m bench.lot docs [DRAWS] [SEED]`: faults planted in lots of 60 gyros, and which `gyrotc fleet` names."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from gyrotc.fleet.manifest import load_manifest
from gyrotc.fleet.page import summary_of
from gyrotc.fleet.run import run_fleet
from lot import FAULTS, Lot
from results import write

ROOT = Path(__file__).resolve().parents[1]

__all__ = ["planted_lots", "section"]

_UNITS, _DRAWS, _SEED, _JOBS = 20, 8, 1, 2  # three axes each
_MANIFEST = 'schema = 1\ndatasets = ["IMU-*"]\naxis = "all"\nnumeric = ["f32"]\n'
_SECTION = """## Faults planted in a lot (`make lot`)

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
            entries = run_fleet(load_manifest(folder / "data" / "fleet.toml"), folder / "out", jobs=_JOBS)
            found = {reason.name: reason for reason in summary_of(entries).apart}
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


def section(figures: dict[str, Any]) -> str:
    """The section of docs/results.md."""
    rows = "\n".join(
        f"| {fault.replace('_', ' ')} | {n} of {figures['draws']} |" for fault, n in figures["named"].items()
    )
    return _SECTION.format(rows=rows, units=_UNITS, gyros=3 * _UNITS, jobs=_JOBS, **figures)


def main(arguments: list[str]) -> int:
    """Status 1 where a fault was named in under seven of eight draws, or more than one healthy gyro was accused."""
    draws, seed = (int(a) for a in (*arguments[1:], *map(str, (_DRAWS, _SEED)[len(arguments) - 1 :])))
    figures = planted_lots(draws, seed)
    print(section(figures))
    if draws == _DRAWS:
        write(ROOT / arguments[0], "lot", figures, section)
    return int(min(figures["named"].values()) < 7 * draws / 8 or figures["accused"] > 1)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
