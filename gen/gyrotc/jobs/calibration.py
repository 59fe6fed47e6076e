"""Build the result of a gyro, from recordings to a verified and judged table, in a folder that appears whole."""

from __future__ import annotations

import functools
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any

from .. import __version__
from ..assess.budget import budget_of
from ..assess.changes import changes_since, load_earlier
from ..assess.evaluation import Watch, evaluate
from ..assess.limits import Limits, held_against, load_limits
from ..assess.product_guards import guarded
from ..common.errors import InputError
from ..common.progress import Progress, Stages, silent
from ..model import Model, load_model
from ..pages.report import write_report
from ..pages.unit import UnitResults
from ..quality.judgement import Judged, judge
from ..recordings.loading import asked_axes, load
from ..recordings.records import Dataset
from ..results.diagnosed import Diagnosed
from ..results.evaluation import Changes, Evaluation
from ..results.files import sha256, write_atomically
from ..results.folder import result_folder
from ..results.json_text import json_text
from ..results.marker import MARKER
from ..results.release import HeldLimits, Verification
from ..results.training import Manifest, Training
from ..tables.emission import emit
from ..tables.runtime import RUNTIME_FILES
from ..train.fitting import FitOptions, Fitted, fit_dataset, units_of
from ..verify.job import chosen_targets, verify
from .applied import applied_in
from .axes import join_axes
from .evaluation import TRACE_ROWS
from .recalibration import refuse_together, with_prior

_VERSIONED = ("numpy", "scipy", "pyarrow", "pydantic")


# As `gyrotc build -v` and `gyrotc build --extend -v` measure them on data of `gyrotc simulate paper`.
_STAGES = {
    "reading": 0.02,
    "judging rows": 0.35,
    "diagnosing": 0.6,
    "training": 0.03,
    "emitting C": 0.03,
    "verifying": 0.4,
    "replaying": 0.06,
    "drawing the report": 0.11,
}


@dataclass(frozen=True, slots=True)
class Built:
    """Model and results of a build.

    `refused` names the arithmetics that were refused, with the reason; with `extend` what was diagnosed, with `limits`
    and `previous` the objects of `limits.json` and `changes.json`.
    """

    model: Model
    training: Training
    evaluation: Evaluation
    verification: Verification
    refused: dict[str, str]
    diagnosis: Diagnosed | None = None
    limits: HeldLimits | None = None
    changes: Changes | None = None
    judged: Judged | None = None

    @property
    def failures(self) -> tuple[str, ...]:
        """The checks that failed, those of the limits among them; none: exit 0."""
        return self.unit.failed

    @property
    def unit(self) -> UnitResults:
        """Results of the unit, for pages and certificates of its folder."""
        return UnitResults(
            self.model,
            self.evaluation,
            self.training,
            self.verification,
            None,
            self.diagnosis,
            self.limits,
            self.changes,
            None,
        )


@dataclass(frozen=True, slots=True)
class _Order:
    """Options of a build besides those of the fit."""

    numerics: Sequence[str] | None
    extend: bool
    limits: Limits | None
    previous: Path | None
    prior: Path | None = None
    ageing_dph: float | None = None
    in_fleet: bool = False
    watch: Watch | None = None
    targets: Sequence[str] = ()


def build(
    source: Path,
    out: Path,
    options: FitOptions,
    *,
    axis: str | None = None,
    numerics: Sequence[str] | None = None,
    targets: Sequence[str] = (),
    extend: bool = False,
    limits: Path | None = None,
    previous: Path | None = None,
    prior: Path | None = None,
    ageing_dph: float | None = None,
    progress: Progress = silent,
) -> list[Built]:
    """Build verified C and a report from recordings; one result for each axis.

    `out` is replaced as a whole at the end; until then an older one stays as it was.

    Args:
        axis: Axis of three-axis recordings; None makes a result for each in `out/x`, `out/y`, `out/z`, and in `out/c`
            the runtime once with all tables; "all" the same, but refuses recordings of one rate.
        targets: Names of the targets that the code is verified on; none: those of the limits, else as `verify`.
        extend: Diagnose first, and build the extended model where it gains on runs that it was not fitted to.
        limits: A limits file that the result is held against.
        previous: An earlier result of the same gyro, to say what changed.
        prior: An earlier result of the same gyro that is taken for what is known of it, if the recordings (those of a
            check run) do not speak against it; also the `previous` one where none is given.
        ageing_dph: How far its bias may have moved since, 1 sigma, deg/h; None: as limits or dates say, else 0.
        progress: Takes note of every stage.

    Raises:
        InputError: Bad recordings or arguments, or a file in `out` that gyrotc did not write; `out` is untouched.
        CheckFailed: Every arithmetic is refused; `out` is untouched.
    """
    chosen_targets(targets)
    known = applied_in(source)
    if extend and (options.prior is not None or prior is not None):
        raise InputError("--extend", "with --lot or --prior: both know maps alone", "one of them")
    refuse_together(options, prior, ageing_dph)
    held = load_limits(limits) if limits else None
    order = _Order(numerics, extend, held, previous or prior, prior, ageing_dph)
    proven = targets or (held.needs.targets if held else ())
    order = replace(order, targets=proven)
    axes = asked_axes(source, axis)
    shares = _STAGES if extend else _STAGES | {"diagnosing": 0.0}
    with result_folder(out, "build", inputs=[source]) as stage:
        if len(axes) == 1 and axis != "all":
            say = Stages(progress, shares)
            say("reading")
            dataset = load(source, axis=axes[0], applied=known)
            stage.of(dataset.serial, dataset.axis)
            return [_build_axis(dataset, stage.folder, options, order, say)]
        built = []
        names = [str(name) for name in axes]
        of_axes = Stages(progress, dict.fromkeys(names, 1.0))
        for name in names:
            say = Stages(of_axes.within(name, f"{name}: "), shares)
            say("reading")
            dataset = load(source, axis=name, applied=known)
            stage.of(dataset.serial)
            with result_folder(stage.folder / name, "build") as part:
                part.of(dataset.serial, name)
                built.append(_build_axis(dataset, part.folder, options, order, say))
        join_axes(stage.folder, names)
        return built


def build_into(
    work: Path,
    dataset: Dataset,
    options: FitOptions,
    *,
    numerics: Sequence[str] | None = None,
    limits: Limits | None = None,
    watch: Watch | None = None,
) -> Built:
    """Do the main job for a gyro of a fleet, into a folder that is there; the caller sees that it appears whole.

    Nothing is compiled or drawn: what the C code answers is taken from the reference, which is the same bit for bit.
    The runtime is not written, as all gyros of the fleet share it.

    Args:
        watch: Called with each run and its means.

    Raises:
        CheckFailed: Every arithmetic is refused.
    """
    order = _Order(numerics, False, limits, None, in_fleet=True, watch=watch)
    return _build_axis(dataset, work, options, order, Stages(silent, _STAGES))


def _build_axis(dataset: Dataset, work: Path, options: FitOptions, order: _Order, say: Stages) -> Built:
    options = with_prior(options.with_stated(dataset.fit), dataset, order.prior, order.ageing_dph, order.limits)
    earlier = load_earlier(order.previous, dataset.serial, dataset.axis) if order.previous else None
    say("judging rows")
    judged = judge(dataset)
    fitted, diagnosis = _extended(dataset, work, options, judged, say) if order.extend else (None, None)
    fitted = fitted or fit_dataset(dataset, options, judged=judged, progress=say.within("training"))
    if order.limits:
        model = guarded(fitted.model, order.limits.guards, order.limits.file, dataset.channels)
        model = model.model_copy(
            update={
                "q31_bias_frac_bits": order.limits.q31_bias_frac_bits,
                "left_out": order.limits.needs.left_out,
            }
        )
        fitted = replace(fitted, model=model)
    _write(work / "training.json", fitted.training.content())
    emission = emit(
        fitted.model,
        work,
        numerics=order.numerics,
        runtime_apart=order.in_fleet,
        progress=say.within("emitting C", "emitting C: "),
    )
    verification = verify(
        work, targets=order.targets, compiled=not order.in_fleet, progress=say.within("verifying", "verifying: ")
    )
    _write(work / "verify.json", verification.content())
    evaluation = evaluate(
        work,
        dataset,
        average_s=options.average_s,
        trace=None if order.in_fleet else work / "trace",
        trace_rows=TRACE_ROWS,
        training=fitted.training,
        judged=judged,
        compiled=not order.in_fleet,
        progress=say.within("replaying"),
        watch=order.watch,
    )
    _write(work / "evaluate.json", evaluation.content())
    held = held_against(order.limits, fitted.model, evaluation, verification) if order.limits else None
    if held:
        _write(work / "limits.json", held.content())
    manifest = _manifest(work, dataset, fitted.model, emission.refused)
    _write(work / "manifest.json", manifest.content())
    changes = None
    if earlier:
        changes = changes_since(
            earlier, fitted.model, evaluation, manifest, training=fitted.training, dataset=dataset, limits=order.limits
        )
        _write(work / "changes.json", changes.content())
    budget = budget_of(fitted.model, fitted.training, evaluation, verification, limits=order.limits, changes=changes)
    _write(work / "budget.json", budget.content())
    if not order.in_fleet:
        say("drawing the report")
        write_report(work)
    refused = emission.refused
    return Built(fitted.model, fitted.training, evaluation, verification, refused, diagnosis, held, changes, judged)


def _extended(
    dataset: Dataset, work: Path, options: FitOptions, judged: Judged, say: Stages
) -> tuple[Fitted | None, Diagnosed]:
    """The extended model where one is shipped, and the diagnosis, which `work/diagnosis` shows."""
    from .diagnosis import diagnose_dataset

    found = diagnose_dataset(
        dataset, work / "diagnosis", options=options, judged=judged, progress=say.within("diagnosing")
    )
    extended = found.result.extended
    if extended is None or extended.model is None or found.training is None:
        return None, found.result
    return Fitted(load_model(work / "diagnosis" / extended.model), found.training), found.result


def _write(path: Path, result: dict[str, Any]) -> None:
    write_atomically(path, json_text(result))


@functools.cache
def _versions() -> dict[str, str]:
    """Return the versions of the libraries behind the figures; a fleet asks for each of its serials."""
    return {name: metadata.version(name) for name in _VERSIONED}


def _manifest(folder: Path, dataset: Dataset, model: Model, refused: dict[str, str]) -> Manifest:
    """Return hashes of everything in the folder, versions and meta, for a certificate."""
    from ..results.cache import program_of  # the package of fleets imports this module

    files = sorted(p for p in folder.rglob("*") if p.is_file() and p.name != MARKER)
    return Manifest(
        gyrotc_version=__version__,
        serial=model.serial,
        axis=model.axis,
        model_hash=model.hash,
        refused=refused,
        versions={"python": sys.version.split()[0], **_versions()},
        meta=dict(dataset.meta),
        units=units_of(dataset),
        sources=tuple(dataset.sources),
        program=program_of(),
        files={p.relative_to(folder).as_posix(): sha256(p) for p in files},
        firmware={
            p.name: p.stat().st_size
            for p in (folder / "c" / name for name in (*RUNTIME_FILES, f"gtc_{model.id}.h", f"gtc_{model.id}.c"))
            if p.is_file()
        },
    )
