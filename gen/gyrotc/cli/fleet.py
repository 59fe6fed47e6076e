"""The commands `fleet`, `catalogue` and `lot`: many serials at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..common.errors import CheckFailed, InputError
from ..pages.display import displayed, in_unit, rate_unit, shown
from ..pages.words import sci, words
from .base import (
    LOT,
    DisplayOption,
    JsonOption,
    LotOption,
    OutOption,
    app,
    lot_in,
    progress,
    tell,
    time_left,
    write_json,
    written_place,
)

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
    wait: Annotated[
        int,
        typer.Option("--wait", min=1, help="Seconds for which a fleet without any worker of --scheduler waits."),
    ] = 60,
    full: Annotated[
        bool, typer.Option("--full", help="A whole build for each: compiled, verified, with its report.")
    ] = False,
    tag: Annotated[str, typer.Option("--tag", help="Goes into the catalogue with what is new, e.g. a release.")] = "",
    shard: Annotated[
        str | None,
        typer.Option("--shard", help="k/N: only this share, without the summary; for arrays of jobs."),
    ] = None,
    gathered: Annotated[bool, typer.Option("--gather", help="Only the summary of what shares have done.")] = False,
    release: Annotated[
        list[str] | None,
        typer.Option("--release", metavar="SERIAL", help="Release it although a finding bars it."),
    ] = None,
    why: Annotated[str, typer.Option("--reason", help="Why, for --release.")] = "",
    lot: LotOption = None,
    display: DisplayOption = None,
    json_file: JsonOption = None,
) -> None:
    """Many serials: read, fit, emit and check each; one summary, and those that are outliers.

    What is done is not done again, and one that fails does not stop the others.

    Example: gyrotc fleet recordings --out fleet
    """
    from ..fleet.manifest import load_manifest, share_of
    from ..fleet.page import summary_of
    from ..fleet.run import Cluster, gather, run_fleet, run_share

    share = share_of(shard) if shard else None
    if bool(release) != bool(why.strip()):
        raise InputError("--release", "and --reason go together", "--release SERIAL --reason TEXT")
    releases = dict.fromkeys(release or (), " ".join(why.split()))
    if share and gathered:
        raise InputError("--gather", "goes with no --shard", "one of them")
    wanted = load_manifest(manifest)
    options = replace(wanted.options, prior=lot_in(lot))
    wanted = replace(wanted, options=options, display=display or wanted.display)
    cluster = Cluster(scheduler, wait, tell) if scheduler else None
    with displayed(wanted.display), progress() as say:
        done = _Done(len(wanted.units), say)
        if share:
            entries = run_share(wanted, out, share, jobs=jobs, cluster=cluster, full=full, done=done)
        elif gathered:
            entries = gather(wanted, out, full=full, tag=tag, releases=releases, done=done)
        else:
            entries = run_fleet(
                wanted, out, jobs=jobs, cluster=cluster, full=full, tag=tag, releases=releases, done=done
            )
    if share:
        _tell_share(shard or "", entries)
        return
    summary = summary_of(entries)
    write_json(json_file, summary.content())
    with displayed(wanted.display):
        _tell_comparison(shown(summary))
    tell(f"{summary.done} of {summary.units} done, {summary.failed} failed: {out / 'fleet.html'}")
    if summary.failed or summary.unfinished:
        left = f", {summary.unfinished} are not done yet" if summary.unfinished else ""
        raise CheckFailed(f"{summary.failed} of {summary.units} gyros failed{left}")


def _tell_share(name: str, entries: Sequence[FleetEntry]) -> None:
    done = sum(entry.status == "done" for entry in entries)
    tell(f"share {name}: {done} of {len(entries)} done; gyrotc fleet --gather makes the summary")
    if done < len(entries):
        raise CheckFailed(f"{len(entries) - done} of {len(entries)} gyros of the share are not done")


@app.command()
def catalogue(
    place: Annotated[Path, typer.Argument(help="The --out of fleet, or a catalogue.sqlite.")],
    serial: Annotated[str | None, typer.Argument(help="Which table may this gyro carry?")] = None,
    day: Annotated[str | None, typer.Option("--on", help="On this day, ISO 8601; default today.")] = None,
    exported: Annotated[
        str | None,
        typer.Option("--export", metavar="SERIAL", help="Write the complete result of this gyro to --out."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for --export.")] = None,
    withdrawn: Annotated[
        str | None,
        typer.Option("--withdraw", metavar="HASH", help="Mark the model of this hash as withdrawn."),
    ] = None,
    display: DisplayOption = None,
    json_file: JsonOption = None,
) -> None:
    """Which table a gyro may carry on a day, and from which data; without a serial the last calibrations.

    --export writes the folder that a firmware engineer gets, with what a fleet keeps once for all gyros or not at
    all. Exit status 1 where there is no table.

    Example: gyrotc catalogue fleet RLG-0042 --on 2026-09-01
    """
    from ..fleet.catalogue import catalogued, export, withdraw

    asked = _day(day)
    if withdrawn is not None:
        if exported is not None or serial is not None:
            raise InputError("--withdraw", "goes with no serial", "--withdraw HASH alone")
        tell(f"{place}: {withdraw(place, withdrawn)} calibrations withdrawn")
        return
    if exported is not None:
        if out is None or serial is not None:
            raise InputError("--export", "goes with --out and no other serial", "--export SERIAL --out DIR")
        serial = exported
    answer = catalogued(place, serial, asked)
    if exported is not None and out is not None and answer.found:
        export(place, exported, asked, out)
    write_json(json_file, answer.content())
    for one in shown(answer).found:
        until = f" to {one.valid_until}" if one.valid_until else ""
        spread = f", U {sci(one.expanded_dph, 1)} {rate_unit()}" if one.expanded_dph is not None else ""
        tell(
            f"{one.serial}{f' axis {one.axis}' if one.axis else ''}: {one.valid_from or 'no date'}{until}, "
            f"{one.verdict or one.status}{f', {one.tag}' if one.tag else ''}{spread}"
        )
        tell(f"  model {one.model_hash or 'none: the job failed without one'}")
        if one.image_sha256:
            tell(f"  image {one.image_sha256}")
        for file in one.recordings if serial else ():
            tell(f"  {file.role} {file.file} {file.sha256}")
    if exported is not None and answer.found:
        tell(f"{out}: complete")
    if serial is None:
        tell(f"{answer.calibrations} calibrations in all")
    elif not answer.found:
        raise CheckFailed(f"{serial} may carry no table of this catalogue on {asked}")


def _day(text: str | None) -> str:
    try:
        return (date.fromisoformat(text) if text else date.today()).isoformat()
    except ValueError as error:
        raise InputError("--on", repr(text), "a day such as 2026-09-01") from error


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
                f"{unit.name}: not in the catalogue, in no lot: {', '.join(unit.barred)}; look at it, or "
                f"--release {unit.serial} --reason TEXT"
            )


class _Done:
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
        before, after = in_unit([entry.before_rms_dph or 0.0, entry.after_rms_dph])
        text += (
            f"; RMS {sci(float(before), 3)} -> {sci(float(after), 3)} {rate_unit()}{floor}, "
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
        typer.Option("--axis", help="x, y or z of three-axis gyros: each axis is a lot of its own."),
    ] = None,
    earlier: Annotated[
        Path | None,
        typer.Option("--earlier", help="An earlier fleet of the same units: how they age, for learning in service."),
    ] = None,
    display: DisplayOption = None,
) -> None:
    """Learn what units of one type share, so that the next ones need fewer runs (build --lot).

    Example: gyrotc lot fleet --out lot.json
    """
    from ..lot.job import lot_of
    from ..store.files import json_text
    from ..store.folder import write_result

    with progress(LOT) as say:
        found = lot_of(fleet, axis=axis, earlier=earlier, progress=say)
    write_result(out, json_text(found.content()))
    checked = shown(found.cross_validation)
    tell(f"{out}: {found.text}")
    tell(
        f"a new unit, before any run: {sci(checked.left_rms_dph)} {rate_unit()} about the lot's map, "
        f"{sci(checked.constant_rms_dph)} about its own mean"
    )
    if found.ageing is not None:
        ageing = shown(found.ageing)
        tell(
            f"ageing, by {ageing.units} units after {ageing.months:.1f} months: level "
            f"{sci(ageing.level_dph_per_sqrt_month)} {rate_unit()}/√month, along T "
            f"{sci(ageing.shape_dph_per_sqrt_month_c)} {rate_unit()}/√(month C)"
        )
