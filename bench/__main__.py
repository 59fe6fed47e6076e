"""`python -m bench docs [--only PART]`: figures into docs/results/summary.json, sections of docs/results.md."""

from __future__ import annotations

import argparse
import platform
import sys
from importlib.metadata import version
from pathlib import Path

from results import machine, recorded, write

_PACKAGES = ("gyrotc", "numpy", "scipy", "scikit-learn", "fastcan", "sysidentpy", "minisom")


def _machine() -> str:
    return f"{machine()}, Python {platform.python_version()}"


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _training(docs: Path) -> None:
    """Training beside its peers, which the environment of `make bench` has."""
    from .accuracy import accuracy, invariance
    from .page import section
    from .speed import speed

    result = {
        "schema": "gyrotc.bench/1",
        "machine": _machine(),
        "versions": {name: version(name) for name in _PACKAGES},
        "speed": speed(_say),
        "accuracy": accuracy(_say),
        "invariance": invariance(_say),
    }
    write(docs, "bench", result, section)


def _raw(docs: Path) -> None:
    """The job on raw recordings alone, which has no peer; the other figures of training stay."""
    from .page import section
    from .speed import raw

    result = recorded(docs, "bench")
    result["speed"]["raw"] = raw(_say)
    write(docs, "bench", result, section)


def _runtime(docs: Path) -> None:
    """The C runtime, in emulators."""
    from .runtime import runtime, section

    write(docs, "runtime", runtime(_say), section)


def _sigma(docs: Path) -> None:
    """Whether the uncertainty of corrections holds, on simulated gyros."""
    from .sigma import cost, coverage, section

    write(docs, "sigma", {"cost": cost(), **coverage(_say)}, section)


def _faults(docs: Path) -> None:
    """What the runtime says of itself when something fails."""
    from .faults import faults, section

    write(docs, "faults", faults(_say), section)


def _sizes(docs: Path) -> None:
    """Flash and RAM of whole programs."""
    from .sizes import section, sizes

    write(docs, "sizes", sizes(), section)


def _costs(docs: Path) -> None:
    """What each option of the runtime costs, for `gtc_config.h`."""
    from .costs import write as write_costs

    write_costs()


def _fleet(docs: Path) -> None:
    """A thousand gyros through `gyrotc fleet`."""
    from .fleet import write_fleet

    write_fleet(docs)


def _lot(docs: Path) -> None:
    """Faults planted in lots of 60 gyros."""
    from .fleet import write_lot

    write_lot(docs)


def _lot_speed(docs: Path) -> None:
    """Learning from 50 to 400 units."""
    from .lot_learning import write_speed

    write_speed(docs)


def _lot_unrelated(docs: Path) -> None:
    """What a run of 2.5 h can show of a foreign unit in a lot."""
    from .lot_learning import write_unrelated

    write_unrelated(docs)


def _planted(docs: Path) -> None:
    """Faults planted among 300 healthy gyros."""
    from .planted import write_planted

    write_planted(docs, _say)


def _recalibration(docs: Path) -> None:
    """Units that come back, changed in five ways or not at all."""
    from .recalibration import write_recalibration

    write_recalibration(docs, _say)


def _growth(docs: Path) -> None:
    """How the cost of commands grows with rows, runs, centers and units."""
    from .growth import growth, section

    write(docs, "growth", growth(_say), section)


def _formats(docs: Path) -> None:
    """From a file of ten formats to the report."""
    from .formats import formats, section

    write(docs, "formats", formats(_say), section)


def _splits(docs: Path, sets: Path) -> None:
    """Measured gyros with parts of their history left out."""
    from .splits import write_splits

    write_splits(docs, sets, _say)


_PARTS = {"training": _training, "runtime": _runtime, "growth": _growth}
_ALONE = {
    "raw": _raw,
    "sigma": _sigma,
    "faults": _faults,
    "sizes": _sizes,
    "costs": _costs,
    "fleet": _fleet,
    "formats": _formats,
    "lot": _lot,
    "lot-speed": _lot_speed,
    "planted": _planted,
    "recalibration": _recalibration,
    "lot-unrelated": _lot_unrelated,
}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m bench")
    parser.add_argument("docs", type=Path)
    parser.add_argument("--only", choices=[*_PARTS, *_ALONE, "splits"])
    parser.add_argument("--sets", type=Path, help="for splits: a folder with a folder for each measured set")
    chosen = parser.parse_args()
    if chosen.only == "splits":
        if chosen.sets is None or not chosen.sets.is_dir():
            parser.error("--only splits needs --sets FOLDER, a folder with a folder for each measured set")
        _splits(chosen.docs, chosen.sets)
        return
    parts = _PARTS if chosen.only is None else {chosen.only: (_PARTS | _ALONE)[chosen.only]}
    for part in parts.values():
        part(chosen.docs)
    print(chosen.docs / "results" / "summary.json")


if __name__ == "__main__":
    main()
