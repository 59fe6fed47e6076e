"""`gyrotc import`: files of a logger in, a data set out, with the map that reads the next file of that logger."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ... import __version__
from ...common.errors import InputError
from ...results.imported import ImportedFile, ImportedFiles, OriginalFile
from ...store.folder import result_folder
from ...store.opening import write_own
from ..plausible import Suspicion, suspicions
from ..schema import FILE
from ..values import MIN_ROWS
from .described import description_of, kept_map, run_name, serial_of, sha256_of, size_of
from .formats import open_logger_file
from .mapping import MAP_FILE, Map, map_text
from .propose import propose
from .rows import ImportedRows
from .runfile import Format, RunFile
from .tables import LoggerFile
from .told import preview, proposal, summary
from .unitchoice import Ask

__all__ = ["ImportOptions", "Imported", "import_files"]

Say = Callable[[str], None]
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """What is asked for besides files and map.

    Attributes:
        serial: Serial of the gyro; else that of the map, of the file, or the name of the folder.
        format: Format of the runs that are written.
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
                    rows=entry["rows"],
                    left_out=entry["left_out"],
                    trusted=tuple(entry["trusted"]),
                    source=OriginalFile(**entry["source"]),
                )
                for entry in self.runs
            ),
        )


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
        write_own(folder / MAP_FILE, map_text(chosen))
        write_own(folder / FILE, description_of(serial, chosen, entries))
    for line in summary(out, entries):
        tell(line)
    return Imported(serial, chosen, tuple(entries))


class _DryRun(Exception):
    """Ends a dry run."""


def _run(
    file: LoggerFile,
    rows: ImportedRows,
    target: Path,
    chosen: Map,
    options: ImportOptions,
    tell: Say,
    progress: Progress | None,
) -> dict[str, Any]:  # long: the stages of an import in their order
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
        "pulses": layout.pulses,
        "rows": rows.count,
        "left_out": dict(rows.left_out)
        | {k: v for t in file.tables for k, v in getattr(t, "remarks", {}).items() if v},
        "trusted": trusted,
        "evidence": rows.evidence,
        "source": {
            "file": file.path.name,
            "sha256": sha256_of(file.path),
            "bytes": size_of(file.path),
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
