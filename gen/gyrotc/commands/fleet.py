"""The command `fleet`: many serials at once."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import CheckFailed
from .base import JsonOption, OutOption, app, progress, tell, time_left, write_json

if TYPE_CHECKING:
    from ..results.fleet import FleetEntry, FleetSummary


@app.command()
def fleet(
    manifest: Annotated[
        Path, typer.Argument(help="A manifest (TOML), or a folder with a data set in each of its folders.")
    ],
    out: OutOption,
    jobs: Annotated[int, typer.Option("--jobs", min=1, max=256, help="Processes on this machine.")] = 2,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", help="Address of a Dask scheduler to use instead.")
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="A whole build for each: compiled, verified, with its report.")
    ] = False,
    json_file: JsonOption = None,
) -> None:
    """Many serials: read, fit, emit and check each; one summary, and those that stand apart.

    What is done is not done again, and one that fails does not stop the others.

    Example: gyrotc fleet recordings --out fleet
    """
    from ..jobs.fleet import load_manifest, run_fleet, summary_of

    wanted = load_manifest(manifest)
    with progress() as say:
        told = _Told(len(wanted.units), say)
        entries = run_fleet(wanted, out, jobs=jobs, scheduler=scheduler, full=full, told=told)
    summary = summary_of(entries)
    write_json(json_file, summary.content())
    _tell_comparison(summary)
    tell(f"{summary.done} of {summary.units} done, {summary.failed} failed: {out / 'fleet.html'}")
    if summary.failed:
        raise CheckFailed(f"{summary.failed} of {summary.units} gyros failed")


def _tell_comparison(summary: FleetSummary) -> None:
    """A line for what each gyro was found by, when it was compared with the others."""
    from ..pages.words import words

    for reason in summary.apart:
        tell(f"stands apart: {reason.name}: {reason.text}")
    named = {reason.name for reason in summary.apart}
    for outlier in (outlier for outlier in summary.outliers if outlier.name not in named):
        tell(
            f"stands apart: {outlier.name}: {words(outlier.figure)}: {outlier.value:.3g}, median of its "
            f"axis {outlier.median:.3g} ({outlier.sigmas:.0f} robust standard deviations)"
        )
    for copy in summary.copies:
        tell(
            f"copy of another: {copy.name} (serial {copy.serial}) has about {copy.share:.0%} of its rows in "
            f"common with {copy.other} (serial {copy.other_serial}): one gyro under two serials"
        )


class _Told:
    """Tells each gyro as it comes, and how many are left."""

    def __init__(self, total: int, say: Callable[[str], None]) -> None:
        self._total, self._say, self._start = total, say, time.monotonic()
        self._seen, self._done = 0, 0
        say(f"{total} gyros")

    def __call__(self, entry: FleetEntry) -> None:
        self._seen += 1
        self._done += not entry.kept  # what is kept takes no time
        _tell_entry(entry)
        left = time_left(self._done, self._total - self._seen + self._done, time.monotonic() - self._start)
        self._say(f"{self._seen} of {self._total} gyros{left}")


def _tell_entry(entry: FleetEntry) -> None:
    """One line a gyro."""
    kept = " (done before)" if entry.kept else ""
    text = f"{entry.name}: {entry.status}{kept}"
    if entry.after_rms_dph is not None:
        floor = "" if entry.rms_over_floor is None else f" = {entry.rms_over_floor:.3f} x noise floor"
        text += (
            f"; RMS {entry.before_rms_dph:.3e} -> {entry.after_rms_dph:.3e} deg/h{floor}, "
            f"{entry.centers} centers, {entry.table_bytes} bytes"
        )
    if entry.status != "done":
        text += f"; {entry.reason}"
    if entry.aside:
        text += f"; its earlier result had been changed and is now {entry.aside}"
    tell(text)
