"""One serial of a fleet: read, fit, emit, check against the reference, judge; or a whole `build`."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .. import __version__
from ..build import build
from ..dataset import load
from ..emit import emit
from ..errors import GyrotcError
from ..evaluate import evaluate
from ..fitting import fit_dataset
from ..inputs import read_json
from ..limits import held_against
from ..model import Model, load_model
from ..outputs import result_folder, write_atomically
from ..verify import verify
from .manifest import Fleet, Unit

__all__ = ["ENTRY", "Task", "do_unit", "done_before"]

ENTRY = "entry.json"
Entry = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Task:
    """A unit with all that its job needs; goes to another process as it is."""

    unit: Unit
    fleet: Fleet
    out: Path
    full: bool

    @property
    def key(self) -> str:
        """Changes with the recordings' names, sizes and times, the options, the limits and the program."""
        files = sorted(p for p in self.unit.dataset.rglob("*") if p.is_file())
        facts = [(p.name, p.stat().st_size, p.stat().st_mtime_ns) for p in files]
        limits = self.fleet.limits.sha256 if self.fleet.limits else None
        job = [
            __version__,
            self.unit.axis,
            asdict(self.fleet.options),
            self.fleet.numerics,
            limits,
            self.full,
        ]
        return hashlib.sha256(json.dumps([job, facts]).encode()).hexdigest()


def done_before(task: Task) -> Entry | None:
    """The entry of an earlier call that still holds; None if the job must be done."""
    try:
        entry: Entry = read_json(task.out / ENTRY, "the entry of a gyro")
        return entry if entry["key"] == task.key else None
    except (GyrotcError, OSError, KeyError, TypeError):
        return None


def do_unit(task: Task) -> Entry:
    """Does the job. Whatever goes wrong is told in the entry: it concerns this serial alone."""
    name = {"name": task.unit.name, "dataset": str(task.unit.dataset), "axis": task.unit.axis}
    try:
        entry = name | _built(task)
    except GyrotcError as error:
        return name | {"status": "failed", "reason": str(error)}
    except Exception as error:  # a fault of the program itself must not stop the other serials either
        return name | {"status": "failed", "reason": f"{type(error).__name__}: {error}"}
    _add(task, ENTRY, entry)
    return entry


def _add(task: Task, name: str, content: Entry) -> None:
    """One more file of the unit's result."""
    with result_folder(task.out, "fleet", kind="", entries=(name,)) as stage:
        write_atomically(stage.folder / name, json.dumps(content, indent=1, allow_nan=False) + "\n")


def _built(task: Task) -> Entry:
    key = task.key  # of the recordings as they are before they are read
    if task.full:
        [result] = build(
            task.unit.dataset, task.out, task.fleet.options, axis=task.unit.axis, numerics=task.fleet.numerics
        )
        model, evaluation, verification = load_model(task.out), result.evaluation, result.verification
    else:
        model, evaluation, verification = _quick(task)
    faults = [f"{verification['failed']} checks failed"] if verification["failed"] else []
    if evaluation["mismatches"]:
        faults.append(f"{evaluation['mismatches']} steps differ from the reference")
    if task.fleet.limits:
        held = held_against(task.fleet.limits, model, evaluation, verification)
        _add(task, "limits.json", held)
        faults += [
            f"{c['limit']} {c['bound']} is not met: {c['measured']}" for c in held["limits"] if not c["met"]
        ]
    status = {"status": "failed", "reason": "; ".join(faults)} if faults else {"status": "done"}
    return status | {"key": key, "serial": model.serial} | _figures(model, evaluation, verification)


def _quick(task: Task) -> tuple[Model, Entry, Entry]:
    """Without a compiler: what the C code gives is taken from the reference."""
    fleet = task.fleet
    with result_folder(task.out, "build", inputs=[task.unit.dataset]) as stage:
        work = stage.folder
        dataset = load(task.unit.dataset, axis=task.unit.axis)
        fitted = fit_dataset(dataset, fleet.options)
        fitted.model.save(work / "model.json")
        write_atomically(work / "training.json", json.dumps(fitted.training, allow_nan=False) + "\n")
        emit(fitted.model, work, numerics=fleet.numerics)
        verification = verify(work, compiled=False)
        evaluation = evaluate(
            work, dataset, average_s=fleet.options.average_s, training=fitted.training, compiled=False
        )
        for name, result in (("verify", verification), ("evaluate", evaluation)):
            write_atomically(work / f"{name}.json", json.dumps(result, allow_nan=False) + "\n")
    return fitted.model, evaluation, verification


def _figures(model: Model, evaluation: Entry, verification: Entry) -> Entry:
    """What the summary shows and outliers are sought in."""
    role = next((r for r in ("exam", "left_out", "train") if evaluation.get(r)), None)
    judged = evaluation[role] if role else None
    floor = evaluation["noise_floor_dph"]
    after = judged["after"]["rms_dph"] if judged else None
    return {
        "judged_on": role,
        "before_rms_dph": judged["before"]["rms_dph"] if judged else None,
        "after_rms_dph": after,
        "after_mean_dph": judged["after"]["mean_dph"] if judged else None,
        "rms_over_floor": after / floor if floor and after is not None else None,
        "noise_floor_dph": floor,
        "bias_dph": model.fallback_dph,
        "centers": model.n_centers,
        "table_bytes": evaluation["model"]["table_bytes"],
        "sum_abs_weights_dph": evaluation["model"]["sum_abs_weights_dph"],
        "error_bound_dph": verification["error_bound_dph"],
        "findings": [finding["id"] for finding in evaluation["findings"]],
        "model_hash": model.hash,
    }
