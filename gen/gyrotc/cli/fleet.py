"""Commands for many gyros: `fleet` and `lot`."""

from __future__ import annotations

import shlex
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..common.errors import CheckFailed
from ..common.progress import Progress
from ..common.texts import toml_key
from ..pages.display import sci, words
from .application import app
from .options import OutOption, written_place
from .output import tell
from .progress import progress

if TYPE_CHECKING:
    from ..results.fleet import FleetEntry, FleetSummary


@app.command()
def fleet(
    manifest: Annotated[
        Path,
        typer.Argument(help="A manifest (TOML, docs/fleet.md), or a folder with a data set in each of its folders."),
    ],
    out: OutOption,
    jobs: Annotated[int, typer.Option("--jobs", metavar="N", min=1, max=256, help="Processes on this machine.")] = 2,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", help="Address of a Dask scheduler to use instead; default: this machine."),
    ] = None,
) -> None:
    """Calibrate many gyros, and name those that are outliers.

    Each is read, fitted, emitted and checked. What is done is not done again, and one that fails does not stop the
    others.

    Example: gyrotc fleet recordings --out fleet
    """
    from ..fleet.manifest import load_manifest, printable
    from ..fleet.page import summary_of
    from ..fleet.run import Cluster, forgotten_units, run_fleet
    from ..results.release import VERDICTS

    wanted = load_manifest(manifest)
    cluster = Cluster(scheduler, say=tell) if scheduler else None
    with progress() as say:
        done = _Done(len(wanted.units), say)
        entries = run_fleet(wanted, out, jobs=jobs, cluster=cluster, done=done)
    summary = summary_of(entries)
    _tell_comparison(summary)
    for place in wanted.skipped:
        tell(f"{printable(str(place))}: no recordings and no dataset.toml, so no gyro", wrong=True)
    for name in forgotten_units(wanted, out):
        tell(
            f"{name}: its result in {out} stays, but {manifest} has no recordings of it: bring them back, or move the "
            "result away",
            wrong=True,
        )
    tell(f"{summary.done} of {summary.units} done, {summary.failed} failed: {out / 'fleet.html'}")
    verdicts = Counter(unit.verdict for unit in summary.serials if unit.verdict)
    if verdicts:
        tell("limits: " + ", ".join(f"{verdicts[verdict]} {verdict}" for verdict in VERDICTS))
    tell(f"next: {_after_fleet(summary, out)}")
    if summary.failed or summary.unfinished:
        left = f", {summary.unfinished} are not done yet" if summary.unfinished else ""
        raise CheckFailed(f"{summary.failed} of {summary.units} gyros failed{left}")


def _after_fleet(summary: FleetSummary, out: Path) -> str:
    """Return the one step after a fleet: mend what stopped gyros, else look at gyros, state limits, use the tables."""
    from ..fleet.manifest import RUNTIME

    if summary.unfinished:
        return "give the command again: it goes on with the gyros that are not done"
    stopped = [unit.name for unit in summary.serials if unit.status == "failed" and unit.verdict is None]
    if stopped:
        return f"mend what stopped {stopped[0]} (its line above), and give the command again"
    outliers = {outlier.name for outlier in summary.outliers} | {reason.name for reason in summary.reasons}
    suspect = [u.name for u in summary.serials if u.status == "failed" or u.barred or u.name in outliers]
    suspect = suspect or [u.name for u in summary.serials if u.verdict not in (None, "PASS")]
    if suspect:
        more = f", then at {len(suspect) - 1} more" if len(suspect) > 1 else ""
        return f"look at {suspect[0]}{more}: gyrotc report {shlex.quote(str(out / suspect[0]))}"
    if not any(unit.verdict for unit in summary.serials):
        return "state limits of the product in a manifest (docs/fleet.md), and give the command again with the manifest"
    return f"compile the tables in {out}/*/c with the runtime in {out / RUNTIME}"


def _tell_comparison(summary: FleetSummary) -> None:
    """A line for what each gyro was found by, when it was compared with the others, and one for each that is barred."""
    for reason in summary.reasons:
        tell(f"outlier: {reason.name}: {reason.text}")
    named = {reason.name for reason in summary.reasons}
    for outlier in (outlier for outlier in summary.outliers if outlier.name not in named):
        tell(
            f"outlier: {outlier.name}: {words(outlier.figure)}: {sci(outlier.value)}, median of its "
            f"axis {sci(outlier.median)} ({outlier.sigmas:.0f} robust standard deviations)"
        )
    for copy in summary.copies:
        tell(
            f"copy of another: {copy.name} (serial {copy.serial}) has {copy.words} with {copy.other} "
            f"(serial {copy.other_serial}): one gyro under two serials"
        )
    for unit in summary.serials:
        if unit.barred:
            tell(
                f"{unit.name}: not released, in no lot: {', '.join(unit.barred)}; look at it, or "
                f"release it in the manifest: [release] {toml_key(unit.serial or unit.name)} = REASON"
            )


class _Done:
    """Tells each gyro as it comes, and how many are done of those that had to be."""

    def __init__(self, total: int, say: Progress) -> None:
        self._waiting, self._say, self._done = total, say, 0
        self._report()

    def __call__(self, entry: FleetEntry) -> None:
        self._waiting -= entry.kept  # what is kept takes no time
        self._done += not entry.kept
        _tell_entry(entry)
        self._report()

    def _report(self) -> None:
        self._say(f"{self._done} of {self._waiting} gyros done", self._done, self._waiting)


def _tell_entry(entry: FleetEntry) -> None:
    """One line a gyro."""
    kept = " (done before)" if entry.kept else ""
    text = f"{entry.name}: {entry.status}{kept}"
    if entry.after_rms_dph is not None:
        floor = "" if entry.rms_over_floor is None else f" = {entry.rms_over_floor:.3f} x noise floor"
        text += (
            f"; RMS {sci(entry.after_rms_dph, 3)} deg/h{floor}, improvement {sci(entry.improvement)}, "
            f"{entry.centers} centers, {entry.table_bytes} bytes"
        )
    if entry.status != "done":
        text += f"; {entry.reason}"
    if entry.moved_to:
        text += f"; its earlier result had been changed and is now {entry.moved_to}"
    tell(text)


@app.command()
def lot(
    fleet: Annotated[Path, typer.Argument(help="The folder that gyrotc fleet wrote: fully calibrated units.")],
    out: Annotated[Path, typer.Option("--out", callback=written_place, help="File for the lot.")],
    axis: Annotated[
        str | None,
        typer.Option(
            "--axis", help="x, y or z of three-axis gyros: each axis is a lot of its own; default: gyros of one rate."
        ),
    ] = None,
) -> None:
    """Learn what gyros of one type share.

    The next ones then need fewer runs (build --lot).

    Example: gyrotc lot fleet --out lot.json
    """
    from ..jobs.lot import lot_of
    from ..results.folder import write_result
    from ..results.json_text import json_text

    with progress() as say:
        found = lot_of(fleet, axis=axis, progress=say)
    write_result(out, json_text(found.content()))
    checked = found.cross_validation
    tell(f"{out}: {found.text}")
    tell(
        f"a new unit, before any run: {sci(checked.left_rms_dph)} deg/h about the lot's map, "
        f"{sci(checked.constant_rms_dph)} about its own mean"
    )
