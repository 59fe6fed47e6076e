"""The command `fleet`: many serials at once."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import CheckFailed
from .base import JsonOption, OutOption, app, progress, tell, write_json

if TYPE_CHECKING:
    from ..results.fleet import FleetEntry


@app.command()
def fleet(
    manifest: Annotated[
        Path, typer.Argument(help="A manifest (TOML), or a folder with a data set in each of its folders.")
    ],
    out: OutOption,
    jobs: Annotated[
        int, typer.Option("--jobs", min=1, max=256, help="Number of processes on this machine.")
    ] = 2,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", help="Address of a Dask scheduler to use instead.")
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Make a whole build of each: compiled, verified, with its report.")
    ] = False,
    json_file: JsonOption = None,
) -> None:
    """Read, fit, emit and check many gyros; write one summary, and name those that stand apart.

    What is done is not done again, and one that fails does not stop the others.

    Example: gyrotc fleet recordings --out fleet
    """
    from ..jobs.fleet import load_manifest, run_fleet, summary_of

    wanted = load_manifest(manifest)
    with progress() as say:
        say(f"{len(wanted.units)} gyros")
        entries = run_fleet(wanted, out, jobs=jobs, scheduler=scheduler, full=full, told=_tell_entry)
    summary = summary_of(entries)
    write_json(json_file, summary.content())
    for outlier in summary.outliers:
        tell(
            f"stands apart: {outlier.name}: {outlier.figure} {outlier.value:.4g}, median of the fleet "
            f"{outlier.median:.4g} ({outlier.sigmas:.1f} robust standard deviations)"
        )
    for copy in summary.copies:
        tell(
            f"copy of another: {copy.name} (serial {copy.serial}) has about {copy.share:.0%} of its rows in "
            f"common with {copy.other} (serial {copy.other_serial}): one gyro under two serials"
        )
    tell(f"{summary.done} of {summary.units} done, {summary.failed} failed: {out / 'fleet.html'}")
    if summary.failed:
        raise CheckFailed(f"{summary.failed} of {summary.units} gyros failed")


def _tell_entry(entry: FleetEntry) -> None:
    """One line a gyro."""
    text = f"{entry.name}: {entry.status}{' (done before)' if entry.kept else ''}"
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
