"""`gyrotc import`: files of a logger in, a data set out, with the map that reads the next file of that logger.

Which importer reads a file is known from its first bytes, and from the ending of its name where these say nothing.
"""

from __future__ import annotations

import gzip
import hashlib
import re
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic_core import PydanticCustomError

from ... import __version__
from ...common.errors import InputError
from ...common.inputs import open_input, refuse_above
from ...results.base import ADVICE, Finding
from ...results.files import write_own
from ...results.folder import result_folder, scratch_folder
from ...results.recordings import ImportedFile, ImportedFiles, OriginalFile
from ..description import FILE, MIN_ROWS, check_serial, dataset_toml
from ..parser_process import Parser, open_confined
from ..plausibility import TRUSTED, Suspicion, suspicions
from ..tables import LoggerFile
from .csv_table import open_csv
from .map_file import MAP_FILE, Choice, ImportPlan, Map, TimeMap, map_text
from .propose import Ask, propose
from .rows import NAMES_OF_COLUMNS, FileFormat, ImportedRows, RunFile

_BLOCK_BYTES = 2**22  # of a read: bounds memory


def kept_map(chosen: Map, file: LoggerFile, plan: ImportPlan, rows: ImportedRows) -> Map:
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
    units |= {choice.role: choice.unit for choice in plan.channels if choice.unit and choice.role in rows.units}
    time = TimeMap(format=rows.clock.form or None, zone=chosen.time.zone, rate_hz=plan.rate_hz)
    csv = {
        k: v for k, v in file.csv.items() if k in ("encoding", "delimiter", "decimal", "thousands")
    } | chosen.csv.given()
    update = {
        "columns": columns,
        "channels": {choice.role: choice.source for choice in plan.channels},
        "units": units,
        "csv": csv,
        "time": time.model_dump(),
    }
    return Map.model_validate(chosen.model_dump() | update)


def serial_of(stated: str | None, chosen: Map, file: LoggerFile, out: Path) -> str:
    in_file = next((v for k, v in file.facts.items() if re.fullmatch(r"serial( ?(no|nr|number))?\.?", k)), None)
    known = stated or chosen.serial or (re.sub(r"[^A-Za-z0-9._-]+", "-", in_file) if in_file else None)
    serial = known or out.resolve().name
    try:
        return check_serial(serial)
    except PydanticCustomError as error:
        where = "--serial" if stated else f"the serial {'in the file' if known else 'from the name of the folder'}"
        raise InputError(where, repr(serial), f"{error.message()}; --serial names one") from error


def run_name(path: Path, taken: set[str]) -> str:
    """A plain name for a run, from that of its file."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-.") or "run"
    name, k = plain, 2
    while name in taken:
        name, k = f"{plain}-{k}", k + 1
    taken.add(name)
    return name


def description_of(serial: str, chosen: Map, entries: Sequence[Mapping[str, Any]]) -> str:
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
    if entry["exam"]:
        yield "role", "exam"
    if entry["started"] is not None:
        yield "started", entry["started"]
    yield "power_on_s", "unknown"


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()


_NATIVE = {"time": "s", "temperature": "C", "rate": "deg/h"}
_MOST_NAMES = 12  # that are listed in a line of a terminal


def proposal(file: LoggerFile, plan: ImportPlan, rows: ImportedRows) -> Iterator[str]:
    """How a file is read, a line for each column."""
    table = f", table {plan.main.name}" if plan.main.name else ""
    yield f"{file.path.name}: {file.format}{table}"
    if plan.time:
        names = " + ".join(choice.column.name for choice in plan.time)
        form = f"stamps {rows.clock.form}" if rows.clock.form else _unit_words(plan.time[0])
        yield _line("time", names, form, _why(plan.time[0]))
    else:
        yield _line("time", "-", f"{plan.rate_hz:g} rows per second", plan.why_rate)
    for choice in (plan.temperature, *plan.values, *plan.channels):
        yield _line(choice.role, choice.source, _unit_words(choice), _why(choice))
    if rows.clock.needs_zone:
        yield "  the stamps have no zone: when the run started is left out (--time-zone Europe/Berlin would say it)"
    if plan.left_out:
        more = f" and {len(plan.left_out) - _MOST_NAMES} more" if len(plan.left_out) > _MOST_NAMES else ""
        yield f"  left out: {', '.join(plan.left_out[:_MOST_NAMES])}{more} ([channels] of the map takes them)"
    for note in plan.main.notes:
        yield f"  {note}"


def preview(rows: ImportedRows) -> Iterator[str]:
    """The first rows as the file has them and as they become."""
    for k in range(min(3, len(next(iter(rows.raw.values()), [])))):
        before = ", ".join(f"{name} {values[k]}" for name, values in rows.raw.items())
        after = ", ".join(f"{name} {values[k]:.10g}" for name, values in rows.first_rows.items())
        yield f"  row {k + 1}: {before or '-'}  ->  {after}"


def import_summary(out: Path, entries: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """What was written."""
    for entry in entries:
        cells = entry["evidence"].cells
        low, high = entry["evidence"].temperature_c
        length = _period(*entry["period_s"])
        means = ", ".join(f"{mean:.4g}" for mean in np.atleast_1d(cells[:, 2:].mean(axis=0)))
        left = "".join(f", {count} left out: {reason}" for reason, count in entry["left_out"].items())
        above = f"; lines of text above them: {entry['above']}" if entry["above"] else ""
        yield (
            f"{out / entry['file']}: {entry['rows']} rows of {length} s, {low:.4g} ... {high:.4g} C, "
            f"mean {means} {'pulses a row' if entry['pulses'] else 'deg/h'}; {entry['read']} read{left}{above}"
        )
        for text in entry["trusted"]:
            yield f"  {TRUSTED}{text}"
    kept = out / "map.toml"
    yield f"{kept}: reads the next file of this logger: gyrotc import FILE --map {kept} --out ..."


_EXACT = 1e-6  # of a period: what stamps in microseconds leave of rows of a second


def _period(low: float, high: float) -> str:
    """Length of rows: one number where all are alike, else from the shortest to the longest."""
    if high - low <= _EXACT * high:
        return f"{0.5 * (low + high):.6g}"
    return f"{low:.4g} ... {high:.4g}"


def _line(role: str, source: str, unit: str, why: str) -> str:
    return f"  {role:<12} {source:<24} {unit:<24} {why}"


def _unit_words(choice: Choice) -> str:
    kind = "rate" if choice.role.startswith("rate") else choice.role
    if choice.role in NAMES_OF_COLUMNS or choice.role == "time":
        return f"{choice.unit} -> {_NATIVE[kind]}" if choice.unit and kind in _NATIVE else ""
    return choice.unit or ""


def _why(choice: Choice) -> str:
    from ..units import meaning

    column = choice.column
    if choice.unit is None:
        return choice.why
    if choice.unit == column.unit:
        return f"{choice.why}; the unit: {column.why or 'in the file'}"
    in_name = meaning(column.name, None, choice.table.name)
    if choice.unit == in_name.unit and in_name.why:
        return f"{choice.why}; the unit: {in_name.why}"
    return f"{choice.why}; the unit: as stated"


Say = Callable[[str], None]
ImportProgress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What is asked for besides files and map.

    Attributes:
        serial: Serial of the gyro; else that of the map, of the file, or the name of the folder.
        format: Format of the runs that are written.
        trust_units: Values that contradict their units are taken; it is recorded.
        dry_run: Tell what would be read and how, and write nothing.
        exam: The last file is the exam, which judges the correction and is not trained on; None: a person is asked.
    """

    serial: str | None = None
    format: FileFormat = "parquet"
    trust_units: bool = False
    dry_run: bool = False
    exam: bool | None = None


@dataclass(frozen=True, slots=True)
class Imported:
    """What was written: the serial, the kept map, and an entry for each run (`file`, `rows`, `left_out`, `source`)."""

    serial: str
    map: Map
    runs: tuple[dict[str, Any], ...]

    def result(self) -> ImportedFiles:
        """What `gyrotc import` says of it."""
        return ImportedFiles(
            gyrotc_version=__version__,
            serial=self.serial,
            axis=None,
            map={k: v for k, v in self.map.model_dump(mode="json").items() if v not in (None, "", {})},
            runs=tuple(
                ImportedFile(
                    file=entry["file"],
                    read=entry["read"],
                    above=entry["above"],
                    rows=entry["rows"],
                    left_out=entry["left_out"],
                    trusted=tuple(entry["trusted"]),
                    source=OriginalFile(**entry["source"]),
                )
                for entry in self.runs
            ),
            findings=self.findings(),
        )

    def findings(self) -> tuple[Finding, ...]:
        """Rows that were left out, and units that were taken against what the values say, as `check` tells them."""
        said = [
            (id, entry["file"], text)
            for entry in self.runs
            for id, texts in (
                ("left_out", [f"{rows} rows are left out: {reason}" for reason, rows in entry["left_out"].items()]),
                ("left_out", entry["notes"]),
                ("units_trusted", [TRUSTED + text for text in entry["trusted"]]),
            )
            for text in texts
        ]
        return tuple(Finding(id=id, where=file, file=file, text=text, next=ADVICE[id]) for id, file, text in said)


def import_files(
    files: Sequence[Path],
    out: Path,
    chosen: Map,
    options: ImportOptions,
    *,
    ask: Ask | None = None,
    say: Say | None = None,
    progress: ImportProgress | None = None,
) -> Imported | None:
    """Imports files, each as a run, into a new folder.

    Args:
        chosen: What is known of the logger; what it leaves open is proposed from the first file.
        ask: Asks a person for a unit that stands nowhere.
        say: Called with the proposal, the preview and what was written, line by line.
        progress: Called with the name of the file and the share of it that is done.

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
    progress: ImportProgress | None,
) -> Imported:
    entries: list[dict[str, Any]] = []
    names: set[str] = set()
    serial = ""
    exam = _last_is_exam(files, options, ask)
    with result_folder(out, "import", inputs=files) as stage:
        folder = stage.folder
        for path in files:
            with closing(open_logger_file(path, chosen)) as file:
                plan = propose(file, chosen, ask)
                rows = ImportedRows(path.name, plan, chosen.time)
                for line in proposal(file, plan, rows):
                    tell(line)
                chosen = kept_map(chosen, file, plan, rows)
                if not serial:
                    serial = serial_of(options.serial, chosen, file, out)
                    stage.of(serial)
                target = folder / f"{run_name(path, names)}.{options.format}"
                entries.append(_run(file, rows, target, chosen, options, tell, progress))
        chosen = chosen.model_copy(update={"serial": serial})
        for entry in entries:
            entry["exam"] = exam and entry is entries[-1]
        write_own(folder / MAP_FILE, map_text(chosen))
        write_own(folder / FILE, description_of(serial, chosen, entries))
    for line in import_summary(out, entries):
        tell(line)
    tell(_judged_by(entries))
    return Imported(serial, chosen, tuple(entries))


def _last_is_exam(files: Sequence[Path], options: ImportOptions, ask: Ask) -> bool:
    """Whether the last run is the exam: as stated, else as a person answers; nobody there: no.

    Raises:
        InputError: There is only one run.
    """
    if options.exam and len(files) < 2:
        raise InputError("--exam", "with one file, which training needs", "two files or more")
    if options.exam is not None or options.dry_run or len(files) < 2:
        return bool(options.exam)
    answer = ask(f"Is {files[-1].name} the exam, which judges the correction and is not trained on? [y/N]")
    return (answer or "").lower() in ("y", "yes")


def _judged_by(entries: Sequence[Mapping[str, Any]]) -> str:
    """What will judge a correction made of these runs."""
    if entries[-1]["exam"]:
        return f"{entries[-1]['file']} is the exam; the other runs are trained on"
    hint = "" if len(entries) < 2 else ": --exam makes the last run the exam"
    return f"every run is trained on, so a correction is judged by parts left out in turn{hint}"


class _DryRun(Exception):
    """Ends a dry run."""


def _run(
    file: LoggerFile,
    rows: ImportedRows,
    target: Path,
    chosen: Map,
    options: ImportOptions,
    tell: Say,
    progress: ImportProgress | None,
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
        raise InputError(file.path.name, f"{rows.count} rows" + (f" ({left})" if left else ""), f"at least {MIN_ROWS}")
    trusted = _judged(file, rows, chosen, options)
    started = rows.clock.started
    return {
        "file": target.name,
        "started": started,
        "pulses": layout.pulses,
        "rows": rows.count,
        "read": rows.read,
        "above": rows.plan.main.above,
        "left_out": dict(rows.left_out),
        "notes": rows.plan.main.notes,
        "trusted": trusted,
        "evidence": rows.evidence,
        "period_s": rows.period_s,
        "source": {
            "file": file.path.name,
            "sha256": sha256_of(file.path),
            "bytes": file.path.stat().st_size,
            "imported_by": f"gyrotc {__version__}",
            "map": MAP_FILE,
            "run": target.name,
        },
    }


def _judged(file: LoggerFile, rows: ImportedRows, chosen: Map, options: ImportOptions) -> list[str]:
    """Values against their units; what the user's word is taken against.

    Raises:
        InputError: They contradict them, and nobody says that they are right.
    """
    noise = (chosen.noise or {}).get("arw_deg_per_sqrt_h")
    found: list[Suspicion] = list(
        suspicions(rows.evidence, rows.layout, rows.units, earth_stated=chosen.earth_rate is not None, noise=noise)
    )
    for one in found:
        if not options.trust_units:
            expected = f'--{one.kind}-unit "{one.likely}", or --trust-units if the values are right as they are'
            raise InputError(f"{file.path.name}, column {one.column}", one.found, expected)
    return [f"{one.column}: {one.found}" for one in found]


_MAGIC = (
    (b"MATLAB 5.0", "mat"),
    (b"MATLAB 7.3", "hdf5"),
    (b"\x89HDF\r\n\x1a\n", "hdf5"),
    (b"PAR1", "parquet"),
    (b"CDF\x01", "netcdf"),
    (b"CDF\x02", "netcdf"),
    (b"CDF\x05", "netcdf"),
    (b"TDSm", "tdms"),
)
_NAMED = {".mat": "mat"}
_SHEETS = (b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/")
"""How the name of the first file in a spreadsheet begins."""
_PARSERS = {
    "mat": Parser(".importers.matfile", "open_mat", "scipy.io"),
    "hdf5": Parser(".importers.matfile", "open_hdf5", "h5py"),
    "parquet": Parser(".importers.parquet", "open_parquet", "pyarrow.parquet"),
    "spreadsheet": Parser(".importers.csv_table", "open_spreadsheet", "openpyxl", unpacks=True),
    "netcdf": Parser(".importers.netcdf", "open_netcdf", "xarray"),
    "tdms": Parser(".importers.tdms", "open_tdms", "nptdms"),
}
"""Formats that a library reads: each in a process of its own. CSV is split into lines and cells here."""
_GZIP, _ZIP, _ZIP_NAME = b"\x1f\x8b", b"PK\x03\x04", 30  # 30: where a name begins (APPNOTE.TXT, 4.3.7)
_REFUSED = (
    (b"PK\x03\x04", "a ZIP archive", "its files, unpacked"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd", "the file unpacked (unzstd)"),
    (b"\xd0\xcf\x11\xe0", "an old spreadsheet", "the sheet saved as CSV"),
)


def open_logger_file(path: Path, chosen: Map) -> LoggerFile:
    """Opens a file of any known format.

    Raises:
        InputError: It is of none, damaged, or its library is missing; the message says what goes on.
    """
    if path.is_dir():
        raise InputError(str(path), "is a folder", "files of a logger")
    opened, _ = open_input(path, path.name, "a file of a logger")
    with opened as file:
        head = file.read(1024)
    if head.startswith(_GZIP):
        return _unpacked(path, chosen)
    kind = _kind(path, head)
    for magic, what, instead in _REFUSED if kind is None else ():
        if head.startswith(magic):
            raise InputError(path.name, what, instead)
    return open_csv(path, chosen.csv.given()) if kind is None else open_confined(_PARSERS[kind], path)


def _kind(path: Path, head: bytes) -> str | None:
    """The parser of a file by its first bytes, then by its name; None: text."""
    if head.startswith(_ZIP):
        first = head[_ZIP_NAME : _ZIP_NAME + int.from_bytes(head[26:28], "little")]
        return "spreadsheet" if first.startswith(_SHEETS) else None
    kind = next((kind for magic, kind in _MAGIC if head.startswith(magic)), _NAMED.get(path.suffix.lower()))
    return "netcdf" if kind == "hdf5" and path.suffix.lower() in (".nc", ".nc4", ".cdf") else kind


def _unpacked(path: Path, chosen: Map) -> LoggerFile:
    """A file that gzip packed, by way of a scratch folder that is gone when the file is closed.

    Raises:
        InputError: It is damaged, packed twice, or larger than is allowed once unpacked.
    """
    if path.stem.lower().endswith(".gz"):
        raise InputError(path.name, "packed twice", "the file, packed once at most")
    with ExitStack() as stack:
        place = stack.enter_context(scratch_folder()) / (path.stem or "unpacked")
        size = 0
        try:
            with gzip.open(path) as packed, place.open("xb") as whole:
                while block := packed.read(_BLOCK_BYTES):
                    size += len(block)
                    refuse_above("recording_mib", size / 2**20, path.name, "MiB")
                    whole.write(block)
        except (OSError, EOFError, zlib.error) as error:
            what = " ".join(str(error).split())[:100]
            raise InputError(path.name, f"cannot be unpacked ({what})", "a whole .gz file") from error
        file = stack.enter_context(closing(open_logger_file(place, chosen)))
        return replace(file, path=path, close=stack.pop_all().close)
