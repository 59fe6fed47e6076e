"""One serial of a fleet: read, fit, emit, check against the reference, judge; or a whole `build`."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...dataset import Dataset, load
from ...emit import emit
from ...errors import CheckFailed, GyrotcError, InputError
from ...judge.evaluate import evaluate
from ...judge.limits import held_against
from ...model import Model, load_model
from ...outputs import KINDS, result_folder, write_atomically
from ...results.evaluation import Evaluation
from ...results.limits import HeldLimits
from ...train.fitting import fit_dataset
from ...verify import verify
from ..build import build_into
from .aside import set_aside
from .entry import Entry, kept_entry, write_entry
from .fingerprint import digest_of, inputs_of, program_of
from .manifest import Fleet, Unit, printable

__all__ = ["Task", "do_unit", "done_before", "failed"]


@dataclass(frozen=True, slots=True)
class Task:
    """A unit with all that its job needs; goes to another process as it is."""

    unit: Unit
    fleet: Fleet
    out: Path
    full: bool
    program: str  # hash of the program that asks for it

    def key(self) -> str:
        """Changes with the contents of the recordings, the options, the limits and the program."""
        limits = self.fleet.limits.sha256 if self.fleet.limits else None
        options = [self.unit.axis, asdict(self.fleet.options), self.fleet.numerics, limits, self.full]
        return digest_of([self.program, options, inputs_of(self.unit.dataset)])


def done_before(task: Task) -> Entry | None:
    """The entry of an earlier call that still holds; None if the job must be done.

    It holds if inputs, options and program have the same hashes, and every file of the result still has its own.
    """
    try:
        entry = None if task.unit.refused else kept_entry(task.out, task.key())
    except OSError:
        return None
    return entry and entry | _who(task)


def do_unit(task: Task) -> Entry:
    """Does the job. Whatever goes wrong is told in the entry: it concerns this serial alone."""
    try:
        if task.unit.refused:
            raise InputError(task.unit.name, task.unit.refused)
        if task.program != program_of():
            raise CheckFailed("the gyrotc of this worker is not the one that asks")
        return _built(task)
    except GyrotcError as error:
        return failed(task, str(error))
    except OSError as error:
        return failed(task, f"{error.filename}: {error.strerror}" if error.filename else str(error))
    except Exception as error:  # a fault of the program itself must not stop the other serials either
        return failed(task, f"{type(error).__name__}: {error}")


def failed(task: Task, reason: str) -> Entry:
    """The entry of a job that came to nothing; an earlier result of the gyro stays as it was."""
    try:
        stays = "; its folder holds an earlier result" if (task.out / "model.json").exists() else ""
    except OSError:
        stays = ""
    return _who(task) | {"status": "failed", "reason": printable(reason) + stays}


def _who(task: Task) -> Entry:
    return {
        "name": task.unit.name,
        "dataset": printable(str(task.unit.dataset)),
        "axis": task.unit.axis,
    }


def _built(task: Task) -> Entry:
    """The result with its entry, in its place as a whole; of recordings that stayed the same meanwhile."""
    key = task.key()
    dataset = load(task.unit.dataset, axis=task.unit.axis)
    aside = set_aside(task.out)
    with result_folder(task.out, "fleet", kind=KINDS["build"], inputs=[task.unit.dataset]) as stage:
        stage.of(dataset.serial, dataset.axis)
        model, evaluation, verification, held = (_whole if task.full else _quick)(
            task.fleet, dataset, stage.folder
        )
        if task.key() != key:
            raise InputError(str(task.unit.dataset), "the recordings changed while they were read")
        faults = _faults(evaluation, verification, held)
        status = {"status": "failed", "reason": "; ".join(faults)} if faults else {"status": "done"}
        figures = {"serial": model.serial} | _figures(model, evaluation, verification)
        entry = write_entry(stage.folder, _who(task) | status | {"key": key} | figures)
    return entry | {"aside": aside} if aside else entry


def _faults(evaluation: Evaluation, verification: Entry, held: HeldLimits | None) -> list[str]:
    found = [f"{verification['failed']} checks failed"] if verification["failed"] else []
    if evaluation.mismatches:
        found.append(f"{evaluation.mismatches} steps differ from the reference")
    return found + [check.failure() for check in (held.limits if held else ()) if not check.met]


_Made = tuple[Model, Evaluation, Entry, "HeldLimits | None"]


def _whole(fleet: Fleet, dataset: Dataset, work: Path) -> _Made:
    result = build_into(work, dataset, fleet.options, numerics=fleet.numerics, limits=fleet.limits)
    return load_model(work), result.evaluation, result.verification, result.limits


def _quick(fleet: Fleet, dataset: Dataset, work: Path) -> _Made:
    """Without a compiler: what the C code gives is taken from the reference."""
    fitted = fit_dataset(dataset, fleet.options)
    fitted.model.save(work / "model.json")
    _write(work / "training.json", fitted.training)
    emit(fitted.model, work, numerics=fleet.numerics)
    verification = verify(work, compiled=False)
    _write(work / "verify.json", verification)
    evaluation = evaluate(
        work, dataset, average_s=fleet.options.average_s, training=fitted.training, compiled=False
    )
    _write(work / "evaluate.json", evaluation.content())
    held = held_against(fleet.limits, fitted.model, evaluation, verification) if fleet.limits else None
    if held:
        _write(work / "limits.json", held.content())
    return fitted.model, evaluation, verification, held


def _write(path: Path, result: dict[str, Any]) -> None:
    write_atomically(path, json.dumps(result, allow_nan=False) + "\n")


def _figures(model: Model, evaluation: Evaluation, verification: Entry) -> Entry:
    """What the summary shows and outliers are sought in."""
    role, judged = evaluation.judged() or (None, None)
    floor = evaluation.noise_floor_dph
    after = judged.after.rms_dph if judged else None
    return {
        "judged_on": role,
        "before_rms_dph": judged.before.rms_dph if judged else None,
        "after_rms_dph": after,
        "after_mean_dph": judged.after.mean_dph if judged else None,
        "rms_over_floor": after / floor if floor and after is not None else None,
        "noise_floor_dph": floor,
        "bias_dph": model.fallback_dph,
        "centers": model.n_centers,
        "table_bytes": evaluation.model.table_bytes,
        "sum_abs_weights_dph": evaluation.model.sum_abs_weights_dph,
        "error_bound_dph": verification["error_bound_dph"],
        "findings": [finding.id for finding in evaluation.findings],
        "model_hash": model.hash,
    }
