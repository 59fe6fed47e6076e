"""The command `gyrotc`: one subcommand for each stage. The only module that prints or exits."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table as RichTable

from . import __version__
from .errors import CheckFailed, GyrotcError
from .model import write_atomically

if TYPE_CHECKING:
    from .build import Built

app = typer.Typer(
    name="gyrotc",
    help="From thermal-chamber recordings of a gyro to verified C tables that compensate its bias.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
_OUT = Console(width=None if sys.stdout.isatty() else 120)
_ERR = Console(stderr=True)

DatasetArg = Annotated[Path, typer.Argument(help="Folder of recordings, with or without dataset.toml.")]
OutOption = Annotated[Path, typer.Option("--out", help="Where the result goes.")]
JsonOption = Annotated[Path | None, typer.Option("--json", help="Write the machine-readable result here.")]
AxisOption = Annotated[
    str | None, typer.Option("--axis", help="x, y or z of a three-axis recording, or all.")
]
AverageOption = Annotated[
    float, typer.Option("--average-s", min=0.001, help="Averaging of all RMS figures, s.")
]
MethodOption = Annotated[str, typer.Option("--method", help="mrbf (default), mrbf_paper, rbf_ols, ...")]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of everything random.")]
CentersOption = Annotated[
    int | None, typer.Option("--centers", min=0, max=512, help="Number of centers; default: chosen.")
]
RhoOption = Annotated[
    float | None, typer.Option("--rho", min=0.0, max=1.0, help="The paper's threshold, eq. (16).")
]
BlockOption = Annotated[float, typer.Option("--block-s", min=0.001, max=3600.0, help="Length of a block, s.")]
NumericOption = Annotated[
    str | None, typer.Option("--numeric", help="Arithmetics, e.g. f32 or f32,q31; default: all.")
]
AppliedOption = Annotated[
    Path | None, typer.Option("--applied", help="The model.json that was already subtracted while recording.")
]
DirArg = Annotated[Path, typer.Argument(help="Folder that build (or fit and emit) wrote.")]


@contextmanager
def _progress() -> Iterator[Callable[[str], None]]:
    """A line on stderr that says what is being done; nothing when stderr is no terminal."""
    if not _ERR.is_terminal:
        yield lambda _: None
        return
    with _ERR.status("") as status:
        yield status.update


def _write_json(path: Path | None, result: dict[str, Any]) -> None:
    if path is not None:
        write_atomically(path, json_text(result))


def json_text(result: dict[str, Any]) -> str:
    return json.dumps(result, indent=1, allow_nan=False) + "\n"


def _numerics(text: str | None) -> list[str] | None:
    return None if text is None else [part.strip() for part in text.split(",")]


def _version(value: bool) -> None:
    if value:
        typer.echo(f"gyrotc {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command()
def simulate(
    scenario: Annotated[str, typer.Argument(help="A built-in scenario (paper, ...) or a scenario file.")],
    out: OutOption,
    seed: SeedOption = 1,
    row_s: Annotated[float, typer.Option("--row-s", help="Length of a row, s.")] = 10.0,
    raw_hz: Annotated[float | None, typer.Option("--raw-hz", help="Rows at this rate instead.")] = None,
    pulses: Annotated[bool, typer.Option("--pulses", help="Integer pulses instead of a rate.")] = False,
    format: Annotated[str, typer.Option("--format", help="csv or parquet.")] = "csv",
    noise: Annotated[
        str, typer.Option("--noise", help="paper, or class (a typical 0.008 deg/h unit).")
    ] = "paper",
) -> None:
    """Make a data set from the physical simulation, and truth.json beside it.

    Example: gyrotc simulate paper --seed 1 --out demo-data
    """
    from .simulate import simulate as run

    with _progress() as say:
        run(
            scenario,
            seed=seed,
            out=out,
            row_s=row_s,
            raw_hz=raw_hz,
            pulses=pulses,
            format=format,  # type: ignore[arg-type]
            noise=noise,  # type: ignore[arg-type]
            progress=lambda share: say(f"simulating {share:.0%}"),
        )
    _OUT.print(f"{out}: data set of scenario {scenario}, seed {seed}", highlight=False, soft_wrap=True)


@app.command()
def check(
    dataset: DatasetArg,
    axis: AxisOption = None,
    envelope: Annotated[
        str | None,
        typer.Option("--envelope", help="What training should cover, C and C/min, e.g. -40:60,-5:5."),
    ] = None,
    applied: AppliedOption = None,
    json_file: JsonOption = None,
) -> None:
    """Tell everything that is wrong or doubtful about recordings, at once; also while they still grow.

    Example: gyrotc check recordings
    """
    from .applied import applied_of
    from .check import check as run
    from .check import envelope_of

    result = run(
        dataset,
        axis=axis,
        envelope=envelope_of(envelope) if envelope is not None else None,
        applied=applied_of(applied) if applied else None,
    )
    _write_json(json_file, result.to_dict())
    for line in result.lines():
        _OUT.print(line, highlight=False, soft_wrap=True, markup=False)
    if result.problems:
        raise typer.Exit(2)


@app.command()
def fit(
    dataset: DatasetArg,
    out: OutOption,
    method: MethodOption = "mrbf",
    axis: AxisOption = None,
    seed: SeedOption = 0,
    centers: CentersOption = None,
    rho: RhoOption = None,
    block_s: BlockOption = 10.0,
    average_s: AverageOption = 100.0,
    applied: AppliedOption = None,
    json_file: JsonOption = None,
) -> None:
    """Train a model: DIR/model.json and DIR/training.json.

    Example: gyrotc fit recordings --out result
    """
    from .applied import applied_of
    from .dataset import load
    from .fitting import FitOptions, fit_dataset

    options = FitOptions(method, seed, centers, rho, block_s, average_s)
    known = applied_of(applied) if applied else None
    with _progress() as say:
        fitted = fit_dataset(load(dataset, axis=axis, applied=known), options, progress=say)
    write_atomically(out / "model.json", fitted.model.to_json())
    write_atomically(out / "training.json", json_text(fitted.training))
    _write_json(json_file, fitted.training)
    for line in span_lines(fitted.training):
        _OUT.print(line, highlight=False, soft_wrap=True)
    _OUT.print(
        f"{out / 'model.json'}: {fitted.model.n_centers} centers, method {fitted.model.method}",
        highlight=False,
        soft_wrap=True,
    )


@app.command()
def emit(
    model: Annotated[Path, typer.Argument(help="A model.json.")],
    out: OutOption,
    numeric: NumericOption = None,
    zero_at: Annotated[
        float | None,
        typer.Option("--zero-at", min=-200, max=400, help="Shift the bias to 0 at this temperature, C."),
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Write the C files of a model into DIR/c.

    Example: gyrotc emit result/model.json --out result
    """
    from .emit import emit as run
    from .model import load_model

    loaded = load_model(model)
    emission = run(loaded, out, numerics=_numerics(numeric), zero_at=zero_at)
    target = out / "model.json"
    if target.resolve() != (model / "model.json" if model.is_dir() else model).resolve():
        loaded.save(target)
    result = {
        "schema": "gyrotc.emit/1",
        "gyrotc_version": __version__,
        "serial": loaded.serial,
        "axis": loaded.axis,
        "id": loaded.id,
        "tables": [
            {"numeric": n, "table_bytes": t.table_bytes, "error_bound_dph": t.error_bound_dph}
            for n, t in emission.tables.items()
        ],
        "refused": emission.refused,
    }
    _write_json(json_file, result)
    for name, reason in emission.refused.items():
        _ERR.print(f"{name} left out: {reason}", highlight=False, soft_wrap=True)
    _OUT.print(
        f"{out / 'c'}: tables gtc_{loaded.id} in {', '.join(emission.tables)}",
        highlight=False,
        soft_wrap=True,
    )


@app.command()
def verify(
    folder: DirArg,
    target: Annotated[
        list[str] | None, typer.Option("--target", help="Name of a target, or all; may be repeated.")
    ] = None,
    dataset: Annotated[
        Path | None, typer.Option("--dataset", help="Replay these recordings on every target besides.")
    ] = None,
    log: Annotated[
        Path | None, typer.Option("--log", help="What board_test.c printed on hardware: checked and entered.")
    ] = None,
    exhaustive: Annotated[
        bool, typer.Option("--exhaustive", help="Visit every input of the fixed-point table (minutes).")
    ] = False,
    json_file: JsonOption = None,
) -> None:
    """Compile DIR/c for each target and compare bit for bit with the reference.

    Example: gyrotc verify result --target all
    """
    from .dataset import load
    from .model import load_model
    from .verify import verify as run

    recordings = load(dataset, axis=load_model(folder / "model.json").axis) if dataset else None
    with _progress() as say:
        result = run(
            folder, targets=target or (), dataset=recordings, log=log, exhaustive=exhaustive, progress=say
        )
    write_atomically(folder / "verify.json", json_text(result))
    _write_json(json_file, result)
    _OUT.print(verify_table(result))
    for line in verify_notes(result):
        _OUT.print(line, highlight=False, soft_wrap=True)
    if result["failed"]:
        raise CheckFailed(f"{result['failed']} checks failed; {len(result['targets'])} targets")


@app.command()
def evaluate(
    folder: DirArg,
    dataset: DatasetArg,
    numeric: NumericOption = None,
    trace: Annotated[Path | None, typer.Option("--trace", help="Folder for one CSV per run.")] = None,
    average_s: Annotated[float | None, typer.Option("--average-s", min=0.001, help="Averaging, s.")] = None,
    applied: AppliedOption = None,
    json_file: JsonOption = None,
) -> None:
    """Replay recordings through the compiled C code, compare every step, measure.

    Example: gyrotc evaluate result recordings --trace result/trace
    """
    from .applied import applied_of
    from .dataset import load
    from .evaluate import evaluate as run
    from .model import load_model

    axis = load_model(folder / "model.json").axis
    recordings = load(dataset, axis=axis, applied=applied_of(applied) if applied else None, exam_only=True)
    with _progress() as say:
        result = run(folder, recordings, numeric=numeric, average_s=average_s, trace=trace, progress=say)
    write_atomically(folder / "evaluate.json", json_text(result))
    _write_json(json_file, result)
    _OUT.print(evaluation_table(result))
    if result["mismatches"]:
        raise CheckFailed(f"{result['mismatches']} steps differ from the reference")


@app.command()
def build(
    dataset: DatasetArg,
    out: OutOption = Path("build"),
    method: MethodOption = "mrbf",
    axis: AxisOption = None,
    seed: SeedOption = 0,
    centers: CentersOption = None,
    rho: RhoOption = None,
    block_s: BlockOption = 10.0,
    average_s: AverageOption = 100.0,
    numeric: NumericOption = None,
    applied: AppliedOption = None,
    extend: Annotated[
        bool, typer.Option("--extend", help="Diagnose first; add the named causes where they gain.")
    ] = False,
    json_file: JsonOption = None,
) -> None:
    """The main job: check, fit, emit, verify, evaluate, report.

    Example: gyrotc build recordings --out result
    """
    from .build import build as run
    from .fitting import FitOptions

    options = FitOptions(method, seed, centers, rho, block_s, average_s)
    with _progress() as say:
        results = run(
            dataset,
            out,
            options,
            axis=axis,
            numerics=_numerics(numeric),
            applied=applied,
            extend=extend,
            progress=say,
        )
    if len(results) == 1:
        _write_json(json_file, results[0].evaluation)
    else:
        _write_json(json_file, {r.evaluation["axis"]: r.evaluation for r in results})
    for result in results:
        _print_built(result)
    _OUT.print(f"report: {out / 'report.html'}", highlight=False, soft_wrap=True)
    failures = [failure for result in results for failure in result.failures]
    if failures:
        raise CheckFailed("; ".join(failures))


def _print_built(result: Built) -> None:
    _OUT.print(evaluation_table(result.evaluation))
    _OUT.print(verify_table(result.verification))
    for line in span_lines(result.training):
        _OUT.print(line, highlight=False, soft_wrap=True)
    for name, reason in result.refused.items():
        _OUT.print(f"{name} left out: {reason}", highlight=False, soft_wrap=True)
    for line in extension_lines(result.diagnosis) if result.diagnosis else ():
        _OUT.print(line, highlight=False, soft_wrap=True, markup=False)
    for finding in result.evaluation["findings"]:
        _OUT.print(f"finding {finding['id']}: {finding['text']}", highlight=False, soft_wrap=True)
    _OUT.print(summary(result.evaluation), highlight=False, soft_wrap=True)


@app.command()
def compare(
    dataset: DatasetArg,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for compare.json and compare.svg.")
    ] = None,
    axis: AxisOption = None,
    seed: SeedOption = 0,
    block_s: BlockOption = 10.0,
    average_s: AverageOption = 100.0,
    applied: AppliedOption = None,
    json_file: JsonOption = None,
) -> None:
    """The paper's Table 1 on this data: every training method side by side.

    Example: gyrotc compare recordings --out comparison
    """
    from .applied import applied_of
    from .compare import CompareOptions
    from .compare import compare as run
    from .comparison import comparison_picture, comparison_tables, with_published
    from .dataset import load

    recordings = load(dataset, axis=axis, applied=applied_of(applied) if applied else None)
    options = CompareOptions(seed=seed, block_s=block_s, average_s=average_s)
    with _progress() as say:
        result = with_published(run(recordings, options, progress=say))
    _write_json(json_file, result)
    if out is not None:
        write_atomically(out / "compare.json", json_text(result))
        write_atomically(out / "compare.svg", comparison_picture(result))
    for table in comparison_tables(result):
        _OUT.print(table)


@app.command()
def diagnose(
    dataset: DatasetArg,
    model: Annotated[Path | None, typer.Option("--model", help="A model.json made before.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for pictures, report and model-extended.json.")
    ] = None,
    method: MethodOption = "mrbf",
    axis: AxisOption = None,
    seed: SeedOption = 0,
    centers: CentersOption = None,
    rho: RhoOption = None,
    block_s: BlockOption = 10.0,
    average_s: AverageOption = 100.0,
    applied: AppliedOption = None,
    json_file: JsonOption = None,
) -> None:
    """What the simulation gets wrong about recordings, the named cause, the extended model, the measured gain.

    Example: gyrotc diagnose recordings --out diagnosis
    """
    from .applied import applied_of
    from .dataset import load
    from .diagnose import diagnose as run
    from .diagnosis import diagnose_into
    from .fitting import FitOptions
    from .model import load_model

    known = load_model(model) if model else None
    options = FitOptions(method, seed, centers, rho, block_s, average_s) if known is None else None
    recordings = load(dataset, axis=axis, applied=applied_of(applied) if applied else None)
    with _progress() as say:
        if out is None:
            result = run(recordings, model=known, options=options, progress=say).result
        else:
            found = diagnose_into(out, recordings, model=known, options=options, progress=say)
            result = found.result
    _write_json(json_file, result)
    for line in diagnosis_lines(result):
        _OUT.print(line, highlight=False, soft_wrap=True, markup=False)


@app.command()
def report(folder: DirArg) -> None:
    """Write DIR/report.html from what build or diagnose left in DIR.

    Example: gyrotc report result
    """
    from .diagnosis_page import is_diagnosis, write_page
    from .report import write_report

    with _progress() as say:
        say("drawing")
        path = write_page(folder) if is_diagnosis(folder) else write_report(folder)
    _OUT.print(f"report: {path}", highlight=False, soft_wrap=True)


def _e(value: float | None, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}e}"


def evaluation_table(result: dict[str, Any]) -> RichTable:
    title = f"{result['serial']}: means over {result['average_s']:g} s, deg/h"
    table = RichTable(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in ("run", "role", "environment"):
        table.add_column(name, no_wrap=True)
    for name in ("before", "after", "std after", "samples"):
        table.add_column(name, justify="right", no_wrap=True)
    for run in result["runs"]:
        table.add_row(
            run["file"] + (f"@{run['from_s']:g}" if run.get("from_s") is not None else ""),
            run["role"], run["environment"] or "", _e(run["before"]["rms_dph"]), _e(run["after"]["rms_dph"]),
            _e(run["after"]["std_dph"]), str(run["samples"]),
        )  # fmt: skip
    for role in ("train", "exam", "left_out"):
        part = result.get(role)
        if part:
            table.add_row(
                "all", role, "", _e(part["before"]["rms_dph"]), _e(part["after"]["rms_dph"]),
                _e(part["after"]["std_dph"]), str(part["samples"]), style="bold",
            )  # fmt: skip
    return table


def diagnosis_lines(result: dict[str, Any]) -> Iterator[str]:
    """The verdict in words: causes with their size and gain, rivals, what could still hide, what to do next."""
    yield f"{result['serial']}: {result['verdict'].replace('_', ' ')}. {result['text']}"
    yield result["meaning"]
    yield from result.get("missing", ())
    for d in result["discrepancies"]:
        if d["p_value"] is not None and d["p_value"] < 0.01:
            yield (
                f"  {d['statistic'].replace('_', ' ')}: measured {d['measured']:.4g}, "
                f"simulated {d['simulated_low']:.4g} ... {d['simulated_high']:.4g}"
            )
    for cause in result["causes"]:
        yield from _cause_lines(cause)
    if result["causes"] and result["extended"] is None:
        yield "no extension is shipped: none has a gain on runs it was not fitted to"
    limits = [c for c in result["considered"] if c.get("detection_limit")]
    if limits:
        yield "what could still hide below its detection limit:"
        yield from (f"  {_limit_text(c)}" for c in limits)
    yield from (f"next: {step}" for step in result["next"])


def extension_lines(diagnosis: dict[str, Any]) -> Iterator[str]:
    """What the diagnosis added to the model, and what it gained."""
    yield f"diagnosis: {diagnosis['verdict'].replace('_', ' ')}: {diagnosis['text']}"
    extended = diagnosis["extended"]
    if extended is None:
        yield "nothing added: no cause was named that gains on runs it was not fitted to"
        return
    added = ", ".join(extended["terms"]) or "a finer map"
    yield f"added: {added}; {extended['centers']} centers (without: {diagnosis['baseline']['centers']})"
    yield from _gain_lines(extended["gain"])


def span_lines(training: dict[str, Any]) -> Iterator[str]:
    """What was cut where there are fewer than three training runs."""
    spans = training["spans"]
    if spans:
        yield f"fewer than three training runs: cut into {len(spans)} spans, each left out in turn with a guard gap"
        for s in spans:
            yield f"  {s['file']}: {s['from_s']:.6g} ... {s['to_s']:.6g} s ({s['kind']}, gap {s['guard_s']:g} s)"


def _limit_text(considered: dict[str, Any]) -> str:
    name = considered["id"] + (f" ({considered['channel']})" if "channel" in considered else "")
    limit = considered["detection_limit"]
    if limit["value"] is None:
        return f"{name}: not visible at any {limit['parameter']} in this gyro"
    return f"{name}: {limit['value']:.3g} {limit['unit']}"


def _cause_lines(cause: dict[str, Any]) -> Iterator[str]:
    yield f"cause: {cause['name']} ({cause['id']}, family {cause['family']})"
    for name, p in cause["parameters"].items():
        interval = "" if p.get("low") is None else f", 95 % {p['low']:.4g} ... {p['high']:.4g}"
        yield f"  {name} = {p['value']:.4g}{interval}"
    if cause["equivalent"]:
        yield f"  as likely on these runs: {', '.join(cause['equivalent'])}"
    if cause.get("separate_by"):
        yield f"  to tell them apart: {cause['separate_by']}"
    if cause.get("gain"):
        yield from _gain_lines(cause["gain"])


def _gain_lines(gain: dict[str, Any]) -> Iterator[str]:
    """RMS and angle without and with, on runs not fitted to."""
    share, removed = gain["share_of_excess_removed"], gain["rms_removed_dph"]
    part = (
        ""
        if share is None
        else f"; {share:.0%} of the removable error ({gain['low']:.0%} ... {gain['high']:.0%})"
    )
    yield (
        f"  RMS on runs not fitted to: {gain['exam_rms_before_dph']:.4g} -> {gain['exam_rms_after_dph']:.4g} deg/h, "
        f"95 % {removed['low']:.2g} ... {removed['high']:.2g} less{part}"
    )
    angle = gain["angle_1h_removed_arcsec"]
    if angle is not None:
        yield (
            f"  angle after one hour: {gain['angle_1h_before_arcsec']:.4g} -> {gain['angle_1h_after_arcsec']:.4g} "
            f"arcsec, 95 % {angle['low']:.2g} ... {angle['high']:.2g} less"
        )


def verify_table(result: dict[str, Any]) -> RichTable:
    table = RichTable(title="Bit for bit against the reference", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in ("target", "", "status"):
        table.add_column(name, no_wrap=True)
    for name in ("vectors", "rows", "differ", "map call", "code", "stack"):
        table.add_column(name, justify="right", no_wrap=True)
    for entry in result["targets"]:
        replayed = entry.get("replayed") or {}
        counted = next((n for n in ("instructions", "cycles", "ticks") if n in entry), None)
        table.add_row(
            entry["name"], entry["numeric"], entry["status"], str(entry.get("vectors", "-")),
            str(replayed.get("rows", "-")),
            str(entry["mismatches"] + replayed.get("mismatches", 0)) if "mismatches" in entry else "-",
            f"{entry[counted]['mean']:.0f} {counted[:5]}" if counted else "-",
            str(entry.get("code_bytes", "-")), str(entry.get("stack_bytes", "-")),
        )  # fmt: skip
    return table


def verify_notes(result: dict[str, Any]) -> Iterator[str]:
    """What is missing, and what differs, with all bits; one line each."""
    for entry in result["targets"]:
        if entry["status"] == "missing":
            yield f"{entry['name']} {entry['numeric']}: missing; it needs the packages {entry['package']}"
        replayed = entry.get("replayed") or {}
        found = [entry.get("error"), replayed.get("error"), *entry.get("first_mismatches", ())]
        for text in [*found, *replayed.get("first_mismatches", ())]:
            if text:
                yield f"{entry['name']} {entry['numeric']}: {text}"
    for file in result["emitted"]:
        if file["status"] == "fail":
            yield f"{file['file']}: {file['mismatches']} lines or words differ from what the model gives"
    for error in result["errors"]:
        for text in error.get("first_mismatches", ()):
            yield f"{error['numeric']}: {text}"
        yield (
            f"{error['numeric']}: worst error {error['worst_dph']:.2e} deg/h of {error['inputs_visited']} inputs "
            f"visited; the bound is {error['bound_dph']:.2e}"
            + (" and is EXCEEDED" if error["worst_dph"] > error["bound_dph"] else "")
        )


def summary(result: dict[str, Any]) -> str:
    """One line that says what was gained; the paper's own figure beside it for the paper's scenario."""
    part = result.get("exam") or result.get("left_out") or result.get("train")
    if not part or not part["improvement"]:
        return "no sample to judge by"
    text = (
        f"improvement {part['improvement']:.2f} (paper: 9.8-10.4)"
        if result.get("exam")
        else (f"improvement on spans left out {part['improvement']:.2f}")
    )
    floor, rms = result["noise_floor_dph"], part["after"]["rms_dph"]
    if floor:
        text += f"; RMS {rms:.3e} deg/h = {rms / floor:.4f} x noise floor ({result['noise_floor_source']})"
    return f"{text}; {result['model']['centers']} centers, {result['model']['table_bytes']} bytes of table"


def main() -> None:
    """Entry point: the command's exit status, without tearing the interpreter down.

    Arrow's read-ahead threads may still hold a Python file when the interpreter goes; it would end them inside C++
    code, which aborts the process after its work is done.
    """
    status = _status()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def _status() -> int:
    """Runs the command; errors become one message on stderr and their exit status."""
    try:
        app(standalone_mode=True)
    except GyrotcError as error:
        print(f"gyrotc: {error}", file=sys.stderr)
        return error.exit_status
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0
