"""Every file and output that has a JSON Schema, by the name that `gyrotc schema` knows."""

from __future__ import annotations

from pydantic import BaseModel

from ..model import Model
from ..results.diagnosed import Diagnosed, DiagnosisSeries
from ..results.evaluation import Changes, Comparison, Evaluation
from ..results.fleet import CatalogueAnswer, FleetEntry, FleetSummary
from ..results.folder import MapOnGrid, Marker
from ..results.lot import Lot
from ..results.planned import LotPlan, NextRun, Plan
from ..results.recordings import Checked, ImportedFiles, SimulatedTruth
from ..results.release import Budget, HeldLimits, Release
from ..results.training import Manifest, Training
from ..results.verification import Emitted, JointVerification, Verification
from ..tables.record import EmissionRecord

__all__ = ["KINDS"]

KINDS: dict[str, type[BaseModel]] = {
    "budget": Budget,
    "catalogue": CatalogueAnswer,
    "changes": Changes,
    "check": Checked,
    "compare": Comparison,
    "diagnose": Diagnosed,
    "diagnosis-series": DiagnosisSeries,
    "emission": EmissionRecord,
    "emit": Emitted,
    "entry": FleetEntry,
    "evaluate": Evaluation,
    "fleet": FleetSummary,
    "import": ImportedFiles,
    "limits": HeldLimits,
    "lot-plan": LotPlan,
    "lot": Lot,
    "manifest": Manifest,
    "map": MapOnGrid,
    "model": Model,
    "next-run": NextRun,
    "plan": Plan,
    "release": Release,
    "result": Marker,
    "training": Training,
    "truth": SimulatedTruth,
    "verify-axes": JointVerification,
    "verify": Verification,
}
