"""Build the result of a gyro, from recordings to a verified and judged table, in a folder that appears whole."""

from __future__ import annotations

import functools
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib import metadata
from pathlib import Path
from typing import Any

from .. import __version__
from ..assess.budget import budget_of
from ..assess.changes import changes_since, load_earlier
from ..assess.evaluation import Watch, evaluate
from ..assess.limits import Limits, held_against, load_limits
from ..assess.product_guards import guarded
from ..common.errors import CheckFailed, InputError
from ..common.progress import Progress, Stages, silent
from ..common.threads import with_one_thread
from ..model import Model, load_model
from ..pages.report import write_report
from ..pages.unit import UnitResults
from ..quality.judgement import Judged, judge
from ..recordings.loading import asked_axes, load
from ..recordings.records import Dataset
from ..results.cache import program_of
from ..results.diagnosed import Diagnosed
from ..results.evaluation import Changes, Evaluation
from ..results.files import sha256, write_atomically
from ..results.folder import result_folder
from ..results.json_text import json_text
from ..results.marker import MARKER
from ..results.release import HeldLimits, Verification
from ..results.training import Manifest, Training
from ..tables.emission import Emission, emit
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


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildRequest:
    """Options of `build` besides the recordings and the place of the result.

    Attributes:
        fit: Options of training, and the lot of the unit.
        axis: Axis of three-axis recordings; None makes a result for each in `out/x`, `out/y`, `out/z`, and in `out/c`
            the runtime once with all tables; "all" the same, but refuses recordings of one rate.
        numerics: Arithmetics of the tables; None: those that the limits need, else all.
        targets: Names of the targets that the code is verified on; none: those of the limits, else as `verify`.
        extend: Diagnose first, and build the extended model where it gains on runs that it was not fitted to.
        limits: A limits file that the result is compared with.
        previous: An earlier result of the same gyro, to find what changed.
        prior: An earlier result of the same gyro that is taken for what is known of it, if the recordings (those of a
            check run) do not speak against it; also the `previous` one where none is given.
    """

    fit: FitOptions = field(default_factory=FitOptions)
    axis: str | None = None
    numerics: Sequence[str] | None = None
    targets: Sequence[str] = ()
    extend: bool = False
    limits: Path | None = None
    previous: Path | None = None
    prior: Path | None = None


@dataclass(frozen=True, slots=True)
class _Order:
    """Order for the result of one axis: a request with its limits read, or that of a gyro of a fleet."""

    request: BuildRequest
    limits: Limits | None
    in_fleet: bool = False
    watch: Watch | None = None


@with_one_thread
def build(source: Path, out: Path, request: BuildRequest | None = None, *, progress: Progress = silent) -> list[Built]:
    """Make verified C and a report of recordings; return one result for each axis.

    `out` is replaced as a whole at the end; until then an older one stays as it was.

    Args:
        source: Folder of recordings.
        out: Folder of the result.
        request: Options; None: all at their defaults.
        progress: Takes note of every stage.

    Raises:
        InputError: Bad recordings or arguments, or a file in `out` that gyrotc did not write; `out` is untouched.
        CheckFailed: Every arithmetic is refused; `out` is untouched.
    """
    request = request or BuildRequest()
    chosen_targets(request.targets)
    known = applied_in(source)
    if request.extend and (request.fit.prior is not None or request.prior is not None):
        raise InputError("--extend", "with --lot or --prior: both know maps alone", "one of them")
    refuse_together(request.fit, request.prior)
    limits = load_limits(request.limits) if request.limits else None
    if limits and not request.targets:
        request = replace(request, targets=limits.needs.targets)
    order = _Order(request, limits)
    axes = asked_axes(source, request.axis)
    shares = _STAGES if request.extend else _STAGES | {"diagnosing": 0.0}
    with result_folder(out, "build", inputs=[source]) as stage:
        if len(axes) == 1 and request.axis != "all":
            say = Stages(progress, shares)
            say("reading")
            dataset = load(source, axis=axes[0], applied=known)
            stage.of(dataset.serial, dataset.axis)
            return [_build_axis(dataset, stage.folder, order, say)]
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
                built.append(_build_axis(dataset, part.folder, order, say))
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
    order = _Order(BuildRequest(fit=options, numerics=numerics), limits, in_fleet=True, watch=watch)
    return _build_axis(dataset, work, order, Stages(silent, _STAGES))


def _build_axis(dataset: Dataset, work: Path, order: _Order, say: Stages) -> Built:
    request = order.request
    options = request.fit.with_stated(dataset.fit)
    options = with_prior(options, dataset, request.prior, order.limits)
    previous = request.previous or request.prior
    earlier = load_earlier(previous, dataset.serial, dataset.axis) if previous else None
    say("judging rows")
    judged = judge(dataset)
    fitted, diagnosis = _extended(dataset, work, options, judged, say) if request.extend else (None, None)
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
    emission = _emit(fitted.model, work, order, say.within("emitting C", "emitting C: "))
    verification = verify(
        work, targets=request.targets, compiled=not order.in_fleet, progress=say.within("verifying", "verifying: ")
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


def _emit(model: Model, work: Path, order: _Order, progress: Progress) -> Emission:
    """Write the C files in the arithmetics that the job names, else those that the product needs, else all.

    Where one is refused that the product needs, all others are written: the limit is then not met, and the result says
    why.

    Raises:
        CheckFailed: An arithmetic that the job names is refused, or all are.
    """
    write = functools.partial(emit, model, work, runtime_apart=order.in_fleet, progress=progress)
    needed = order.limits.needs.arithmetics if order.limits else ()
    if order.request.numerics is not None or not needed:
        return write(numerics=order.request.numerics)
    try:
        return write(numerics=needed)
    except CheckFailed:
        return write(numerics=None)


def _manifest(folder: Path, dataset: Dataset, model: Model, refused: dict[str, str]) -> Manifest:
    """Return hashes of everything in the folder, versions and meta, for a certificate."""
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
