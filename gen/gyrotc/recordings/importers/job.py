"""`gyrotc import`: files of a logger in, a data set out, with the map that reads the next file of that logger.

Which importer reads a file is known from its first bytes, and from the ending of its name where these say nothing.
"""

from __future__ import annotations

import gzip
import hashlib
import re
import shlex
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from pydantic_core import PydanticCustomError

from ... import __version__
from ...common.errors import InputError, quoted, short_reason
from ...common.inputs import open_input, refuse_above
from ...common.progress import Progress, silent
from ...results.base import ADVICE, Finding
from ...results.files import write_own
from ...results.folder import Stage, result_folder, scratch_folder
from ...results.recordings import ImportedFile, ImportedFiles, OriginalFile
from ..child import open_in_child
from ..description import FILE, MIN_ROWS, Problems, SourceEntry, check_serial, dataset_toml, parse_description
from ..plausibility import TRUSTED, Suspicion, suspicions
from ..reading import Evidence
from ..tables import LoggerFile, LoggerTable
from .csv_table import open_csv
from .map_file import MAP_FILE, Choice, ImportPlan, JoinMap, Map, map_text
from .propose import Ask, propose
from .recognise import format_of
from .rows import NAMES_OF_COLUMNS, ImportedRows, RowsChunk, RunFile
from .selection import NO_DEVICE

_BLOCK_BYTES = 2**22  # of a read: bounds memory


def kept_map(chosen: Map, file: LoggerFile, plan: ImportPlan, rows: ImportedRows) -> Map:
    """The map with every choice that was made."""
    columns: dict[str, Any] = {choice.role: choice.source for choice in (*plan.values, plan.temperature)}
    columns["device"] = next(iter(rows.device.names), chosen.columns.device)
    if plan.time:
        columns["time"] = tuple(choice.column.name for choice in plan.time)
    units = dict(chosen.units)
    if plan.time and plan.time[0].unit:
        units["time"] = plan.time[0].unit
    units["temperature"] = plan.temperature.unit or ""
    if plan.values[0].unit:
        units["rate"] = plan.values[0].unit
    units |= {choice.role: choice.unit for choice in plan.channels if choice.unit and choice.role in rows.units}
    time = chosen.time.model_copy(update={"format": rows.clock.form or None, "rate_hz": plan.rate_hz})
    csv = file.csv | chosen.csv.given()
    update = {
        "columns": columns,
        "channels": {choice.role: choice.source for choice in plan.channels},
        "units": units,
        "csv": csv,
        "time": time.model_dump(),
    }
    return Map.model_validate(chosen.model_dump() | update)


def serial_of(stated: str | None, chosen: Map, file: LoggerFile, device: str, out: Path) -> str:
    """Serial of the gyro: as stated, else of the map, the column of devices, the file, or the name of the folder.

    Raises:
        InputError: It is no legal serial.
    """
    in_file = next((v for k, v in file.facts.items() if re.fullmatch(r"serial( ?(no|nr|number))?\.?", k)), None)
    if device and chosen.serial not in (None, device) and not stated:
        found = f"the rows are of {quoted(device)}, and the map is of {chosen.serial!r}"
        raise InputError(file.path.name, found, f"--serial {chosen.serial}, or --serial with that of the gyro")
    in_file = device or in_file
    known = stated or chosen.serial or (re.sub(r"[^A-Za-z0-9._-]+", "-", in_file) if in_file else None)
    serial = known or out.resolve().name
    try:
        return check_serial(serial)
    except PydanticCustomError as error:
        where = "--serial" if stated else f"the serial {'in the file' if known else 'from the name of the folder'}"
        raise InputError(where, quoted(serial), f"{error.message()}; --serial names one") from error


def run_name(path: Path, taken: set[str]) -> str:
    """A plain name for a run, from that of its file."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-.") or "run"
    name, k = plain, 2
    while name in taken:
        name, k = f"{plain}-{k}", k + 1
    taken.add(name)
    return name


@dataclass(frozen=True, slots=True)
class ImportedRun:
    """A run that was written, and the file that it is of.

    Attributes:
        file: Name of the run in the data set.
        sources: The logger's file, and those that were joined to it.
        started: Time of its first row where it is known.
        device: Name of the gyro in the rows; empty: no column says it.
        read: Rows of the file.
        above: Lines of text above them.
        rows: Rows that were written.
        left_out: Rows that were not, by the reason.
        notes: What the file says, or shows, of rows that it lacks.
        trusted: What units were taken against.
        pulses: Whether pulses were counted.
        evidence: Ranges and means of the rows.
        period_s: Shortest and longest step from row to row, s.
        exam: The run judges the correction and is not trained on.
    """

    file: str
    sources: tuple[SourceEntry, ...]
    started: datetime | None
    device: str
    read: int
    above: int
    rows: int
    left_out: Mapping[str, int]
    notes: tuple[str, ...]
    trusted: tuple[str, ...]
    pulses: bool
    evidence: Evidence
    period_s: tuple[float, float]
    exam: bool = False

    def result(self) -> ImportedFile:
        """Return what the result of `gyrotc import` states of the run."""
        source, *joined = (OriginalFile(**one.model_dump()) for one in self.sources)
        return ImportedFile(
            file=self.file,
            read=self.read,
            above=self.above,
            rows=self.rows,
            left_out=dict(self.left_out),
            trusted=self.trusted,
            source=source,
            joined=tuple(joined),
        )


def description_of(serial: str, chosen: Map, runs: Sequence[ImportedRun]) -> str:
    """`dataset.toml` of imported runs."""
    head: dict[str, Any] = {"schema": 1, "serial": serial}
    for key in ("description", "earth_rate", "latitude_deg", "pulse_weight_arcsec"):
        if getattr(chosen, key) not in (None, ""):
            head[key] = getattr(chosen, key)
    if any(run.trusted for run in runs):
        head["trust_units"] = True
    sources = [source.model_dump() for run in runs for source in run.sources]
    tables: dict[str, Any] = {"source": sources[0] if len(sources) == 1 else sources}
    if chosen.meta:
        tables["meta"] = chosen.meta
    if chosen.noise:
        tables["noise"] = chosen.noise.model_dump(exclude_none=True)
    return dataset_toml(head, tables, [dict(_run_entry(run)) for run in runs])


def _run_entry(run: ImportedRun) -> Iterator[tuple[str, Any]]:
    yield "file", run.file
    if run.exam:
        yield "role", "exam"
    if run.started is not None:
        yield "started", run.started
    yield "power_on_s", "unknown"


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK_BYTES):
            digest.update(block)
    return digest.hexdigest()


_NATIVE = {"time": "s", "temperature": "C", "rate": "deg/h"}
_OF_TEXTS = "no numbers; --set where picks rows by what stands there"
_MOST_NAMES = 12  # that are listed in a line of a terminal


def proposal(file: LoggerFile, plan: ImportPlan, rows: ImportedRows) -> Iterator[str]:
    """Yield the interpretation of a file, a line for each column."""
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
    if rows.clock.runs_ahead:
        yield "  the stamps lie in the future: the clock of the logger was wrong, and when the run started is left out"
    if rows.clock.needs_zone:
        yield "  the stamps have no zone: when the run started is left out (--set time.zone=Europe/Berlin would say it)"
    if plan.where:
        yield _line("rows", str(plan.where), "", "as stated")
    if plan.device:
        yield _line("device", plan.device.name, "", "its name, or as stated: one gyro in all rows")
    for left, words in (
        (plan.left_out, " ([channels] of the map takes them)"),
        (plan.texts, f" ({_OF_TEXTS})"),
        (file.unread, ""),
    ):
        if left:
            more = f" and {len(left) - _MOST_NAMES} more" if len(left) > _MOST_NAMES else ""
            yield f"  left out: {', '.join(left[:_MOST_NAMES])}{more}{words}"


def preview(rows: ImportedRows) -> Iterator[str]:
    """The first rows as the file has them and as they become."""
    for k in range(min(3, len(next(iter(rows.raw.values()), [])))):
        before = ", ".join(f"{name} {values[k]}" for name, values in rows.raw.items())
        after = ", ".join(f"{name} {values[k]:.10g}" for name, values in rows.first_rows.items())
        yield f"  row {k + 1}: {before or '-'}  ->  {after}"


def import_summary(out: Path, runs: Sequence[ImportedRun]) -> Iterator[str]:
    """Yield a summary of the runs that were written."""
    for run in runs:
        yield f"{out / run.file}: {_counted(run)}"
        for text in run.trusted:
            yield f"  {TRUSTED}{text}"
        yield from (f"  {note}" for note in run.notes)
    kept = out / "map.toml"
    yield f"{kept}: reads the next file of this logger: gyrotc import FILE --map {kept} --out ..."


def _counted(run: ImportedRun) -> str:
    """Rows, their period, temperatures and mean, and where each row of the file is."""
    low, high = run.evidence.temperature_c
    means = ", ".join(f"{mean:.4g}" for mean in np.atleast_1d(run.evidence.cells[:, 2:].mean(axis=0)))
    left = "".join(f", {count} left out: {reason}" for reason, count in run.left_out.items())
    above = f"; lines of text above them: {run.above}" if run.above else ""
    return (
        f"{run.rows} rows of {_period(*run.period_s)} s, {low:.4g} ... {high:.4g} C, "
        f"mean {means} {'pulses a row' if run.pulses else 'deg/h'}; {run.read} read{left}{above}"
    )


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


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """Options of an import besides files and map.

    Attributes:
        serial: Serial of the gyro; else that of the map, of the file, or the name of the folder.
        trust_units: Values that contradict their units are taken; it is recorded.
        dry_run: Read the files and tell how, but write nothing.
        exam: The last file is the exam, which judges the correction and is not trained on; None: a person is asked.
    """

    serial: str | None = None
    trust_units: bool = False
    dry_run: bool = False
    exam: bool | None = None


@dataclass(frozen=True, slots=True)
class Imported:
    """An imported data set: the serial, the map that was kept, and the runs."""

    serial: str
    map: Map
    runs: tuple[ImportedRun, ...]

    def result(self) -> ImportedFiles:
        """Return the result of `gyrotc import`."""
        return ImportedFiles(
            gyrotc_version=__version__,
            serial=self.serial,
            axis=None,
            map={k: v for k, v in self.map.model_dump(mode="json").items() if v not in (None, "", {}, [], False)},
            runs=tuple(run.result() for run in self.runs),
            findings=self.findings(),
        )

    def findings(self) -> tuple[Finding, ...]:
        """Return findings about rows that were left out and units that contradict their values, as `check` has them."""
        said = [
            (id, run.file, text)
            for run in self.runs
            for id, texts in (
                ("left_out", [f"{rows} rows are left out: {reason}" for reason, rows in run.left_out.items()]),
                ("left_out", run.notes),
                ("units_trusted", [TRUSTED + text for text in run.trusted]),
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
    progress: Progress = silent,
) -> Imported | None:
    """Import files, each as a run, into a new folder.

    Args:
        chosen: What is known of the logger; what it leaves open is proposed from the first file.
        ask: Asks a person for a unit that stands nowhere.
        say: Called with the proposal, the preview and what was written, line by line.
        progress: Takes note of every part of a file.

    Returns:
        What was written; None after a dry run.

    Raises:
        InputError: Something that cannot be taken; nothing is written.
    """
    tell = say or (lambda _: None)
    reading = _Import(files, out, options, ask or (lambda _: None), tell, progress)
    if options.dry_run:
        for run in reading.runs(chosen, None):
            tell(f"{run.file}: {_counted(run)}")
        tell("dry run: nothing was written")
        return None
    exam = _last_is_exam(files, options, ask or (lambda _: None))
    with result_folder(out, "import", inputs=files) as stage:
        runs = list(reading.runs(chosen, stage))
        runs[-1] = replace(runs[-1], exam=exam)
        kept = reading.kept.model_copy(update={"serial": reading.serial})
        write_own(stage.folder / MAP_FILE, map_text(kept))
        write_own(stage.folder / FILE, description_of(reading.serial, kept, runs))
    for line in import_summary(out, runs):
        tell(line)
    tell(_judged_by(runs))
    return Imported(reading.serial, kept, tuple(runs))


class _Import:
    """Reads files, each as a run of one gyro; the first one decides what the map leaves open.

    Attributes:
        serial: Serial of the gyro, known with the first file.
        kept: The map with every choice that was made.
    """

    def __init__(
        self,
        files: Sequence[Path],
        out: Path,
        options: ImportOptions,
        ask: Ask,
        tell: Say,
        progress: Progress,
    ) -> None:
        self.serial = ""
        self.kept = Map()
        self._files, self._out, self._options = files, out, options
        self._ask, self._tell, self._progress = ask, tell, progress
        self._done = 0  # files

    def runs(self, chosen: Map, stage: Stage | None) -> Iterator[ImportedRun]:
        """The runs, one after the other.

        Args:
            stage: Where they are written; None: nowhere.

        Raises:
            InputError: A file that cannot be taken, or files of several gyros.
        """
        _refuse_loss(self._files, self._out)
        names: set[str] = set()
        devices: dict[str, str] = {}
        self.kept = chosen
        for path in self._files:
            with ExitStack() as stack:
                file = stack.enter_context(closing(open_logger_file(path, self.kept)))
                file = with_joined(file, self.kept.join, stack)
                plan = propose(file, self.kept, self._ask)
                rows = ImportedRows(path.name, plan, self.kept)
                for line in proposal(file, plan, rows):
                    self._tell(line)
                chunks = rows.chunks()
                first = next(chunks, None)
                self.kept = kept_map(self.kept, file, plan, rows)  # the first rows tell whether a column names gyros
                if not self.serial:
                    self.serial = serial_of(self._options.serial, self.kept, file, rows.device.name, self._out)
                    if stage is not None:
                        stage.of(self.serial)
                name = f"{run_name(path, names)}.parquet"
                target = stage.folder / name if stage is not None else None
                run = self._run(file, rows, chain([first] if first else [], chunks), name, target)
                devices.setdefault(run.device, path.name)
                if len(devices) > 1:
                    raise _of_several(devices)
                self._done += 1
                yield run

    def _run(
        self, file: LoggerFile, rows: ImportedRows, chunks: Iterable[RowsChunk], name: str, target: Path | None
    ) -> ImportedRun:
        """Read one file, and write its run if there is a target."""
        layout = rows.layout
        columns_of = ["time_s", "temperature_c", *(layout.axes.values() or [layout.value]), *layout.channels]
        with ExitStack() as stack:
            sink = stack.enter_context(RunFile(target, "parquet", columns_of)) if target else None
            for k, (columns, done) in enumerate(chunks):
                for line in preview(rows) if k == 0 else ():
                    self._tell(line)
                if sink is not None:
                    sink.write(columns)
                self._progress(file.path.name, self._done + done, len(self._files))
        if rows.count < MIN_ROWS:
            left = ", ".join(f"{count} with {reason}" for reason, count in rows.left_out.items())
            found = f"{rows.count} rows" + (f" ({left})" if left else "")
            raise InputError(file.path.name, found, f"at least {MIN_ROWS}" + rows.hint())
        return ImportedRun(
            file=name,
            sources=tuple(_source(path, name) for path in (file.path, *file.joined)),
            started=rows.clock.started,
            device=rows.device.name,
            read=rows.read,
            above=rows.plan.main.above,
            rows=rows.count,
            left_out=rows.left_out,
            notes=(*rows.plan.main.notes, *rows.notes()),
            trusted=tuple(_judged(file, rows, self.kept, self._options)),
            pulses=layout.pulses,
            evidence=rows.evidence,
            period_s=rows.period_s,
        )


def _source(path: Path, run: str) -> SourceEntry:
    return SourceEntry(
        file=path.name,
        sha256=sha256_of(path),
        bytes=path.stat().st_size,
        imported_by=f"gyrotc {__version__}",
        map=MAP_FILE,
        run=run,
    )


def _of_several(devices: Mapping[str, str]) -> InputError:
    """The refusal of files of several gyros, by the file of each."""
    (first, file), (second, other) = list(devices.items())[:2]
    found = (
        f"the rows are of {quoted(second or 'no named gyro')}, those of {file} of {quoted(first or 'no named gyro')}"
    )
    expected = f"a data set for each gyro, or --column device={NO_DEVICE} if they are of one"
    return InputError(other, found, expected)


def _refuse_loss(files: Sequence[Path], out: Path) -> None:
    """Refuse to replace an imported data set by one that lacks some of its recordings.

    Raises:
        InputError: `out` holds recordings of other files.
    """
    if not (out / FILE).is_file():
        return
    description = parse_description(out / FILE, Problems(collect=True))
    earlier = dict.fromkeys(source.file for source in (description.source if description else ()) if source.run)
    names = {path.name for path in files}
    lost = [name for name in earlier if name not in names]
    if lost:
        every = " ".join(shlex.quote(name) for name in [*lost, *(str(path) for path in files)])
        found = f"holds the recordings of {', '.join(lost)}, which this import would remove"
        expected = f"all files in one command, `gyrotc import {every} --out {out}`, or another --out"
        raise InputError(str(out), found, expected)


def _last_is_exam(files: Sequence[Path], options: ImportOptions, ask: Ask) -> bool:
    """Decide whether the last run is a test run: as stated, else as a person answers, else not.

    Raises:
        InputError: There is only one run.
    """
    if options.exam and len(files) < 2:
        raise InputError("--exam", "with one file, which training needs", "two files or more")
    if options.exam is not None or options.dry_run or len(files) < 2:
        return bool(options.exam)
    answer = ask(f"Is {files[-1].name} a test run, which judges the correction and is not trained on? [y/N]")
    return (answer or "").lower() in ("y", "yes")


def _judged_by(runs: Sequence[ImportedRun]) -> str:
    """Return a sentence about the runs that will judge a correction."""
    if runs[-1].exam:
        return f"{runs[-1].file} is the test run; the other runs are trained on"
    hint = "" if len(runs) < 2 else ": --exam makes the last run a test run"
    return f"every run is trained on, so a correction is judged by parts left out in turn{hint}"


def _judged(file: LoggerFile, rows: ImportedRows, chosen: Map, options: ImportOptions) -> list[str]:
    """Compare values with their units, and return the contradictions that the user's word overrules.

    Raises:
        InputError: They contradict them, and nobody says that they are right.
    """
    noise = chosen.noise.arw_deg_per_sqrt_h if chosen.noise else None
    found: list[Suspicion] = list(
        suspicions(rows.evidence, rows.layout, rows.units, earth_stated=chosen.earth_rate is not None, noise=noise)
    )
    for one in found:
        if not options.trust_units:
            expected = f"--{one.kind}-unit {one.unit}, or --trust-units if the values are right as they are"
            raise InputError(f"{file.path.name}, column {one.column}", one.found, expected)
    return [f"{one.column}: {one.found}" for one in found]


_GZIP = b"\x1f\x8b"
_REFUSED = (
    (b"\x28\xb5\x2f\xfd", "compressed by zstd", "the file unpacked (unzstd)"),
    (b"\xd0\xcf\x11\xe0", "an old spreadsheet", "the sheet saved as CSV"),
)


def open_logger_file(path: Path, chosen: Map) -> LoggerFile:
    """Open a file of any known format.

    Raises:
        InputError: It is of none, damaged, or its library is missing; the message says what goes on.
    """
    if path.is_dir():
        raise InputError(str(path), "is a folder", "files of a logger")
    head = _head(path)
    return _unpacked(path, chosen) if head.startswith(_GZIP) else _opened(path, head, chosen)


def with_joined(file: LoggerFile, joins: Sequence[JoinMap], stack: ExitStack) -> LoggerFile:
    """A file with the tables of the files that are joined to it.

    Args:
        stack: Closes what is opened.
    """
    tables: list[LoggerTable] = []
    for join in joins:
        other = stack.enter_context(closing(open_logger_file(Path(join.file), Map())))
        for table in other.tables:
            name = f"{other.path.name}/{table.name}" if table.name else other.path.name
            tables.append(replace(table, name=name, tolerance_s=join.tolerance_s))
    return replace(file, tables=(*file.tables, *tables), joined=tuple(Path(join.file) for join in joins))


def _head(path: Path) -> bytes:
    opened, _ = open_input(path, path.name, "a file of a logger")
    with opened as file:
        return file.read(1024)


def _opened(path: Path, head: bytes, chosen: Map) -> LoggerFile:
    kind = format_of(path, head)
    for magic, what, instead in _REFUSED if kind is None else ():
        if head.startswith(magic):
            raise InputError(path.name, what, instead)
    if kind is None:
        return open_csv(path, chosen.csv)
    return open_in_child(kind.open, path) if kind.in_child else kind.open(path)


def _unpacked(path: Path, chosen: Map) -> LoggerFile:
    """A file that gzip packed, by way of a scratch folder that is gone when the file is closed.

    Raises:
        InputError: It is damaged, packed twice, or larger than is allowed once unpacked.
    """
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
            raise InputError(path.name, f"cannot be unpacked ({short_reason(error)})", "a whole .gz file") from error
        head = _head(place)
        if head.startswith(_GZIP):
            name, once = shlex.quote(path.name), shlex.quote(f"once-{path.name}")
            raise InputError(path.name, "is packed twice", f"one layer of gzip: `gunzip -c {name} > {once}`")
        file = stack.enter_context(closing(_opened(place, head, chosen)))
        return replace(file, path=path, close=stack.pop_all().close)
