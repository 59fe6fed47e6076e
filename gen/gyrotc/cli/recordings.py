"""Commands about recordings: import, simulate, check."""

from __future__ import annotations

import shlex
import sys
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..common.errors import InputError, quoted
from .application import app
from .options import DatasetArg, JsonOption, OutOption, SeedOption
from .output import tell, write_json
from .progress import progress

if TYPE_CHECKING:
    from ..quality.inspection import CheckResult


class RunFormat(str, Enum):
    """Format of the files of a data set."""

    csv = "csv"
    parquet = "parquet"


_ROLES = ("time", "temperature", "device", "rate", "rate_x", "rate_y", "rate_z", "pulses")


@app.command(name="import")
def import_(
    files: Annotated[list[Path], typer.Argument(help="Files of a logger, each a run.")],
    out: OutOption,
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map", help="The map.toml of an earlier import from this logger; default: recognise columns and units."
        ),
    ] = None,
    serial: Annotated[
        str | None,
        typer.Option("--serial", help="Serial of the gyro; default: that of the file, else the name of --out."),
    ] = None,
    rate_unit: Annotated[
        str | None,
        typer.Option(
            "--rate-unit", help="Unit of rates: deg/h, deg/s, rad/s, deg/s/131, ...; default: as the file says."
        ),
    ] = None,
    temperature_unit: Annotated[
        str | None,
        typer.Option(
            "--temperature-unit",
            help='Unit of temperatures: degC, K, "raw/340 + 36.53 degC", ...; default: as the file says.',
        ),
    ] = None,
    time_unit: Annotated[
        str | None,
        typer.Option("--time-unit", help="Unit of times: s, ms, us, min, 0.01 s, ...; default: as the file says."),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            "--column",
            metavar="ROLE=NAME",
            help="Meaning of a column, e.g. rate=G1, time=t, device=SN; may be repeated.",
        ),
    ] = None,
    stated: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Any key of map.toml, e.g. table=gyro_2, time.zone=UTC, csv.missing=ERR; may be repeated.",
        ),
    ] = None,
    join: Annotated[
        list[Path] | None, typer.Option("--join", help="A file with the temperature at the same time; may be repeated.")
    ] = None,
    tolerance_s: Annotated[
        float | None,
        typer.Option(
            "--tolerance-s", min=1e-6, help="Longest time that a reading of a joined file holds, s; needed with --join."
        ),
    ] = None,
    exam: Annotated[
        bool | None,
        typer.Option(
            "--exam/--no-exam", help="The last file judges the correction and is not trained on; default: ask."
        ),
    ] = None,
    trust_units: Annotated[
        bool, typer.Option("--trust-units", help="Take units that the values contradict; dataset.toml records it.")
    ] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Read the files and show how, but write nothing.")] = False,
    json_file: JsonOption = None,
) -> None:
    """Make a data set of files of loggers.

    The files are CSV, Excel, Parquet, MATLAB, HDF5, NetCDF or TDMS.

    Example: gyrotc import chamber.csv --out RLG-0042 --rate-unit deg/s
    """
    from ..recordings.importers.job import ImportOptions, import_files
    from ..recordings.importers.map_file import Map, checked_map, load_map

    known = load_map(map_file) if map_file else Map()
    units = {"rate": rate_unit, "temperature": temperature_unit, "time": time_unit}
    content = _with_keys(known.model_dump(), stated or [])
    content["join"] = _joins(join or [], tolerance_s) or content["join"]
    chosen = _stated(content, units, _columns(column or []))
    options = ImportOptions(serial, trust_units, dry_run, exam)
    with progress() as say:
        result = import_files(
            files, out, checked_map(chosen, "options"), options, ask=_ask, say=tell,
            progress=say,
        )  # fmt: skip
    if result is not None:
        write_json(json_file, result.result().content())
        if not dry_run:
            tell(f"next: gyrotc check {shlex.quote(str(out))}")


def _with_keys(content: dict[str, Any], stated: list[str]) -> dict[str, Any]:
    """Put `key=value` options into a map; a list of values gets another one.

    Raises:
        InputError: A key is none of a map, or names several.
    """
    for one in stated:
        path, _, value = one.partition("=")
        *tables, key = path.split(".")
        part: Any = content
        for table in tables:
            part = part.get(table) if isinstance(part, dict) else None
        if not value or not isinstance(part, dict) or key not in part or isinstance(part[key], dict):
            known = (f"{name}.{inner}" for name in ("time", "csv") for inner in content[name])
            expected = f"KEY=VALUE with KEY one of table, where, hold, pulse_weight_arcsec, {', '.join(known)}"
            raise InputError("--set", quoted(one), expected)
        part[key] = (*part[key], value) if isinstance(part[key], tuple | list) else value
    return content


def _stated(content: dict[str, Any], units: dict[str, str | None], columns: dict[str, Any]) -> dict[str, Any]:
    """A map with what options state."""
    content["units"] |= {kind: unit for kind, unit in units.items() if unit is not None}
    if any(role.startswith(("rate", "pulses")) for role in columns):
        for role in _ROLES[3:]:
            content["columns"][role] = None
    content["columns"] |= columns
    return content


def _columns(stated: list[str]) -> dict[str, Any]:
    """`role=name` options; `time` may be given twice, for a date and a time of day."""
    columns: dict[str, Any] = {}
    for one in stated:
        role, _, name = one.partition("=")
        if role not in _ROLES or not name:
            raise InputError("--column", quoted(one), f"ROLE=NAME with ROLE one of {', '.join(_ROLES)}")
        columns[role] = (*columns.get("time", ()), name) if role == "time" else name
    return columns


def _joins(files: list[Path], tolerance_s: float | None) -> list[dict[str, Any]]:
    """Return options as `[[join]]` of a map.

    Raises:
        InputError: One of the two is missing.
    """
    if bool(files) != (tolerance_s is not None):
        found = "without --tolerance-s" if files else "without --join"
        expected = "--join FILE --tolerance-s S: for how long a reading of the file holds"
        raise InputError("--join" if files else "--tolerance-s", found, expected)
    return [{"file": str(file), "tolerance_s": tolerance_s} for file in files]


def _ask(question: str) -> str | None:
    """A person's answer; None where there is no terminal."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return None
    answer: str = typer.prompt(question, default="", show_default=False, err=True)
    return answer.strip() or None


@app.command()
def simulate(
    scenario: Annotated[str, typer.Argument(help="A built-in scenario (paper, ...) or a scenario file.")],
    out: OutOption,
    seed: SeedOption = 1,
    raw_hz: Annotated[
        float | None, typer.Option("--raw-hz", help="Rows a second, Hz; default: those of the scenario.")
    ] = None,
    pulses: Annotated[bool, typer.Option("--pulses", help="Write integer pulses instead of a rate.")] = False,
    format: Annotated[RunFormat, typer.Option("--format", help="Format of the files.")] = RunFormat.csv,
    units: Annotated[
        int | None,
        typer.Option(
            "--units", help="Simulate a lot of so many gyros, each in a folder of its own; default: one gyro."
        ),
    ] = None,
) -> None:
    """Make a data set from the physical simulation.

    The truth is beside it, in truth.json. --units makes a lot of gyros, a data set each.

    Example: gyrotc simulate paper --seed 1 --out demo-data

    Example: gyrotc simulate paper --units 60 --seed 1 --out lot
    """
    from ..simulate.data_set import simulate as run

    if units is not None:
        _simulate_lot(scenario, units, seed, out, raw_hz, pulses, format)
        return
    with progress() as say:
        run(
            scenario,
            seed=seed,
            out=out,
            raw_hz=raw_hz,
            pulses=pulses,
            format=format.value,
            progress=say,
        )
    tell(f"{out}: data set of scenario {scenario}, seed {seed}")


def _simulate_lot(
    scenario: str,
    units: int,
    seed: int,
    out: Path,
    raw_hz: float | None,
    pulses: bool,
    format: RunFormat,
) -> None:
    """Simulate a lot of gyros."""
    from ..simulate.data_set import RowForm
    from ..simulate.lot import LotOrder, simulate_lot

    order = LotOrder(units)
    with progress() as say:
        simulate_lot(
            order,
            seed=seed,
            out=out,
            scenario=scenario,
            form=RowForm.of(raw_hz=raw_hz, pulses=pulses, format=format.value),
            progress=say,
        )
    tell(f"{out}: {units} data sets of scenario {scenario}, seed {seed}")


@app.command()
def check(
    dataset: DatasetArg,
    previous: Annotated[
        Path | None,
        typer.Option(
            "--previous", help="An earlier result of this gyro, to compare sign and axes with; default: none."
        ),
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Report all errors and warnings of recordings at once.

    Files that still grow are read as far as they are.

    Example: gyrotc check recordings
    """
    from ..jobs.inspection import check as run

    with progress() as say:
        result = run(dataset, previous=previous, progress=say)
    write_json(json_file, result.result().content())
    for line in result.lines():
        tell(line, wrong=bool(result.problems))
    tell(f"next: {_after_check(result, shlex.quote(str(dataset)), previous)}")
    if result.problems:
        raise typer.Exit(2)


def _after_check(result: CheckResult, dataset: str, previous: Path | None) -> str:
    """Return the one step that comes after a check.

    Args:
        dataset: The data set as a shell takes it.
        previous: The earlier result that it was checked against, which the next build must not replace.
    """
    if result.problems:
        return f"mend the problems above, the first one first, and check again: gyrotc check {dataset}"
    build = f"gyrotc build {dataset} --out result"
    if previous is not None:
        build = f"gyrotc build {dataset} --prior {shlex.quote(str(previous))} --out renewed"
    if result.warnings:
        return f"look at the warnings above; if they are as they should be: {build}"
    return build
