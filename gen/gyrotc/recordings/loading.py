"""A folder becomes a data set: description, files, runs; each problem is reported with file and field."""

from __future__ import annotations

import shlex
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import combinations
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic_core import PydanticCustomError, ValidationError

from ..common.arrays import FloatArray
from ..common.errors import InputError, quoted
from ..common.inputs import refuse_above, refused
from ..results.files import sha256
from .description import (
    FILE,
    MIN_ROWS,
    UNKNOWN_SERIAL,
    Description,
    Problems,
    RunEntry,
    arrange,
    check_serial,
    parse_description,
)
from .fingerprints import sketch
from .fit_options import options_in
from .overlap import counted_once, shared_rows
from .plausibility import TRUSTED, Suspicion, curves_of, earth_rate, earth_suspicion, suspicions
from .reading import Reader, Recording, open_file, open_recording
from .records import Applied, Dataset, DeclaredNoise, EarthRate, Exclusion, Run, SharedAxes, inside
from .units import NATIVE_UNITS

__all__ = [
    "applied_model",
    "asked_axes",
    "axes_of",
    "calibration_day",
    "check_channel_units",
    "check_description",
    "check_devices",
    "check_spans",
    "common_channels",
    "in_entry",
    "input_hashes",
    "judge",
    "load",
    "load_reporting",
    "of_axis",
    "place_of",
    "stated_identity",
    "suspected",
    "suspected_of_earth",
]


def place_of(description: Description, index: int) -> str:
    """Return the place of a run, for messages."""
    return f"{FILE}, run {index + 1} ({description.run[index].file})"


def in_entry(entry: RunEntry, time_s: FloatArray) -> NDArray[np.bool_]:
    """Return a mask of the times that belong to a run."""
    gaps = tuple(Exclusion(gap.from_s, gap.to_s, gap.reason) for gap in entry.exclude)
    return inside(time_s, entry.from_s, entry.to_s, gaps)


def check_description(description: Description, applied: Applied | None, exam_only: bool, problems: Problems) -> None:
    """Check that there is a training run, that Earth's rate can be computed, and that a stated model was subtracted."""
    if not exam_only and all(entry.role != "train" for entry in description.run):
        expected = "at least one training run"
        problems.add(InputError(f"{FILE}, field role", "no run has the role train", expected))
    if description.earth_rate == "compute" and description.latitude_deg is None:
        expected = 'a latitude, as earth_rate = "compute"'
        problems.add(InputError(f"{FILE}, field latitude_deg", "is missing", expected))
    stated = description.applied_table
    if stated != "none" and applied is None:
        found = f"the model {stated[:12]}... was subtracted while recording"
        expected = 'applied_model = "FILE": the model.json with that hash'
        problems.add(InputError(f"{FILE}, field applied_table", found, expected))
    if applied is not None and applied.hash != stated:
        found = f"{quoted(stated)}, and applied_model has the hash {applied.hash}"
        problems.add(InputError(f"{FILE}, field applied_table", found, "the hash of that model"))


def check_spans(description: Description, problems: Problems) -> None:
    """Check that spans and exclusions have a length, and that no row of a file belongs to two runs."""
    for index, entry in enumerate(description.run):
        stretches = [("from_s", entry.from_s, entry.to_s)]
        stretches += [(f"exclude.{k}.from_s", gap.from_s, gap.to_s) for k, gap in enumerate(entry.exclude)]
        for field, start, end in stretches:
            if start is not None and end is not None and start >= end:
                where = f"{place_of(description, index)}, field {field}"
                problems.add(InputError(where, f"{start:.10g} s", f"less than to_s, {end:.10g} s"))
    for (i, one), (j, other) in combinations(enumerate(description.run), 2):
        if one.file == other.file and _overlap(one, other):
            found = f"the span overlaps that of run {i + 1}"
            expected = "every row of a file in one run at most"
            problems.add(InputError(place_of(description, j), found, expected))


def _overlap(one: RunEntry, other: RunEntry) -> bool:
    def before(a: RunEntry, b: RunEntry) -> bool:
        return a.to_s is not None and b.from_s is not None and a.to_s <= b.from_s

    return not before(one, other) and not before(other, one)


def of_axis(recordings: Mapping[str, Recording], axis: str | None, problems: Problems) -> dict[str, Recording]:
    """The recordings that have the axis that was asked for."""
    kept = {}
    for name, recording in recordings.items():
        axes = recording.layout.axes
        choices = f"--axis {'|'.join([*axes, 'all'])}"
        if axis is None and axes:
            problems.add(InputError(name, f"rates of the axes {', '.join(axes)}", choices))
        elif axis is not None and axis not in axes:
            expected = choices if axes else "no --axis: the recording has one rate"
            problems.add(InputError(name, f"no rate of the axis {axis}", expected))
        else:
            kept[name] = recording
    return kept


def common_channels(recordings: Mapping[str, Recording]) -> tuple[tuple[str, ...], list[str]]:
    """Auxiliary channels that every file has, and a warning for each of the others."""
    every = list(recordings.values())
    seen = dict.fromkeys(name for r in every for name in r.layout.channels)
    common = tuple(name for name in seen if all(name in r.layout.channels for r in every))
    warnings = []
    for name in seen:
        if name not in common:
            without = ", ".join(r.file.name for r in every if name not in r.layout.channels)
            warnings.append(f"channel {name} is left out: {without} has no such column")
    return common, warnings


Suspected = tuple[str, Suspicion]
"""Name of a file and what contradicts its units."""


def check_channel_units(description: Description, recordings: Mapping[str, Recording], problems: Problems) -> None:
    """Check that every unit is that of a column: a typing error must not pass."""
    channels = {name for r in recordings.values() for name in r.layout.channels}
    for name in description.units:
        if name not in NATIVE_UNITS and name not in channels:
            expected = f"rate, time, temperature or a channel ({', '.join(sorted(channels)) or 'there is none'})"
            problems.add(InputError(f"{FILE}, field units.{name}", "no such column", expected))


def check_devices(recordings: Mapping[str, Recording], problems: Problems) -> None:
    """Check that no column that names the gyro has two values: one data set is of one gyro."""
    for column in dict.fromkeys(column for recording in recordings.values() for column in recording.devices):
        files: dict[float, str] = {}
        for name, recording in recordings.items():
            for device in recording.devices.get(column, ()):
                files.setdefault(device, name)
        if len(files) > 1:
            first, second = list(files)[:2]
            found = f"names several devices: {first:g} in {files[first]}, {second:g} in {files[second]}"
            condition = shlex.quote(f"where={column} == {first:g}")
            expected = (
                f"one gyro in a data set: gyrotc import with --set {condition}, or another name of the column if it "
                "names no gyros"
            )
            problems.add(InputError(f"{files[second]}, column {column}", found, expected))


def suspected(description: Description, recordings: Mapping[str, Recording]) -> Iterator[Suspected]:
    """Yield what contradicts the units of each file."""
    noise = description.noise.arw_deg_per_sqrt_h if description.noise else None
    for name, recording in recordings.items():
        found = suspicions(
            recording.evidence,
            recording.layout,
            recording.units,
            earth_stated=description.earth_rate is not None,
            noise=noise,
        )
        yield from ((name, one) for one in found)


def suspected_of_earth(
    axis: str | None, runs: Sequence[Run], recordings: Mapping[str, Recording]
) -> Iterator[Suspected]:
    """Find runs whose mean is Earth's component along the axis in another unit, if that component is computed."""
    for run in runs:
        recording = recordings[run.file]
        layout = recording.layout
        if run.earth is None or layout.pulses:
            continue
        column = layout.value_of(axis)
        index = 2 + (list(layout.axes.values()).index(column) if layout.axes else 0)
        cells = recording.evidence.cells
        mine = cells[run.in_span(cells[:, 0]), index]
        unit = recording.units.get(column)
        one = earth_suspicion(column, float(mine.mean()), run.earth.rate_dph, unit) if len(mine) else None
        if one is not None:
            yield run.file, one


def judge(suspicions: Sequence[Suspected], trust: bool, problems: Problems) -> list[tuple[str, str]]:
    """Refuse values that contradict their unit; return file and contradiction if the user overrules them."""
    trusted: list[tuple[str, str]] = []
    seen = set()
    for name, one in suspicions:
        if (name, one.kind) in seen:
            continue
        seen.add((name, one.kind))
        where = f"{name}, column {one.column}"
        if trust:
            trusted.append((where, one.found))
        else:
            expected = f"[units] {one.kind} = {one.unit} in {FILE}, or trust_units = true if it is right as it is"
            problems.add(InputError(where, one.found, expected))
    return trusted


_KINDS = (".csv", ".parquet")


def load(
    folder: Path,
    *,
    axis: str | None = None,
    applied: Applied | None = None,
    exam_only: bool = False,
) -> Dataset:
    """Read the description of a data set and check every file.

    Args:
        folder: The data set.
        axis: Axis of three-axis recordings, "x", "y" or "z"; None where there is one rate.
        applied: Model that was subtracted while recording, if the data set says that there was one.
        exam_only: A data set without a training run will do.

    Raises:
        InputError: Something is wrong; the first thing found is reported.
    """
    problems = Problems(collect=False)
    dataset = load_reporting(folder, problems, axis=axis, applied=applied, exam_only=exam_only, once=True)
    assert dataset is not None
    return dataset


def calibration_day(meta: Mapping[str, Any], starts: Iterable[datetime | None]) -> str | None:
    """Return the day of a calibration: `calibrated_on` of `[meta]`, else that of the last run; None: not stated."""
    stated = meta.get("calibrated_on")
    known = [start.date().isoformat() for start in starts if start is not None]
    return str(stated) if stated is not None else max(known, default=None)


def stated_identity(folder: Path) -> tuple[str | None, str | None]:
    """Return the serial that a data set states and the day of its calibration, also where it is refused."""
    description = _readable_description(folder)
    if description is None:
        return None, None
    serial = None if description.serial == UNKNOWN_SERIAL else description.serial
    return serial, calibration_day(description.meta, (run.started for run in description.run))


def input_hashes(folder: Path) -> dict[str, str]:
    """Return the files that a job reads of a data set, with the SHA-256 of each or why it has none.

    Nothing else in the folder is looked at: a link there may lead to all files of the machine.
    """
    description = _readable_description(folder)
    runs = [run.file for run in description.run] if description else []
    applied = [description.applied_model] if description and description.applied_model is not None else []
    return {name: _hash_of(folder / name) for name in dict.fromkeys([FILE, *runs, *applied])}


def _readable_description(folder: Path) -> Description | None:
    """Return the description of a data set; None if it is refused or cannot be read, which its job will say."""
    try:
        return _description(folder, Problems(collect=True))
    except OSError:
        return None


def _hash_of(path: Path) -> str:
    try:
        return sha256(path) if stat.S_ISREG(path.stat().st_mode) else "no regular file"
    except OSError as error:
        return str(error.strerror)


def applied_model(folder: Path) -> Path | None:
    """Return the file of the model that was subtracted while recording; None if the data set names none."""
    if not (folder / FILE).is_file():
        return None
    description = parse_description(folder / FILE, Problems(collect=True))
    stated = description.applied_model if description else None
    return folder / stated if stated is not None else None


def axes_of(folder: Path) -> tuple[str, ...]:
    """Return the axes that `load` can choose from; empty if the recordings have one rate.

    Raises:
        InputError: The description or the header of the first recording is wrong.
    """
    problems = Problems(collect=False)
    description = _description(Path(folder), problems)
    assert description is not None
    name = description.run[0].file
    layout = arrange(name, open_file(name, Path(folder) / name).names, description.columns, problems)
    assert layout is not None
    return tuple(layout.axes)


def asked_axes(folder: Path, axis: str | None) -> tuple[str | None, ...]:
    """Return the axes of a job: the one named, else all that the recordings have; (None,) if they have one rate.

    Args:
        axis: x, y or z; "all": of recordings that have axes; None: what there is.

    Raises:
        InputError: The description or the header of the first recording is wrong, or there are no axes for "all".
    """
    if axis not in (None, "all"):
        return (axis,)
    axes = axes_of(folder)
    if axis == "all" and not axes:
        raise InputError("--axis", "'all', but the recordings have one rate", "no --axis")
    return axes or (None,)


def load_reporting(
    folder: Path,
    problems: Problems,
    *,
    axis: str | None = None,
    applied: Applied | None = None,
    exam_only: bool = False,
    once: bool = False,
) -> Dataset | None:
    """Read a data set as `load` does, and report problems to `problems`.

    Args:
        once: Leave out rows that another run of the same role has.

    Returns:
        The data set of the runs that are in order; None if there is none.
    """
    folder = Path(folder)
    description = _description(folder, problems)
    if description is None:
        return None
    check_description(description, applied, exam_only, problems)
    check_spans(description, problems)
    _check_fit(description, problems)
    opened, with_rows = _recordings(folder, description, problems)
    recordings = of_axis(opened, axis, problems)
    if not recordings:
        return None
    channels, warnings = common_channels(recordings)
    runs_by_entry: dict[int, Run] = {}
    for index, entry in enumerate(description.run):
        if entry.file in recordings and index in with_rows:
            recording = recordings[entry.file]
            reader = Reader(
                file=recording.file,
                layout=recording.layout,
                units=recording.units,
                axis=axis,
                channels=channels,
                pulse_weight_arcsec=description.pulse_weight_arcsec,
                earth=_earth(description, index, axis, problems),
                applied=applied,
                row_period_s=recording.row_period_s,
                temperature_late_s=description.temperature_late_s,
            )
            runs_by_entry[index] = _run(folder, entry, recording, reader)
    runs = list(runs_by_entry.values())
    warnings += [
        f"{r.file.name}: the last line is unfinished and is left out: {quoted(r.file.torn)}"
        for r in recordings.values()
        if r.file.torn
    ]
    check_channel_units(description, recordings, problems)
    check_devices(recordings, problems)
    suspicions = [*suspected(description, recordings), *suspected_of_earth(axis, runs, recordings)]
    trusted = judge(suspicions, description.trust_units, problems)
    warnings += [f"{name}: {TRUSTED}{text}" for name, text in trusted]
    trusted_texts = tuple(f"{name}: {text}" for name, text in trusted)
    if description.temperature_late_s:
        warnings.append(
            f"temperature_late_s = {description.temperature_late_s:g}: every rate goes with the temperature that was "
            "recorded so many seconds later"
        )
    shared = shared_rows(runs, recordings, problems)
    kept = counted_once(runs_by_entry, shared) if once else runs_by_entry
    warnings += [
        f"{run.file}: left out, since fewer than {MIN_ROWS} of its rows are not in another run as well"
        for number, run in runs_by_entry.items()
        if number not in kept
    ]
    counted = tuple(kept.values())
    dataset = _dataset(folder, description, axis, counted, channels, tuple(warnings), trusted_texts)
    return replace(
        dataset,
        shared=shared,
        shared_axes=tuple(SharedAxes(name, axes) for name, r in recordings.items() for axes in r.equal_axes),
        sketch=sketch([r.fingerprints for r in recordings.values()]),
        curves=curves_of(description, kept, recordings),
    )


def _description(folder: Path, problems: Problems) -> Description | None:
    try:
        there, is_folder = folder.exists(), folder.is_dir()
    except OSError as error:
        problems.add(InputError(str(folder), f"cannot be read ({error.strerror})", "a folder of recordings"))
        return None
    if not is_folder:
        found = "is no folder" if there else "does not exist"
        expected = f"the folder that holds it: {folder.parent}" if there else "a folder of recordings"
        problems.add(InputError(str(folder), found, expected))
        return None
    if (folder / FILE).exists():
        return parse_description(folder / FILE, problems)
    files = sorted(f.name for f in folder.iterdir() if f.suffix.lower() in _KINDS and f.name[0] != ".")
    if not files:
        below = sorted(path.parent for path in folder.glob(f"*/{FILE}"))
        expected = f"a folder with *.csv or *.parquet files{f', such as {below[0]}' if below else ''}"
        problems.add(InputError(str(folder), f"no recordings and no {FILE}", expected))
        return None
    try:
        refuse_above("runs", len(files), str(folder), "recordings")
    except InputError as error:
        problems.add(error)
        return None
    serial = folder.resolve().name
    try:
        check_serial(serial)
    except PydanticCustomError as error:
        where = f"{folder}, name of the folder as serial"
        expected = f"{error.message()}, or a {FILE} that gives the serial"
        problems.add(InputError(where, quoted(serial), expected))
        serial = UNKNOWN_SERIAL
    try:
        runs = tuple(RunEntry(file=name, power_on_s="unknown") for name in files)
    except ValidationError as error:  # a name that no description could hold
        problems.add(refused(error, lambda _: f"{folder}, name of a recording"))
        return None
    return Description(serial=serial, run=runs)


def _check_fit(description: Description, problems: Problems) -> None:
    try:
        options_in(description.fit, f"{FILE}, field fit.")
    except InputError as error:
        problems.add(error)


def _recordings(folder: Path, description: Description, problems: Problems) -> tuple[dict[str, Recording], set[int]]:
    """Every file that is in order, by name, of its times the ends; and which runs have rows in them."""
    recordings: dict[str, Recording] = {}
    with_rows: set[int] = set()
    for name in dict.fromkeys(entry.file for entry in description.run):
        recording = open_recording(
            name, folder / name, description.columns, description.units, description.pulse_weight_arcsec, problems
        )
        if recording is None:
            continue
        first, last = recording.time_s[[0, -1]]
        late_s = abs(description.temperature_late_s)
        if late_s and last - first - late_s < MIN_ROWS * recording.row_period_s:
            found = f"{description.temperature_late_s:g} s, and {name} is {last - first:.6g} s long: no row is left"
            expected = "a delay of the temperature that is far shorter than every recording, or none"
            problems.add(InputError(f"{FILE}, field temperature_late_s", found, expected))
            continue
        for index, entry in enumerate(description.run):
            if entry.file != name:
                continue
            if in_entry(entry, recording.time_s).any():
                with_rows.add(index)
            else:
                expected = f"one that meets the rows of the file, {first:.10g} ... {last:.10g} s"
                where = place_of(description, index)
                problems.add(InputError(where, "a span without rows", expected))
        recordings[name] = recording = replace(recording, time_s=recording.time_s[[0, -1]])  # before the next is read
    return recordings, with_rows


def _earth(description: Description, index: int, axis: str | None, problems: Problems) -> EarthRate | None:
    """Return Earth's rate for a run if the description asks to compute it."""
    if description.earth_rate != "compute":
        return None
    entry, where = description.run[index], place_of(description, index)
    azimuth = _angle(entry.axis_azimuth_deg, "axis_azimuth_deg", axis, where, problems)
    elevation = _angle(entry.axis_elevation_deg, "axis_elevation_deg", axis, where, problems)
    latitude = description.latitude_deg
    if latitude is None or azimuth is None or elevation is None:
        return None
    return earth_rate(
        latitude,
        azimuth,
        elevation,
        latitude_sigma_deg=description.latitude_sigma_deg,
        axis_sigma_deg=description.axis_sigma_deg,
    )


def _angle(
    stated: float | Mapping[Literal["x", "y", "z"], float] | None,
    field: str,
    axis: str | None,
    where: str,
    problems: Problems,
) -> float | None:
    """Angle of the chosen axis: one number where there is one axis, a table where there are three."""
    if axis is None and isinstance(stated, float | int):
        return float(stated)
    if isinstance(stated, Mapping):
        for name, angle in stated.items():
            if name == axis:
                return float(angle)
    form = "{x = ..., y = ..., z = ...}" if axis is not None else "..."
    found = "is missing" if stated is None else quoted(stated)
    expected = f'{field} = {form}, as earth_rate = "compute"'
    problems.add(InputError(f"{where}, field {field}", found, expected))
    return None


_SETTLED_S = 4e4  # after power-on: five of the longest time constants of a warm-up


def _power_on_s(entry: RunEntry, time_s: FloatArray) -> float | None:
    """Power-on of a run on its file's clock, s; None: unknown.

    Where it is not stated the clock starts at power-on. A clock by which power-on came when all has settled, or behind
    the last row, counts from something else: there it is the first row.
    """
    if entry.power_on_s is not None:
        return None if entry.power_on_s == "unknown" else entry.power_on_s
    first, last = float(time_s[0]), float(time_s[-1])
    return 0.0 if first <= _SETTLED_S and last >= 0.0 else first


def _run(folder: Path, entry: RunEntry, recording: Recording, reader: Reader) -> Run:
    return Run(
        file=entry.file,
        path=folder / entry.file,
        sha256=recording.file.sha256,
        role=entry.role,
        environment=entry.environment,
        started=entry.started,
        power_on_s=_power_on_s(entry, recording.time_s),
        from_s=entry.from_s,
        to_s=entry.to_s,
        exclude=tuple(Exclusion(gap.from_s, gap.to_s, gap.reason) for gap in entry.exclude),
        row_period_s=recording.row_period_s,
        n_rows=recording.n_rows,
        earth=reader.earth,
        pulse_weight_arcsec=reader.pulse_weight_arcsec if reader.layout.pulses else None,
        reader=reader,
    )


def _dataset(
    folder: Path,
    description: Description,
    axis: str | None,
    runs: tuple[Run, ...],
    channels: tuple[str, ...],
    warnings: tuple[str, ...],
    trusted: tuple[str, ...],
) -> Dataset:
    noise = description.noise
    return Dataset(
        folder=folder,
        serial=description.serial,
        axis=axis,
        description=description.description,
        earth_rate=description.earth_rate,
        noise=DeclaredNoise(**noise.model_dump()) if noise else None,
        applied_table=None if description.applied_table == "none" else description.applied_table,
        meta=dict(description.meta),
        runs=runs,
        channels=channels,
        warnings=warnings,
        units=dict(description.units),
        fit=dict(description.fit),
        trusted=trusted,
        sources=tuple(entry.model_dump() for entry in description.source),
    )
