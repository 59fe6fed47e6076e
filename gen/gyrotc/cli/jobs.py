"""Commands that are whole jobs: `build`, `compare` and `diagnose`, with what they print."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..common.errors import CheckFailed
from .application import app
from .options import (
    AxisOption,
    DatasetArg,
    LotOption,
    NumericOption,
    OutOption,
    PriorOption,
    TargetOption,
    lot_in,
    numerics_of,
)
from .output import show, tell
from .progress import progress
from .results import built_lines, verify_table

if TYPE_CHECKING:
    from ..results.diagnosed import Diagnosed, NamedCause


def diagnosis_lines(result: Diagnosed) -> Iterator[str]:
    """Yield what the simulation gets wrong, the verdict, events with the lines that leave them out, and what is next.

    The page and the JSON have the rest: where nothing was found also the largest discrepancy, which is chance.
    """
    axis = f" {result.axis}" if result.axis else ""
    if result.discrepancy and result.verdict != "consistent":
        yield f"{result.serial}{axis} against the simulation: {result.discrepancy}"
    yield f"{result.serial}{axis}: {result.verdict.replace('_', ' ')}. {result.text}"
    if result.lot is not None:
        yield f"lot: {result.lot}"
    for event in result.events:
        yield f"event: {event.text}"
        if event.exclude:
            yield f"  {event.exclude}"
    for cause in result.causes:
        yield from _cause_lines(cause)
    if result.physical and result.extended is None:
        yield _not_shipped(result)
    yield from (f"next: {step}" for step in result.next[:1])


def _not_shipped(result: Diagnosed) -> str:
    """Return the reason why no extension is shipped."""
    reason = result.shipping.reason if result.physical and result.shipping else "no cause was named"
    return f"no extension is shipped: {reason}"


_WORTH_A_LINE = 0.01  # a probability that is 0 % in print says nothing


def _cause_lines(cause: NamedCause) -> Iterator[str]:
    likely = {name: share for name, share in (cause.probabilities or {}).items() if share >= _WORTH_A_LINE}
    odds = ", ".join(f"{name} {share:.0%}" for name, share in likely.items())
    yield f"cause: {cause.name} ({odds or cause.id})"
    if cause.repair:
        yield f"  repair, a line of dataset.toml: {cause.repair}"


@app.command()
def build(
    dataset: DatasetArg,
    out: OutOption = Path("build"),
    axis: AxisOption = None,
    numeric: NumericOption = None,
    target: TargetOption = None,
    extend: Annotated[
        bool, typer.Option("--extend", help="Diagnose first; add the named causes where they gain.")
    ] = False,
    limits: Annotated[
        Path | None,
        typer.Option(
            "--limits",
            help="Limits of the product (TOML, docs/limits.md: schema = 1, at_most.rms_over_floor = 1.1, ...): "
            "exit 1 if one is not met; default: none.",
        ),
    ] = None,
    lot: LotOption = None,
    prior: PriorOption = None,
    previous: Annotated[
        Path | None,
        typer.Option("--previous", help="An earlier result of this gyro to compare with; default: that of --prior."),
    ] = None,
) -> None:
    """The main job: check, fit, emit, verify, evaluate, report.

    Example: gyrotc build recordings --out result
    """
    from ..jobs.calibration import BuildRequest
    from ..jobs.calibration import build as run
    from ..train.fitting import FitOptions

    request = BuildRequest(
        fit=FitOptions(prior=lot_in(lot)),
        axis=axis,
        numerics=numerics_of(numeric),
        targets=target or (),
        extend=extend,
        limits=limits,
        previous=previous,
        prior=prior,
    )
    with progress() as say:
        results = run(dataset, out, request, progress=say)
    for result in results:
        if result.verification.failed:
            show(verify_table(result.verification))
        for line in built_lines(result.unit, shlex.quote(str(dataset)), shlex.quote(str(out))):
            tell(line)
    tell(f"report: {out / 'report.html'}")
    failures = [(f"axis {r.model.axis}: " if r.model.axis else "") + text for r in results for text in r.failures]
    if failures:
        raise CheckFailed("; ".join(failures))


@app.command()
def compare(
    dataset: DatasetArg,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for compare.json and compare.svg; default: print only.")
    ] = None,
    axis: AxisOption = None,
) -> None:
    """Train every method on this data, as in the paper's Table 1.

    Example: gyrotc compare recordings --out comparison
    """
    from ..jobs.applied import applied_in
    from ..jobs.comparison import compare as run
    from ..pages.comparison import comparison_picture, comparison_tables, with_published
    from ..recordings.loading import load
    from ..results.files import write_atomically
    from ..results.folder import result_folder
    from ..results.json_text import json_text

    with result_folder(out, "compare", inputs=[dataset]) if out else nullcontext() as stage, progress() as say:
        recordings = load(dataset, axis=axis, applied=applied_in(dataset))
        if stage:
            stage.of(recordings.serial, axis)
        result = with_published(run(recordings, progress=say))
        if stage:
            write_atomically(stage.folder / "compare.json", json_text(result.content()))
            write_atomically(stage.folder / "compare.svg", comparison_picture(result))
    for table in comparison_tables(result):
        show(table)


@app.command()
def diagnose(
    dataset: DatasetArg,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for pictures, report and model-extended.json; default: print only."),
    ] = None,
    axis: AxisOption = None,
    lot: LotOption = None,
) -> None:
    """Name the cause of what a static map leaves in recordings.

    The model is extended by the cause, and the gain is measured on runs that it was not fitted to.

    Example: gyrotc diagnose recordings --out diagnosis
    """
    from ..jobs.diagnosis import diagnose as run
    from ..train.fitting import FitOptions

    with progress() as say:
        results = run(dataset, out, FitOptions(prior=lot_in(lot)), axis=axis, progress=say)
    for name, result in results.items():
        for line in diagnosis_lines(result):
            tell(line)
        if out is not None:
            tell(f"report: {out / name / 'report.html'}")
