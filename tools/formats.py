"""Writes what is made from the classes of results: the JSON Schemas of the package, and the tables of docs/FORMAT.md.

`make formats` runs it; tests/py/test_result_forms.py holds what is there against the classes. With `--check` nothing is
written, and the exit status is 1 where something differs.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from gyrotc.model import Model
from gyrotc.results.base import Part
from gyrotc.results.describe import schema_text, tables
from gyrotc.results.diagnosed import Diagnosed
from gyrotc.results.evaluation import Changes, Comparison, Evaluation
from gyrotc.results.fleet import CatalogueAnswer, FleetEntry, FleetSummary
from gyrotc.results.folder import MapOnGrid, Marker
from gyrotc.results.lot import Lot
from gyrotc.results.planned import LotPlan, NextRun, Plan
from gyrotc.results.recordings import Checked, ImportedFiles, SimulatedTruth
from gyrotc.results.release import Budget, HeldLimits, Release
from gyrotc.results.training import Manifest, Training
from gyrotc.results.verification import Emitted, JointVerification, Verification
from gyrotc.tables.record import EmissionRecord
from pydantic import BaseModel

ROOT = Path(__file__).resolve().parents[1]
FORMAT = ROOT / "docs" / "FORMAT.md"
SCHEMAS = ROOT / "gen" / "gyrotc" / "results" / "schemas"

RESULTS: dict[str, type[Part]] = {
    "budget": Budget,
    "catalogue": CatalogueAnswer,
    "changes": Changes,
    "check": Checked,
    "compare": Comparison,
    "diagnose": Diagnosed,
    "emission": EmissionRecord,
    "emit": Emitted,
    "entry": FleetEntry,
    "evaluate": Evaluation,
    "fleet": FleetSummary,
    "import": ImportedFiles,
    "limits": HeldLimits,
    "lot": Lot,
    "lot-plan": LotPlan,
    "manifest": Manifest,
    "map": MapOnGrid,
    "next-run": NextRun,
    "plan": Plan,
    "release": Release,
    "result": Marker,
    "training": Training,
    "truth": SimulatedTruth,
    "verify": Verification,
    "verify-axes": JointVerification,
}
"""Results whose tables stand in docs/FORMAT.md."""

TOLD_ABOVE: dict[str, tuple[type[Part], ...]] = {
    "next-run": (LotPlan,),
    "release": (HeldLimits,),
    "entry": (FleetSummary,),
    "verify-axes": (Verification,),
}
"""Results whose objects are those of a result above them."""

KINDS: dict[str, type[BaseModel]] = {**RESULTS, "model": Model}
"""All that has a schema."""


def made() -> dict[Path, str]:
    """Every file that is made, with its text."""
    found = {SCHEMAS / f"{name}.json": schema_text(kind) for name, kind in KINDS.items()}
    text = FORMAT.read_text("utf-8")
    for name, kind in RESULTS.items():
        table = tables(kind, TOLD_ABOVE.get(name, ()))
        block = f"<!-- fields of {name}: made by `make formats` -->\n\n{table}\n<!-- end of {name} -->"
        pattern = re.compile(rf"<!-- fields of {name}:.*?<!-- end of {name} -->", re.DOTALL)
        if not pattern.search(text):
            raise SystemExit(f"{FORMAT} has no place for the fields of {name}")
        text = pattern.sub(lambda _, block=block: block, text)
    return found | {FORMAT: text}


def differing() -> list[Path]:
    """Files that are not what the classes give; also schemas of no class."""
    wrong = [path for path, text in made().items() if not path.is_file() or path.read_text("utf-8") != text]
    return wrong + [path for path in SCHEMAS.glob("*.json") if path.stem not in KINDS]


def main() -> int:
    if "--check" in sys.argv:
        return 1 if differing() else 0
    SCHEMAS.mkdir(exist_ok=True)
    for path, text in made().items():
        path.write_text(text, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
