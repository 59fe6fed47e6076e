"""Cost of whole commands, interpreter and imports included, as rows, runs, centers, units and files grow.

Rows: twelve runs of 8 h up to 10^8 rows. Gradient: as many rows of a gyro whose diagnosis adds a state to the table.
Runs: of 8 h in rows of 10 s. Centers: as many as are asked for. Units: serials of the paper's size.
"""

from __future__ import annotations

from collections.abc import Iterator

from ..campaigns import Settings
from ..page import Figure, ResultsTable, figures_table
from ..records import Record
from .commands import growth, slope
from .fleet import fleet
from .formats import formats
from .importing import importing

_SERIALS, _MEGABYTES = 1000, 2000.0
_TEXT = """
Whole commands with interpreter and imports. The exponent is that of the CPU seconds as a power of the size, between the
two largest sizes.
"""
_PEAK_MIB = 477.0
_CPU_S = {("runs", "fit"): 3.0, ("centers", "fit"): 4.0, ("rows", "fit"): 30.0}
_SLOPE = {"runs": 1.1, "centers": 1.3}


def measure(settings: Settings) -> Record:
    """Run every command at every size, a fleet, an import beside other readers, and a file of each format."""
    if settings.quick:
        return {**growth(quick=True), "fleet": fleet(2), "import": importing(2.0)}
    return {
        **growth(),
        "fleet": fleet(_SERIALS),
        "import": importing(_MEGABYTES),
        "formats": formats(),
    }


def table(record: Record) -> ResultsTable:
    """Return CPU seconds and peak memory with their aims."""
    parts = (_of_rows, _of_commands, _of_slopes, _of_a_build, _of_a_fleet, _of_an_import)
    return figures_table(_TEXT, [figure for part in parts for figure in part(record)])


def _of_rows(record: Record) -> Iterator[tuple[str, Figure]]:
    long = [row for row in record["rows"] if row["what"] in ("rows", "gradient")]
    if not long:  # of a quick run
        return
    commands = ", ".join(f"`{name}`" for name in dict.fromkeys(row["command"] for row in long))
    rows = max(row["sizes"][-1]["size"] for row in long)
    peak = max(row["sizes"][-1]["peak_mib"] for row in long)
    yield f"{commands} of {rows:,} rows, largest peak MiB", Figure(peak, ".0f", at_most=_PEAK_MIB)


def _of_commands(record: Record) -> Iterator[tuple[str, Figure]]:
    for row in record["rows"]:
        if (row["what"], row["command"]) in _CPU_S:
            largest, aim = row["sizes"][-1], _CPU_S[row["what"], row["command"]]
            words = f"`{row['command']}` of {largest['size']:,} {row['what']}, CPU seconds"
            yield words, Figure(largest["seconds"], ".1f", at_most=aim)


def _of_slopes(record: Record) -> Iterator[tuple[str, Figure]]:
    for row in record["rows"]:
        what = row["what"]
        if what in _SLOPE:
            exponent = Figure(slope(row["sizes"], "seconds"), ".2f", at_most=_SLOPE[what])
            yield f"exponent of `{row['command']}` over {what}", exponent


def _of_a_build(record: Record) -> Iterator[tuple[str, Figure]]:
    whole = next(one for one in record["stages"] if one["stage"] == "all")
    yield "first `build` of the paper's recordings, CPU seconds", Figure(whole["first_s"], ".1f", at_most=12.0)
    yield "a later `build` of another gyro, CPU seconds", Figure(whole["later_s"], ".1f", at_most=6.0)


def _of_a_fleet(record: Record) -> Iterator[tuple[str, Figure]]:
    fleet = record["fleet"]
    words = f"`fleet` of {fleet['serials']:,} serials"
    yield f"{words}, CPU seconds of a serial", Figure(fleet["cpu_s"] / fleet["serials"], ".2f")
    if "bytes" in fleet:
        kilobytes = fleet["bytes"] / fleet["serials"] / 1e3
        yield f"{words}, kB of a serial", Figure(kilobytes, ".0f", at_most=80.0)
    yield f"{words}, serials that failed", Figure(fleet["failed"], "d", at_most=0)
    yield (
        f"{words}, RMS ÷ estimated noise floor, median",
        Figure(fleet["rms_over_floor"]["median"], ".4f", at_most=1.01),
    )
    yield f"`lot` of {fleet['serials']:,} units, CPU seconds", Figure(fleet["lot_s"], ".1f", at_most=15.0)
    yield f"`lot` of {fleet['serials']:,} units, peak MiB", Figure(fleet["lot_mib"], ".0f", at_most=381.0)


def _of_an_import(record: Record) -> Iterator[tuple[str, Figure]]:
    found = record["import"]
    words = f"`import` of a CSV file of {found['rows']:,} rows, peak MiB"
    yield words, Figure(found["readers"]["gyrotc import"]["peak_mib"], ".0f", at_most=1024.0)
