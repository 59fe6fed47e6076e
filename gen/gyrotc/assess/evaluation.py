"""Replay recordings through the compiled C code, compare every step with the reference, measure.

Needs `DIR/model.json` and `DIR/c/` and a data set; `truth.json` beside simulated recordings gives the
noise that was really added. Writes traces (docs/FORMAT.md, section 4) where asked: rows of a
run, or means of several, with their corrections.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from .. import __version__
from ..common.arrays import FloatArray
from ..common.errors import CheckFailed, GyrotcError, InputError
from ..common.metrics import Averager, Averages, statistics_of, time_statistics
from ..common.progress import Progress, silent
from ..common.texts import file_stem
from ..mirror.history import Replay
from ..mirror.table import Table, Words
from ..model import Model, load_model
from ..quality.event_findings import row_count
from ..quality.findings import RunFacts, run_facts
from ..quality.inspection import findings_of_run
from ..quality.judgement import Judged, judge
from ..quality.thermometers import late_findings
from ..recordings.description import FILE
from ..recordings.records import Dataset, Rows, Run
from ..results.base import Finding, read_optional
from ..results.evaluation import (
    EvaluatedRun,
    Evaluation,
    FigureUncertainty,
    ModelSizes,
    Pooled,
    ResidualTest,
    RunStatistics,
    Statistics,
)
from ..results.files import create
from ..results.rows import RowsCount
from ..results.training import Training
from ..simulate.truth import simulated_floor
from ..tables.emission import emitted_tables
from ..verify.replay import replay_case_of, replay_on, replay_program
from ..verify.sizes import Footprint, footprint
from ..verify.toolchain import Target, all_targets
from .budget import figure_uncertainties, root_mean, squares_in_all, squares_of
from .findings import beyond_noise, coarse_arithmetic, findings_of, residual_test
from .requirements import requirements_of

__all__ = ["AnsweredRows", "Watch", "evaluate"]

Watch = Callable[[Run, Averages], None]
_HOST = "host-gcc-O2"


@dataclass(frozen=True, slots=True)
class AnsweredRows:
    """Some rows of a run replayed.

    Which rows of the file; correction in force (deg/h), status bits, whether the row is judged (its block is valid, and
    a correction has been made), number of differing steps (None: not compared), 1 sigma of the correction (deg/h; None:
    none is stated).
    """

    rows: slice
    bias_dph: NDArray[np.float64]
    status: NDArray[np.int32]
    scored: NDArray[np.bool_]
    mismatches: int | None
    sigma_dph: NDArray[np.float64] | None


@dataclass(frozen=True, slots=True)
class _Part:
    """A run, its averaged samples, the steps that differ from the reference, plain facts, squares of its 1 sigma.

    `robust`: The samples of usable rows alone. `rows`: Count of rows, used and left out.
    """

    run: Run
    averages: Averages
    mismatches: int | None
    facts: RunFacts
    findings: tuple[Finding, ...]
    squares: tuple[float, int]
    robust: Averages
    rows: RowsCount


def evaluate(
    folder: Path,
    dataset: Dataset,
    *,
    average_s: float | None = None,
    trace: Path | None = None,
    trace_rows: int | None = None,
    training: Training | None = None,
    judged: Judged | None = None,
    compiled: bool = True,
    progress: Progress = silent,
    watch: Watch | None = None,
) -> Evaluation:
    """Evaluate `folder` (model and C) on a data set; return the content of `evaluate.json`.

    The first table that was emitted is executed.

    Args:
        average_s: Averaging of all RMS figures; default the model's.
        trace: Folder for one CSV per run.
        trace_rows: Most rows of it: a longer run's are means of as few rows as that takes; None: every row.
        training: What `training.json` says; default that of `folder`. Its figures of spans left out count only if
            the model was made from these recordings and there is no test run.
        judged: Judgement of the rows of the runs; None: they are judged here.
        compiled: False: what the reference says that the C code does; `mismatches` and sizes are null.
        progress: Takes note of every run.
        watch: Called with each run and its means.

    Raises:
        InputError: No emitted code of the model, recordings of another gyro, or the data lack a channel it needs.
        CheckFailed: The C code does not compile, or is not gyrotc's.
    """
    model = load_model(folder / "model.json")
    refuse_another_gyro(folder, model, dataset)
    tables = emitted_tables(folder / "c", model)
    table = next(iter(tables.values()))
    window = average_s or model.average_s
    judged = judged or judge(dataset)
    parts = []
    compiling = _program(folder / "c", model, table) if compiled else nullcontext()
    with compiling as program:
        for k, run in enumerate(dataset.runs):
            progress(f"replaying {run.file}", k, len(dataset.runs))
            parts.append(
                _one_run(
                    run,
                    model,
                    table,
                    program,
                    judged,
                    average_s=window,
                    trace=trace,
                    trace_rows=trace_rows,
                    all_runs=dataset.runs,
                )
            )
            if watch:
                watch(run, parts[-1].averages)
    sizes = footprint(folder / "c", model, table) if compiled else None
    result = _result(model, dataset, table, parts, sizes, average_s=window)
    known = training or read_optional(folder / "training.json", Training)
    of_these = training or (known if _is_trained_on(model, dataset) else None)
    if result.exam is None and of_these:
        result = result.model_copy(update={"left_out": of_these.left_out})
    result = _with_what_is_known(result, parts, known)
    of_runs = [found for p in parts for found in p.findings]
    found = [*coarse_arithmetic(model, table)]
    found += findings_of(dataset, [p.facts for p in parts], of_runs, model, result.content(), of_these)
    found += [*beyond_noise(result), *late_findings([(p.run, p.averages) for p in parts])]
    return result.model_copy(update={"findings": tuple(found)})


def refuse_another_gyro(folder: Path, model: Model, dataset: Dataset) -> None:
    """Refuse recordings of another gyro, or of another axis, than the model in `folder`.

    Raises:
        InputError: They are; the message says what to do if the recordings have only the wrong name.
    """
    if (model.serial, model.axis) == (dataset.serial, dataset.axis):
        return
    remedy = f"recordings of {name_of(model.serial, model.axis)}"
    if model.serial != dataset.serial:
        remedy += f'; if they are of this gyro, write serial = "{model.serial}" into {dataset.folder / FILE}'
    raise InputError(
        str(dataset.folder),
        f"holds {name_of(dataset.serial, dataset.axis)}, and the table in {folder} is of "
        f"{name_of(model.serial, model.axis)}",
        remedy,
    )


def name_of(serial: str, axis: str | None) -> str:
    """Return the name of a gyro, or of one of its axes, for messages."""
    return f"gyro {serial}" + (f", axis {axis}" if axis else "")


def _with_what_is_known(result: Evaluation, parts: Sequence[_Part], training: Training | None) -> Evaluation:
    """The result with what training says of it, and with uncertainties."""
    rows = training.rows if training else None
    role = "exam" if result.exam else "train"
    update = {
        "generalises": training.generalises if training else None,
        "rows_left_out": rows.bad if rows else None,
        "uncertainty": _uncertainties(result, parts),
        "residual": _residual_test(result, parts),
        "sigma_rms_dph": root_mean(p.squares for p in parts if p.run.role == role),
    }
    return result.model_copy(update=update)


def _uncertainties(result: Evaluation, parts: Sequence[_Part]) -> dict[str, FigureUncertainty] | None:
    """Return the uncertainty of the judged figures; for spans left out, from the scatter of training."""
    role = "exam" if result.exam else "train"
    own = [(p.averages, run) for p, run in zip(parts, result.runs, strict=True) if run.role == role]
    scale = 1.0
    if result.exam is None and result.left_out and result.train:
        left_out, train = result.left_out.after.rms_dph, result.train.after.rms_dph
        scale = left_out / train if left_out and train else 1.0
    floor = None
    if result.noise_floor_dph:
        samples = max(result.train.samples, 1) if result.train else 1
        floor = (result.noise_floor_dph, None if result.noise_floor_source == "simulated" else samples)
    found = figure_uncertainties(
        [a for a, _ in own],
        [run for _, run in own],
        result.average_s,
        constant_dph=result.constant_dph,
        scale=scale,
        floor=floor,
    )
    return found or None


def _residual_test(result: Evaluation, parts: Sequence[_Part]) -> ResidualTest | None:
    """Test the residual without spikes and bursts, which findings name; what was left out in turn has none of them."""
    judged = result.judged()
    if judged is None:
        return None
    figures: Statistics = judged[1].after
    if judged[0] != "left_out" and result.usable is not None:
        figures = result.usable
    known = result.noise_floor_source == "simulated"
    trained = [p for p in parts if p.run.role == "train" and not known]
    role = "exam" if result.exam else "train"
    return residual_test(
        [p.robust.after_dph for p in parts if p.run.role == role],
        figures.rms_dph,
        result.noise_floor_dph,
        [p.averages.after_dph.size for p in trained] if result.exam or known else None,
    )


def _is_trained_on(model: Model, dataset: Dataset) -> bool:
    """Test whether a model was made from these recordings."""
    known = {(d.file, d.sha256) for d in model.data}
    return all((run.file, run.sha256) in known for run in dataset.runs)


@contextmanager
def _program(c_folder: Path, model: Model, table: Table) -> Iterator[tuple[Target, Path]]:
    """The replay program of a table, compiled for the host."""
    target = all_targets()[_HOST]
    if target.missing():
        raise GyrotcError(f"no C compiler: install {target.package}")
    with replay_program(c_folder, model, table, target) as program:
        yield target, program


def replay_run(
    rows: Rows, run: Run, model: Model, table: Table, program: tuple[Target, Path] | None
) -> Iterator[AnsweredRows]:
    """Feed rows of a file, part by part, to the compiled code and to the reference, and compare every step."""
    history = replay_case_of(rows, run, model, table)
    if program is None:
        for part in history.parts():
            known = history.reference.rows(part)
            yield _replayed(part, known, known.bits, known.status, None, table)
        return
    try:
        for replayed in replay_on(*program, history):
            yield _replayed(
                replayed.rows, replayed.reference, replayed.bits, replayed.status, replayed.wrong.size, table
            )
    except CheckFailed as error:
        raise CheckFailed(f"{run.file}: {error}") from error


def _replayed(
    rows: slice, known: Replay, bits: Words, status: NDArray[np.int32], wrong: int | None, table: Table
) -> AnsweredRows:
    sigma = None if known.sigma is None else table.decode_bias(known.sigma)
    return AnsweredRows(rows, table.decode_bias(bits), status, known.block_valid & known.begun, wrong, sigma)


def _one_run(
    run: Run,
    model: Model,
    table: Table,
    program: tuple[Target, Path] | None,
    judged: Judged,
    *,
    average_s: float,
    trace: Path | None,
    trace_rows: int | None,
    all_runs: Sequence[Run],
) -> _Part:
    whole = run.rows()
    first = run.first_powered(whole.time_s)
    rows = whole.from_row(first)
    inside = run.in_span(rows.time_s)
    times = rows.time_s if inside.all() else rows.time_s[inside]
    averager = Averager(times, average_s)
    judgement, usable = judged.of(run), judged.usable(run, whole)[first:]
    count = row_count(judgement)
    robust = Averager(times, average_s) if count.bad else averager
    each = -(-int(np.count_nonzero(inside)) // trace_rows) if trace_rows else 1
    squares: list[tuple[float, int]] = []
    wrong: int | None = None
    path = trace / trace_name(run, all_runs) if trace is not None else None
    with trace_at(path, each) if path else nullcontext() as written:
        for part in replay_run(rows, run, model, table, program):
            span = inside[part.rows]
            time, temperature, rate = (
                column[part.rows][span] for column in (rows.time_s, rows.temperature_c, rows.rate_dph)
            )
            bias, status, scored = part.bias_dph[span], part.status[span], part.scored[span]
            averager.add(time, temperature, rate, rate - bias, scored)
            if robust is not averager:
                robust.add(time, temperature, rate, rate - bias, (part.scored & usable[part.rows])[span])
            if written:
                written((time, temperature, rate, bias), status)
            plain = (status == 0) & scored
            squares.append(squares_of(None if part.sigma_dph is None else part.sigma_dph[span][plain]))
            wrong = None if part.mismatches is None else (wrong or 0) + part.mismatches
    facts, together = run_facts(run, whole), squares_in_all(squares)
    found = tuple(findings_of_run(judgement, facts))
    return _Part(run, averager.averages(), wrong, facts, found, together, robust.averages(), count)


def _of_usable(parts: Sequence[_Part]) -> Statistics | None:
    """Return the figures of the usable rows of several runs; None where all rows are usable."""
    if not any(part.rows.bad for part in parts):
        return None
    return Statistics(**statistics_of(np.concatenate([part.robust.after_dph for part in parts])))


def _run_statistics(a: Averages, average_s: float) -> RunStatistics:
    return RunStatistics(**statistics_of(a.after_dph), **time_statistics(a, average_s))


def _evaluated(part: _Part, average_s: float, constant_dph: float) -> EvaluatedRun:
    run, a = part.run, part.averages
    entry = EvaluatedRun(
        file=run.file,
        role=run.role,
        environment=run.environment,
        samples=int(a.after_dph.size),
        before=Statistics(**statistics_of(a.before_dph)),
        constant=_run_statistics(replace(a, after_dph=a.before_dph - constant_dph), average_s),
        after=_run_statistics(a, average_s),
        rows=part.rows,
    )
    if part.rows.bad:
        entry = entry.model_copy(update={"usable": _of_usable([part])})
    if run.from_s is None and run.to_s is None:
        return entry
    return entry.model_copy(update={"from_s": run.from_s, "to_s": run.to_s})


def _result(
    model: Model, dataset: Dataset, table: Table, parts: list[_Part], sizes: Footprint | None, *, average_s: float
) -> Evaluation:
    tests = [p for p in parts if p.run.role == "exam"]
    exam = [p.averages for p in tests]
    train = [p.averages for p in parts if p.run.role == "train"]
    floor = simulated_floor(dataset.folder, [p.run.file for p in parts if p.run.role == "exam"], average_s)
    source = "simulated" if floor is not None else model.noise_floor_source
    compared = [p.mismatches for p in parts if p.mismatches is not None]
    constant_dph = model.fallback_dph
    return Evaluation(
        gyrotc_version=__version__,
        serial=model.serial,
        axis=model.axis,
        numeric=table.numeric,
        block_s=model.block_s,
        average_s=average_s,
        noise_floor_dph=floor if floor is not None else model.noise_floor_dph,
        noise_floor_source=source,
        constant_dph=constant_dph,
        requirements=requirements_of(
            model,
            [p.run for p in parts],
            [p.facts for p in parts],
            [p.robust for p in tests],
            [p.rows for p in tests],
        ),
        mismatches=sum(compared) if len(compared) == len(parts) else None,
        runs=tuple(_evaluated(p, average_s, constant_dph) for p in parts),
        train=Pooled.of(train, constant_dph) if train else None,
        exam=Pooled.of(exam, constant_dph) if exam else None,
        usable=_of_usable([p for p in parts if p.run.role == ("exam" if exam else "train")]),
        findings=(),
        model=ModelSizes(
            method=model.method,
            centers=model.n_centers,
            table_bytes=table.table_bytes,
            rom_bytes=sizes.rom_bytes if sizes else None,
            ram_bytes=sizes.ram_bytes if sizes else None,
            stack_bytes=sizes.stack_bytes if sizes else None,
            sizes_on=sizes.target if sizes else None,
            sum_abs_weights_dph=model.sum_abs_weights_dph,
        ),
    )


_COLUMNS = ("time_s", "temperature_c", "rate_dph", "bias_dph", "compensated_dph", "status")


def trace_name(run: Run, all_runs: Sequence[Run]) -> str:
    """Name of a run's trace: the file's stem, its start where runs share a file, its folders where stems collide."""
    stem = Path(run.file).stem
    if any(Path(r.file).stem == stem and r.file != run.file for r in all_runs):
        stem = run.file.replace("/", "_")
    shared = sum(r.file == run.file for r in all_runs) > 1
    return file_stem(stem) + (f"@{run.from_s or 0.0:g}" if shared else "") + ".csv"


@contextmanager
def trace_at(path: Path, each: int) -> Iterator[Callable[[Sequence[FloatArray], NDArray[np.int32]], None]]:
    """A trace of means of every `each` rows of a span, which is written as its rows come; there when the block ends."""
    path.parent.mkdir(parents=True, exist_ok=True)
    options = pacsv.WriteOptions(include_header=False, quoting_style="none")
    part = path.with_name(f".{path.name}.part")
    waiting: list[NDArray[Any]] = []

    def write(columns: Sequence[NDArray[Any]]) -> None:
        if not columns[0].size:
            return
        time, temperature, rate, bias = _means(list(columns[:4]), each)
        bits = np.bitwise_or.reduceat(columns[4], np.arange(0, columns[4].size, each))
        written = [_arrow(values) for values in (time, temperature, rate, bias, rate - bias, bits)]
        pacsv.write_csv(pa.Table.from_arrays(written, _COLUMNS), stream, options)

    def take(columns: Sequence[FloatArray], status: NDArray[np.int32]) -> None:
        nonlocal waiting
        new: list[NDArray[Any]] = [*columns, status]
        whole = [np.concatenate(pair) for pair in zip(waiting, new, strict=True)] if waiting else new
        end = whole[0].size // each * each
        write([values[:end] for values in whole])
        waiting = [values[end:] for values in whole]

    with create(part) as stream:
        stream.write((",".join(_COLUMNS) + "\n").encode("ascii"))
        yield take
        if waiting:
            write(waiting)
    part.replace(path)


def _arrow(values: NDArray[Any]) -> pa.Array:
    """Return numbers as an Arrow array; `pa.array` would load pandas if that is installed."""
    buffer = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, buffer])


def _means(columns: list[FloatArray], each: int) -> list[FloatArray]:
    """Return means of every `each` rows of columns, of the rows in which the third is known if there are any."""
    if each == 1:
        return columns
    starts = np.arange(0, columns[0].size, each)
    known = np.isfinite(columns[2])
    used = known | np.repeat(np.add.reduceat(known, starts, dtype=np.int64) == 0, each)[: known.size]
    count = np.add.reduceat(used, starts, dtype=np.int64)
    return [np.add.reduceat(np.where(used, values, 0.0), starts) / count for values in columns]
