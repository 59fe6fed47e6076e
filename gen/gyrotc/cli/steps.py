"""The steps of the main job, one by one: fit, emit, verify, evaluate, report."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import date
from pathlib import Path
from typing import Annotated

import typer

from ..common.errors import CheckFailed, InputError, quoted
from .application import app
from .options import (
    AxisOption,
    DatasetArg,
    DirArg,
    NumericOption,
    OutOption,
    TargetOption,
    numerics_of,
    written_place,
)
from .output import ERR, show, tell
from .progress import progress
from .results import (
    evaluation_table,
    file_notes,
    prediction_line,
    rounding_lines,
    training_lines,
    verdict_line,
    verify_notes,
    verify_table,
)


@contextmanager
def evaluation_folders(folder: Path, trace: Path | None, recordings: Path) -> Iterator[tuple[Path, Path | None]]:
    """Provide folders for the figures and the traces; both take their places if the block ends well.

    Args:
        folder: The result folder, which gets `evaluate.json` and the decisions that follow from it.
        trace: Folder for the traces: inside it, elsewhere, or None.
        recordings: The data set; the traces are not written into it.

    Raises:
        InputError: As `result_folder`; or the traces would take the place of another part of the result.
    """
    from ..jobs.evaluation import FILES
    from ..results.folder import result_folder

    inside = _inside(folder, trace)
    entries = (*FILES.values(), *([inside.parts[0]] if inside else []))
    with ExitStack() as stack:
        stage = stack.enter_context(result_folder(folder, "evaluate", entries=entries))
        if trace is None or inside:
            yield stage.folder, stage.folder / inside if inside else None
            return
        traces = result_folder(trace, "evaluate", kind="trace", inputs=[recordings])
        yield stage.folder, stack.enter_context(traces).folder


def _inside(folder: Path, trace: Path | None) -> Path | None:
    """The folder of traces by its path in the result folder; None where it lies elsewhere."""
    from ..results.marker import MARKER

    if trace is None or folder.resolve() not in (trace.resolve(), *trace.resolve().parents):
        return None
    inside = trace.resolve().relative_to(folder.resolve())
    if not inside.parts or any((folder / inside.parts[0] / name).exists() for name in ("gtc.h", MARKER)):
        raise InputError("--trace", f"{trace} is part of the result already", str(folder / "trace"))
    return inside


@app.command()
def fit(
    dataset: DatasetArg,
    out: OutOption,
    axis: AxisOption = None,
) -> None:
    """Train a model: write DIR/model.json and DIR/training.json.

    What was made of an earlier model in DIR is removed.

    Example: gyrotc fit recordings --out result
    """
    from ..jobs.fitting import fit as run

    with progress() as say:
        fitted = run(dataset, out, axis=axis, progress=say)
    training = fitted.training
    for line in training_lines(training):
        tell(line)
    for finding in training.findings:
        tell(f"finding {finding.id}: {finding.text}")
    tell(prediction_line(training))
    tell(f"{out / 'model.json'}: {fitted.model.n_centers} centers, method {fitted.model.method}")
    advised = [finding.next for finding in training.findings if finding.next]
    place = shlex.quote(str(out))
    tell(f"next: {advised[0] if advised else f'gyrotc emit {place}/model.json --out {place}'}")


def _map_place(path: Path | None) -> Path | None:
    """Check the file of `--map` before the work begins."""
    if path is not None and path.suffix not in (".csv", ".json"):
        raise InputError("--map", quoted(path.name), "a name that ends in .csv or .json")
    return written_place(path)


@app.command()
def emit(
    model: Annotated[Path, typer.Argument(help="The model.json to emit.")],
    out: OutOption,
    numeric: NumericOption = None,
    zero_at: Annotated[
        float | None,
        typer.Option(
            "--zero-at",
            metavar="C",
            min=-200,
            max=400,
            help="Shift the bias to 0 at this temperature, C; default: no shift.",
        ),
    ] = None,
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map",
            callback=_map_place,
            help="Write the map at 61 x 25 points here, too: CSV or JSON; default: nowhere.",
        ),
    ] = None,
    board: Annotated[
        Path | None,
        typer.Option("--board", help="Write the board test, its vectors and answers here, too; default: nowhere."),
    ] = None,
) -> None:
    """Write the C files of a model into DIR/c.

    Example: gyrotc emit result/model.json --out result --map result/map.csv
    """
    from ..model import load_model
    from ..results.destination import check_contents, check_separate
    from ..results.files import write_own
    from ..results.folder import result_folder, write_result
    from ..results.json_text import json_text
    from ..tables.emission import board_test_texts
    from ..tables.emission import emit as run
    from ..tables.map_grid import csv_text, grid_of_map, map_result
    from ..tables.quantisation import rms_growth

    loaded = load_model(model)
    there = out / "model.json"
    if board is not None:  # before anything is written
        check_separate(board)
        check_contents(board, "board test", None)
        if board.resolve() in (out.resolve(), there.resolve(), (out / "c").resolve()):
            raise InputError("--board", f"{board} is part of the result already", str(out / "board"))
    with progress() as say, result_folder(out, "emit", entries=("c", "model.json")) as stage:
        stage.of(loaded.serial, loaded.axis)
        if there.is_file() and there.read_text("utf-8") != loaded.to_json():
            stage.stale()  # evaluated, verified, drawn: all of another model
        emission = run(loaded, stage.folder, numerics=numerics_of(numeric), zero_at=zero_at, progress=say)
    if map_file is not None:
        grid = grid_of_map(loaded if zero_at is None else loaded.zeroed_at(zero_at))
        text = csv_text(grid) if map_file.suffix == ".csv" else json_text(map_result(grid).content())
        write_result(map_file, text)
        tell(f"{map_file}: {grid.summary}")
    if board is not None:
        with result_folder(board, "emit", kind="board test") as stage:
            stage.of(loaded.serial, loaded.axis)
            for name, data in board_test_texts(loaded, emission).items():
                write_own(stage.folder / name, data)
        tell(f"{board}: board_test.c, its vectors and its answers, to compile with the files of {out / 'c'}")
    for name, reason in emission.refused.items():
        ERR.print(f"{name} left out: {reason}", highlight=False, soft_wrap=True)
    for line in rounding_lines({t.numeric: rms_growth(loaded, t) for t in emission.tables.values()}):
        tell(line)
    tell(f"{out / 'c'}: tables gtc_{loaded.id} in {', '.join(emission.tables)}")


@app.command()
def verify(
    folder: DirArg,
    target: TargetOption = None,
    log: Annotated[
        Path | None,
        typer.Option("--log", help="Output of board_test.c on hardware: checked and entered; default: none."),
    ] = None,
    exhaustive: Annotated[
        bool,
        typer.Option(
            "--exhaustive", help="Visit every input of the fixed-point table, which takes minutes; default: a sample."
        ),
    ] = False,
) -> None:
    """Test whether DIR/c is what gyrotc makes of DIR/model.json.

    Every file is made again and compared byte for byte, then compiled for each target and run, every bit compared with
    the reference. main.c is an example that may be edited.

    Example: gyrotc verify result --target all
    """
    from ..common.progress import Stages
    from ..jobs.axes import axes_in, verify_axes
    from ..model import load_model
    from ..results.base import read_optional
    from ..results.files import write_atomically
    from ..results.folder import result_folder
    from ..results.json_text import json_text
    from ..results.marker import check_intact
    from ..results.release import Budget, JointVerification, Verification
    from ..verify.job import verify as run

    axes = axes_in(folder)
    if axes and log is not None:
        raise InputError("--log", f"{folder} has three axes", f"the folder of one, e.g. {folder / axes[0]}")
    parts = [folder / axis for axis in axes] or [folder]
    results = {}
    with progress() as say:
        of_parts = Stages(say, dict.fromkeys((part.name for part in parts), 1.0))
        for part in parts:
            axis = load_model(part / "model.json").axis
            with result_folder(part, "verify", entries=("verify.json",)) as stage:
                results[str(axis)] = run(
                    part,
                    targets=target or (),
                    log=log,
                    exhaustive=exhaustive,
                    progress=of_parts.within(part.name, f"{part.name}: " if axes else ""),
                )
                write_atomically(stage.folder / "verify.json", json_text(results[str(axis)].content()))
    result: Verification | JointVerification = next(iter(results.values()))
    if axes:
        with result_folder(folder, "verify", entries=("verify.json",)) as stage:
            result = verify_axes(folder, results)
            write_atomically(stage.folder / "verify.json", json_text(result.content()))
    for one in results.values():
        show(verify_table(one))
        for line in verify_notes(one):
            tell(line)
    for line in file_notes(result) if axes else ():
        tell(line)
    if result.failed:
        n_targets = sum(len(one.targets) for one in results.values())
        raise CheckFailed(f"{result.failed} checks failed; {n_targets} targets")
    for part in parts:
        check_intact(part, ("budget.json",), needed=False)
        budget = read_optional(part / "budget.json", Budget)
        if budget is not None and budget.expired(date.today()):
            raise CheckFailed(f"{part}: the calibration was valid until {budget.valid_until}; calibrate again")


@app.command()
def evaluate(
    folder: DirArg,
    dataset: DatasetArg,
    trace: Annotated[
        Path | None,
        typer.Option(
            "--trace",
            help="Folder for one CSV per run, every row; default: only the traces of the page, where DIR has them.",
        ),
    ] = None,
) -> None:
    """Replay recordings through the compiled C code and measure.

    Every step is compared with the reference. The limits of the result are compared with the new figures.

    Example: gyrotc evaluate result recordings --trace result/trace
    """
    from ..jobs.applied import applied_in
    from ..jobs.evaluation import TRACE_ROWS, evaluate_again
    from ..model import load_model
    from ..pages.unit import unit_in
    from ..recordings.loading import load

    axis = load_model(folder / "model.json").axis
    recordings = load(dataset, axis=axis, applied=applied_in(dataset), exam_only=True)
    rows = None
    if trace is None and (folder / "trace").is_dir():  # what the page is drawn from
        trace, rows = folder / "trace", TRACE_ROWS
    with evaluation_folders(folder, trace, dataset) as (stage, traces), progress() as say:
        result = evaluate_again(folder, recordings, stage, trace=traces, trace_rows=rows, progress=say)
    show(evaluation_table(result))
    unit = unit_in(folder)
    if unit.limits is not None:
        tell(verdict_line(unit))
    if (folder / "report.html").is_file():
        again = f"gyrotc report {shlex.quote(str(folder))}"
        tell(f"{folder / 'report.html'} shows the figures of before: {again} draws it again")
    if unit.failed:
        raise CheckFailed("; ".join(unit.failed))


@app.command()
def report(folder: DirArg) -> None:
    """Draw DIR/report.html from the results in DIR.

    DIR is what build or diagnose wrote, or the folder of a gyro of a fleet. Results that were changed, or that do not
    follow from one another, are refused.

    Example: gyrotc report result
    """
    from ..jobs.axes import axes_in, refuse_parts_of_two
    from ..jobs.certification import unit_of
    from ..pages.diagnosis import is_diagnosis, write_diagnosis_page
    from ..pages.report import axes_page, write_page, write_report

    with progress() as say:
        say("drawing")
        if is_diagnosis(folder):
            path = write_diagnosis_page(folder)
        elif axes := axes_in(folder):
            refuse_parts_of_two(folder, {axis: unit_of(folder / axis).model for axis in axes})
            path = write_page(folder, axes_page(folder, axes))
        else:
            unit_of(folder)
            path = write_report(folder)
    tell(f"report: {path}")
