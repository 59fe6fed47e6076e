"""Do one gyro of a fleet: read, fit, emit, check against the reference, judge."""

from __future__ import annotations

import itertools
import os
import socket
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from .. import __version__
from ..common.errors import GyrotcError, InputError
from ..common.inputs import checked, read_json
from ..common.metrics import Averages
from ..jobs.applied import applied_in
from ..jobs.calibration import Built, build_into
from ..quality.event_findings import found_events
from ..recordings.loading import calibration_day, input_hashes, load, stated_identity
from ..recordings.records import Dataset
from ..results.cache import program_of
from ..results.files import write_atomically
from ..results.fleet import Facts, FleetEntry
from ..results.folder import clean, result_folder
from ..results.json_text import digest_of, json_text
from ..results.marker import KINDS, read_marker, result_faults, survey_folder
from ..results.place import held, unfinished_beside
from ..tables.runtime import needs_of
from .manifest import Fleet, Unit, printable
from .outliers import gyro_facts


def move_away(place: Path) -> str:
    """A result in which somebody changed a file makes room for a new one, under a name of its own.

    Returns:
        That name; empty if there was no such result.

    Raises:
        InputError: A job is writing there.
    """
    if not place.exists():
        return ""
    with suppress(InputError):  # the marker itself is damaged
        marker = read_marker(place)
        if marker is None or not survey_folder(place, marker)[1]:
            return ""
    with held(place):
        names = (f"{place.name}.changed-{k}" for k in itertools.count(1))
        other = next(path for name in names if not (path := place.with_name(name)).exists())
        place.rename(other)
    return other.name


def clean_units(out: Path, names: Sequence[str]) -> None:
    """Remove what killed jobs left beside results in a fleet's folder, and the locks of these names."""
    for name in unfinished_beside(out, names):
        with suppress(InputError):  # a job is at work there
            clean(out / name)


ENTRY = "entry.json"


def write_entry(folder: Path, entry: FleetEntry) -> FleetEntry:
    """Write `entry.json` into a unit's result, whose marker will hold its hash, and return the entry."""
    write_atomically(folder / ENTRY, json_text(entry.content()))
    return entry


@dataclass(frozen=True, slots=True)
class Task:
    """A unit with all that its job needs; goes to another process, maybe on another machine, as it is.

    Attributes:
        unit: Its recordings by an absolute path: a worker may run in another folder.
        shown: The path as the user has typed it.
        fleet: The options; without the other units.
        out: Absolute path of the result.
        program: Hash of the program that asks for it.
        key: Hash of what it is to be made of, as the one who asks has found it; empty: that could not be read.
        version: Version of the gyrotc that asks for it.
    """

    unit: Unit
    shown: str
    fleet: Fleet
    out: Path
    program: str
    key: str = ""
    version: str = __version__

    def keyed(self) -> Task:
        """Return the task with its key."""
        try:
            return replace(self, key=self.found())
        except OSError:
            return self

    def found(self) -> str:
        """The key as it is here and now: it changes with the contents of the recordings, the options, the limits and
        the program.
        """
        limits = self.fleet.limits.sha256 if self.fleet.limits else None
        prior = self.fleet.options.prior
        plain = asdict(replace(self.fleet.options, prior=None)) | {"prior": prior.key if prior else None}
        options = [self.unit.axis, plain, self.fleet.numerics, limits]
        return digest_of([self.program, options, input_hashes(self.unit.dataset)])


def made_before(task: Task) -> FleetEntry | None:
    """The entry that an earlier call has left with its result, done or failed, if it still holds; else None.

    It holds if inputs, options and program have the same hashes (the task's key), and every file of the result still
    has its own.
    """
    if not task.key or task.unit.refused:
        return None
    try:
        entry = checked(FleetEntry, read_json(task.out / ENTRY, "the entry of a gyro"), ENTRY)
        if entry.key != task.key or entry.model_hash is None or result_faults(task.out):
            return None
    except (GyrotcError, OSError, ValueError, RecursionError):
        return None
    return entry.model_copy(update={"name": task.unit.name, "dataset": task.shown, "axis": task.unit.axis})


def do_unit(task: Task) -> FleetEntry:
    """Do the job of a unit. Whatever goes wrong is reported in the entry: it concerns this serial alone."""
    try:
        if task.unit.refused:
            raise InputError(task.unit.name, task.unit.refused)
        if task.program != program_of():
            here, there = f"{__version__} ({program_of()[:16]})", f"{task.version} ({task.program[:16]})"
            found = f"is {here}, and {there} where the fleet was started"
            raise InputError(f"the gyrotc of worker {_worker()}", found, "the same gyrotc everywhere")
        return _built(task)
    except GyrotcError as error:
        return failed(task, str(error))
    except OSError as error:
        return failed(task, f"{error.filename}: {error.strerror}" if error.filename else str(error))
    except Exception as error:  # a fault of the program itself must not stop the other serials either
        return failed(task, f"{type(error).__name__}: {error}")


def _worker() -> str:
    """Name of this process: as Dask calls it where it is a worker."""
    distributed = sys.modules.get("distributed")
    if distributed is not None:
        with suppress(ValueError):  # no worker, though Dask is there
            return str(distributed.get_worker().name)
    return f"{socket.gethostname()}, process {os.getpid()}"


def failed(task: Task, reason: str) -> FleetEntry:
    """The entry of a job that came to nothing; an earlier result of the gyro stays as it was."""
    try:
        stays = "; its folder holds an earlier result" if (task.out / "model.json").exists() else ""
    except OSError:
        stays = ""
    serial, day = stated_identity(task.unit.dataset)
    return FleetEntry(
        name=task.unit.name,
        dataset=task.shown,
        axis=task.unit.axis,
        status="failed",
        serial=serial,
        date=day,
        reason=printable(reason) + stays,
    )


def _built(task: Task) -> FleetEntry:
    """The result with its entry, in its place as a whole; of recordings that stayed the same meanwhile."""
    key = task.found()
    if task.key not in ("", key):
        found = f"is {key[:16]} on worker {_worker()}, and {task.key[:16]} where the fleet was started"
        raise InputError(f"{task.unit.dataset}: its contents", found, "the same recordings under one path everywhere")
    dataset = load(task.unit.dataset, axis=task.unit.axis, applied=applied_in(task.unit.dataset))
    moved_to = move_away(task.out)
    runs: list[tuple[str, Averages]] = []
    with result_folder(task.out, "fleet", kind=KINDS["build"], inputs=[task.unit.dataset]) as stage:
        stage.of(dataset.serial, dataset.axis)
        fleet = task.fleet
        built = build_into(
            stage.folder,
            dataset,
            fleet.options,
            numerics=fleet.numerics,
            limits=fleet.limits,
            watch=lambda run, averages: runs.append((run.file, averages)),
        )
        if task.found() != key:
            raise InputError(str(task.unit.dataset), "the recordings changed while they were read")
        entry = entry_of(task, key, dataset, built, runs)
        write_entry(stage.folder, entry)
    return entry.model_copy(update={"moved_to": moved_to}) if moved_to else entry


def entry_of(task: Task, key: str, dataset: Dataset, built: Built, runs: Sequence[tuple[str, Averages]]) -> FleetEntry:
    """Return the entry of a gyro: its figures, and the facts that it is compared by."""
    role, judged = built.evaluation.judged() or (None, None)
    floor, after = built.evaluation.noise_floor_dph, judged.after.rms_dph if judged else None
    held, known = built.limits, (built.evaluation.uncertainty or {}).get("rms_dph")
    entry = FleetEntry(
        name=task.unit.name,
        dataset=task.shown,
        axis=task.unit.axis,
        status="failed" if built.failures else "done",
        serial=dataset.serial,
        judged_on=role,
        constant_rms_dph=judged.constant.rms_dph if judged else None,
        improvement=judged.improvement if judged else None,
        after_rms_dph=after,
        after_mean_dph=judged.after.mean_dph if judged else None,
        rms_over_floor=after / floor if floor and after is not None else None,
        noise_floor_dph=floor,
        bias_dph=built.model.fallback_dph,
        centers=built.model.n_centers,
        table_bytes=built.evaluation.model.table_bytes,
        sum_abs_weights_dph=built.evaluation.model.sum_abs_weights_dph,
        error_bound_dph=built.verification.error_bound_dph,
        findings=tuple(finding.id for finding in built.evaluation.findings),
        model_hash=built.model.hash,
        verdict=built.unit.decision,
        limits_met=sum(limit.met for limit in held.limits) if held and held.limits else None,
        limits_held=len(held.limits) if held and held.limits else None,
        expanded_uncertainty_dph=known.expanded if known else None,
        date=calibration_day(dataset.meta, (run.started for run in dataset.runs)),
        rows_left_out=built.evaluation.rows_left_out,
        facts=_facts(dataset, built, runs),
        sketch="".join(f"{word:016x}" for word in dataset.sketch),
        runtime_options=needs_of(built.model),
        key=key,
    )
    return entry.model_copy(update={"reason": "; ".join(built.failures)}) if built.failures else entry


def _facts(dataset: Dataset, built: Built, runs: Sequence[tuple[str, Averages]]) -> Facts | None:
    """Return the facts that a gyro is compared by, with the events of its runs if more than noise is left."""
    facts = gyro_facts(runs)
    if not built.evaluation.structure_left:
        return facts
    named = (f for f in built.evaluation.findings if f.id == "run_outlier")
    return facts.model_copy(update={"own": (*found_events(dataset, built.judged), *named)})
