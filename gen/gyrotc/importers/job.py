"""`gyrotc import`: files of a logger in, a data set out, with the map that reads the next file of that logger."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic_core import PydanticCustomError

from .. import __version__
from ..dataset.plausible import Suspicion, suspicions
from ..dataset.schema import FILE, check_serial
from ..dataset.text import dataset_toml
from ..dataset.values import MIN_ROWS
from ..errors import InputError
from ..outputs import result_folder
from .formats import open_logger_file
from .mapping import MAP_FILE, Map, TimeMap, map_text
from .propose import Ask, Plan, propose
from .rows import Rows
from .runfile import Format, RunFile
from .tables import LoggerFile
from .words import preview, proposal, summary

__all__ = ["ImportOptions", "Imported", "import_files"]

Say = Callable[[str], None]
Progress = Callable[[str, float], None]
_BLOCK_BYTES = 2**22


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What is asked for besides files and map.

    Attributes:
        serial: Serial of the gyro; else that of the map, of the file, or the name of the folder.
        format: Of the runs that are written.
        trust_units: Values that contradict their units are taken; it is recorded.
        dry_run: Tell what would be read and how, and write nothing.
    """

    serial: str | None = None
    format: Format = "parquet"
    trust_units: bool = False
    dry_run: bool = False


@dataclass(frozen=True, slots=True)
class Imported:
    """What was written: the serial, the kept map, and an entry for each run (`file`, `rows`, `left_out`, `source`)."""

    serial: str
    map: Map
    runs: tuple[dict[str, Any], ...]

    def to_dict(self) -> dict[str, Any]:
        """The JSON object of `gyrotc import`."""
        shown = ("file", "rows", "left_out", "trusted", "source")
        return {
            "schema": "gyrotc.import/1",
            "gyrotc_version": __version__,
            "serial": self.serial,
            "axis": None,
            "map": {k: v for k, v in self.map.model_dump(mode="json").items() if v not in (None, "", {})},
            "runs": [{key: entry[key] for key in shown} for entry in self.runs],
        }


def import_files(
    files: Sequence[Path],
    out: Path,
    chosen: Map,
    options: ImportOptions,
    *,
    ask: Ask | None = None,
    say: Say | None = None,
    progress: Progress | None = None,
) -> Imported | None:
    """Imports files, each as a run, into a new folder.

    Args:
        chosen: What is known of the logger; what it leaves open is proposed from the first file.
        ask: Asks a person for a unit that stands nowhere.
        say: Told the proposal, the preview and what was written, line by line.
        progress: Told the name of the file and the share of it that is done.

    Returns:
        What was written; None after a dry run.

    Raises:
        InputError: Something that cannot be taken; nothing is written.
    """
    tell = say or (lambda _: None)
    try:
        return _imported(files, out, chosen, options, ask or (lambda _: None), tell, progress)
    except _DryRun:
        tell("dry run: nothing was written")
        return None


def _imported(
    files: Sequence[Path],
    out: Path,
    chosen: Map,
    options: ImportOptions,
    ask: Ask,
    tell: Say,
    progress: Progress | None,
) -> Imported:
    entries: list[dict[str, Any]] = []
    names: set[str] = set()
    serial = ""
    with result_folder(out, "import", inputs=files) as stage:
        folder = stage.folder
        for path in files:
            file = open_logger_file(path, chosen)
            plan = propose(file, chosen, ask)
            rows = Rows(path.name, plan, chosen.time)
            for line in proposal(file, plan, rows):
                tell(line)
            chosen = _kept(chosen, file, plan, rows)
            if not serial:
                serial = _serial(options.serial, chosen, file, out)
                stage.of(serial)
            target = folder / f"{_run_name(path, names)}.{options.format}"
            entries.append(_run(file, rows, target, chosen, options, tell, progress))
        chosen = chosen.model_copy(update={"serial": serial})
        (folder / MAP_FILE).write_text(map_text(chosen), "utf-8")
        (folder / FILE).write_text(_description(serial, chosen, entries), "utf-8")
    for line in summary(out, entries):
        tell(line)
    return Imported(serial, chosen, tuple(entries))


class _DryRun(Exception):
    """Ends a dry run."""


def _run(
    file: LoggerFile,
    rows: Rows,
    target: Path,
    chosen: Map,
    options: ImportOptions,
    tell: Say,
    progress: Progress | None,
) -> dict[str, Any]:
    """Writes one run; its entry."""
    layout = rows.layout
    names = ["time_s", "temperature_c", *(layout.axes.values() or [layout.value]), *layout.channels]
    shown = False
    with RunFile(target, options.format, names) as sink:
        for columns, done in rows.chunks():
            if not shown:
                shown = True
                for line in preview(rows):
                    tell(line)
                if options.dry_run:
                    raise _DryRun
            sink.write(columns)
            if progress is not None:
                progress(file.path.name, done)
    if rows.count < MIN_ROWS:
        left = ", ".join(f"{count} with {reason}" for reason, count in rows.left_out.items())
        raise InputError(
            file.path.name, f"{rows.count} rows" + (f" ({left})" if left else ""), f"at least {MIN_ROWS}"
        )
    trusted = _judged(file, rows, chosen, options)
    started = rows.clock.started
    return {
        "file": target.name,
        "started": started,
        "since_power_on": file.since_power_on,
        "rows": rows.count,
        "left_out": dict(rows.left_out)
        | {k: v for t in file.tables for k, v in getattr(t, "remarks", {}).items() if v},
        "trusted": trusted,
        "evidence": rows.evidence,
        "source": {
            "file": file.path.name,
            "sha256": _sha256(file.path),
            "bytes": _size(file.path),
            "imported_by": f"gyrotc {__version__}",
            "map": MAP_FILE,
            "run": target.name,
        },
    }


def _judged(file: LoggerFile, rows: Rows, chosen: Map, options: ImportOptions) -> list[str]:
    """Values against their units; what the user's word is taken against.

    Raises:
        InputError: They contradict them, and nobody says that they are right.
    """
    noise = (chosen.noise or {}).get("arw_deg_per_sqrt_h")
    found: list[Suspicion] = list(
        suspicions(
            rows.evidence, rows.layout, rows.units, earth_stated=chosen.earth_rate is not None, noise=noise
        )
    )
    for one in found:
        if not options.trust_units:
            expected = (
                f'--{one.kind}-unit "{one.likely}", or --trust-units if the values are right as they are'
            )
            raise InputError(f"{file.path.name}, column {one.column}", one.found, expected)
    return [f"{one.column}: {one.found}" for one in found]


def _kept(chosen: Map, file: LoggerFile, plan: Plan, rows: Rows) -> Map:
    """The map with every choice that was made."""
    columns: dict[str, Any] = {choice.role: choice.source for choice in (*plan.values, plan.temperature)}
    if plan.time:
        columns["time"] = tuple(choice.column.name for choice in plan.time)
    units = dict(chosen.units)
    if plan.time and plan.time[0].unit:
        units["time"] = plan.time[0].unit
    units["temperature"] = plan.temperature.unit or ""
    if plan.values[0].unit:
        units["rate"] = plan.values[0].unit
    units |= {
        choice.role: choice.unit for choice in plan.channels if choice.unit and choice.role in rows.units
    }
    time = TimeMap(format=rows.clock.form or None, zone=chosen.time.zone, rate_hz=plan.rate_hz)
    csv = {
        k: v for k, v in file.csv.items() if k in ("encoding", "delimiter", "decimal")
    } | chosen.csv.given()
    update = {
        "columns": columns,
        "channels": {choice.role: choice.source for choice in plan.channels},
        "units": units,
        "csv": csv,
        "time": time.model_dump(),
    }
    return Map.model_validate(chosen.model_dump() | update)


def _serial(stated: str | None, chosen: Map, file: LoggerFile, out: Path) -> str:
    in_file = next(
        (v for k, v in file.facts.items() if re.fullmatch(r"serial( ?(no|nr|number))?\.?", k)), None
    )
    told = stated or chosen.serial or (re.sub(r"[^A-Za-z0-9._-]+", "-", in_file) if in_file else None)
    serial = told or out.resolve().name
    try:
        return check_serial(serial)
    except PydanticCustomError as error:
        where = (
            "--serial" if stated else f"the serial {'in the file' if told else 'from the name of the folder'}"
        )
        raise InputError(where, repr(serial), f"{error.message()}; --serial names one") from error


def _run_name(path: Path, taken: set[str]) -> str:
    """A plain name for a run, from that of its file."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-.") or "run"
    name, k = plain, 2
    while name in taken:
        name, k = f"{plain}-{k}", k + 1
    taken.add(name)
    return name


def _description(serial: str, chosen: Map, entries: Sequence[Mapping[str, Any]]) -> str:
    head: dict[str, Any] = {"schema": 1, "serial": serial}
    for key in ("description", "earth_rate", "latitude_deg", "pulse_weight_arcsec"):
        if getattr(chosen, key) not in (None, ""):
            head[key] = getattr(chosen, key)
    if any(entry["trusted"] for entry in entries):
        head["trust_units"] = True
    sources = [entry["source"] for entry in entries]
    tables: dict[str, Any] = {"source": sources[0] if len(sources) == 1 else sources}
    if chosen.meta:
        tables["meta"] = chosen.meta
    if chosen.noise:
        tables["noise"] = chosen.noise
    return dataset_toml(head, tables, [dict(_run_entry(entry)) for entry in entries])


def _run_entry(entry: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    yield "file", entry["file"]
    if entry["started"] is not None:
        yield "started", entry["started"]
    if not entry["since_power_on"]:
        yield "power_on_s", "unknown"


def _sha256(path: Path) -> str:
    """Of a file; of a folder: of its files one after the other, in the order of their names."""
    digest = hashlib.sha256()
    for one in sorted(path.iterdir()) if path.is_dir() else [path]:
        with one.open("rb") as file:
            while block := file.read(_BLOCK_BYTES):
                digest.update(block)
    return digest.hexdigest()


def _size(path: Path) -> int:
    return sum(one.stat().st_size for one in path.iterdir()) if path.is_dir() else path.stat().st_size
