"""A folder becomes a data set: description, files, spans; each thing that is wrong is told in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from pathlib import Path

from pydantic_core import PydanticCustomError

from ..errors import InputError
from .earth import earth_rate
from .problems import Problems
from .reading import Reader, Recording, open_recording
from .records import Applied, Dataset, DeclaredNoise, EarthRate, Exclusion, Run
from .schema import FILE, Description, RunEntry, check_serial, parse_description

__all__ = ["axes_of", "load", "survey"]

_KINDS = (".csv", ".parquet")


def load(
    folder: Path, *, axis: str | None = None, applied: Applied | None = None, exam_only: bool = False
) -> Dataset:
    """Reads the description of a data set and checks every file.

    Args:
        folder: The data set.
        axis: Axis of three-axis recordings, "x", "y" or "z"; None where there is one rate.
        applied: Model that was subtracted while recording, if the data set says that there was one.
        exam_only: A data set without a training run will do.

    Raises:
        InputError: Something is wrong; the first thing found is told.
    """
    dataset = survey(folder, Problems(collect=False), axis=axis, applied=applied, exam_only=exam_only)
    assert dataset is not None
    return dataset


def axes_of(folder: Path) -> tuple[str, ...]:
    """Axes that `load` can choose from; empty where the recordings have one rate.

    Raises:
        InputError: The description or the first recording is wrong.
    """
    problems = Problems(collect=False)
    description = _description(Path(folder), problems)
    assert description is not None
    entry = description.run[0]
    recording = open_recording(
        entry.file,
        Path(folder) / entry.file,
        description.columns,
        description.pulse_weight_arcsec,
        problems,
    )
    assert recording is not None
    return tuple(recording.layout.axes)


def survey(
    folder: Path,
    problems: Problems,
    *,
    axis: str | None = None,
    applied: Applied | None = None,
    exam_only: bool = False,
) -> Dataset | None:
    """As `load`, with problems told to `problems`.

    Returns:
        The data set of the runs that are in order; None if there is none.
    """
    folder = Path(folder)
    description = _description(folder, problems)
    if description is None:
        return None
    recordings = _recordings(folder, description, problems)
    _check_description(description, applied, exam_only, problems)
    _check_spans(description, recordings, problems)
    recordings = _of_axis(recordings, axis, problems)
    if not recordings:
        return None
    channels, warnings = _channels(recordings)
    warnings += [
        f"{r.file.name}: the last line is unfinished and is left out: {r.file.torn[:60]!r}"
        for r in recordings.values()
        if r.file.torn
    ]
    runs = []
    for index, entry in enumerate(description.run):
        if entry.file in recordings:
            earth = _earth(description, index, axis, problems)
            reader = Reader(
                recordings[entry.file].file,
                recordings[entry.file].layout,
                axis,
                channels,
                description.pulse_weight_arcsec,
                earth,
                applied,
                recordings[entry.file].row_period_s,
            )
            runs.append(_run(folder, entry, recordings[entry.file], reader))
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
        runs=tuple(runs),
        channels=channels,
        warnings=tuple(warnings),
    )


def _description(folder: Path, problems: Problems) -> Description | None:
    if not folder.is_dir():
        found = "is no folder" if folder.exists() else "does not exist"
        problems.add(InputError(str(folder), found, "a folder of recordings"))
        return None
    if (folder / FILE).exists():
        return parse_description(folder / FILE, problems)
    files = sorted(
        f.name for f in folder.iterdir() if f.suffix.lower() in _KINDS and not f.name.startswith(".")
    )
    if not files:
        problems.add(InputError(str(folder), f"no recordings and no {FILE}", "*.csv or *.parquet files"))
        return None
    serial = folder.resolve().name
    try:
        check_serial(serial)
    except PydanticCustomError as error:
        where = f"{folder}, name of the folder as serial"
        problems.add(InputError(where, repr(serial), f"{error.message()}, or a {FILE} that gives the serial"))
        serial = "unknown"
    runs = tuple(RunEntry(file=name, power_on_s="unknown") for name in files)
    return Description(serial=serial, run=runs)


def _recordings(folder: Path, description: Description, problems: Problems) -> dict[str, Recording]:
    """Every file that is in order, by name."""
    recordings = {}
    for name in dict.fromkeys(entry.file for entry in description.run):
        recording = open_recording(
            name, folder / name, description.columns, description.pulse_weight_arcsec, problems
        )
        if recording is not None:
            for index, entry in enumerate(description.run):
                if (
                    entry.file == name
                    and not _run(folder, entry, recording, None).in_span(recording.time_s).any()
                ):
                    problems.add(
                        InputError(_place(description, index), "a span without rows", _range(recording))
                    )
            recordings[name] = replace(recording, time_s=recording.time_s[[0, -1]])
    return recordings


def _range(recording: Recording) -> str:
    first, last = recording.time_s[[0, -1]]
    return f"a span that meets the rows of the file, {first:.10g} ... {last:.10g} s"


def _place(description: Description, index: int) -> str:
    return f"{FILE}, run {index + 1} ({description.run[index].file})"


def _check_description(
    description: Description, applied: Applied | None, exam_only: bool, problems: Problems
) -> None:
    if not exam_only and all(entry.role != "train" for entry in description.run):
        problems.add(
            InputError(f"{FILE}, field role", "no run has the role train", "at least one training run")
        )
    stated = description.applied_table
    if stated != "none" and applied is None:
        found = f"the model {stated[:12]}... was subtracted while recording"
        problems.add(InputError(f"{FILE}, field applied_table", found, "that model by --applied FILE"))
    if applied is not None and applied.hash != stated:
        found = f"the model given has the hash {applied.hash}"
        problems.add(InputError(f"{FILE}, field applied_table", found, f"{stated!r} as stated there"))


def _check_spans(description: Description, recordings: Mapping[str, Recording], problems: Problems) -> None:
    for index, entry in enumerate(description.run):
        stretches = [("from_s", entry.from_s, entry.to_s)]
        stretches += [(f"exclude.{k}.from_s", gap.from_s, gap.to_s) for k, gap in enumerate(entry.exclude)]
        for field, start, end in stretches:
            if start is not None and end is not None and start >= end:
                where = f"{_place(description, index)}, field {field}"
                problems.add(InputError(where, f"{start:.10g} s", f"less than to_s, {end:.10g} s"))
    for (i, one), (j, other) in combinations(enumerate(description.run), 2):
        if one.file == other.file and _overlap(one, other):
            problems.add(
                InputError(
                    _place(description, j),
                    f"the span overlaps that of run {i + 1}",
                    "every row of a file in one run at most",
                )
            )


def _overlap(one: RunEntry, other: RunEntry) -> bool:
    def before(a: RunEntry, b: RunEntry) -> bool:
        return a.to_s is not None and b.from_s is not None and a.to_s <= b.from_s

    return not before(one, other) and not before(other, one)


def _of_axis(
    recordings: Mapping[str, Recording], axis: str | None, problems: Problems
) -> dict[str, Recording]:
    """The recordings that have the axis that was asked for."""
    kept = {}
    for name, recording in recordings.items():
        axes = recording.layout.axes
        if axis is None and axes:
            choices = ", ".join(axes) + (", all" if len(axes) > 1 else "")
            problems.add(
                InputError(
                    name, f"rates of the axes {', '.join(axes)}", f"--axis {choices.replace(', ', '|')}"
                )
            )
        elif axis is not None and axis not in axes:
            found = f"no rate of the axis {axis}"
            expected = f"--axis {'|'.join(axes)}" if axes else "no --axis: the recording has one rate"
            problems.add(InputError(name, found, expected))
        else:
            kept[name] = recording
    return kept


def _channels(recordings: Mapping[str, Recording]) -> tuple[tuple[str, ...], list[str]]:
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


def _earth(description: Description, index: int, axis: str | None, problems: Problems) -> EarthRate | None:
    """Earth's rate for one run where the description wants it computed."""
    if description.earth_rate != "compute":
        return None
    entry = description.run[index]
    latitude = description.latitude_deg
    if latitude is None:
        problems.add(
            InputError(f"{FILE}, field latitude_deg", "is missing", 'a latitude, as earth_rate = "compute"')
        )
        return None
    angles = []
    for field in ("axis_azimuth_deg", "axis_elevation_deg"):
        value = getattr(entry, field)
        if isinstance(value, dict):
            value = value.get(axis)
            expected = f"{field} = {{{axis or 'x'} = ...}} for the axis that was chosen"
        else:
            expected = f'{field} = ..., as earth_rate = "compute"'
            if axis is not None and value is not None:
                value, expected = None, f"an angle for each axis: {field} = {{x = ..., y = ..., z = ...}}"
        if value is None:
            problems.add(InputError(f"{_place(description, index)}, field {field}", "is missing", expected))
            return None
        angles.append(value)
    return earth_rate(
        latitude,
        angles[0],
        angles[1],
        latitude_sigma_deg=description.latitude_sigma_deg,
        axis_sigma_deg=description.axis_sigma_deg,
    )


def _run(folder: Path, entry: RunEntry, recording: Recording, reader: Reader | None) -> Run:
    return Run(
        file=entry.file,
        path=folder / entry.file,
        sha256=recording.file.sha256,
        role=entry.role,
        environment=entry.environment,
        started=entry.started,
        power_on_s=None if entry.power_on_s == "unknown" else entry.power_on_s,
        from_s=entry.from_s,
        to_s=entry.to_s,
        exclude=tuple(Exclusion(gap.from_s, gap.to_s, gap.reason) for gap in entry.exclude),
        row_period_s=recording.row_period_s,
        n_rows=0,
        earth=reader.earth if reader else None,
        reader=reader,
    )
