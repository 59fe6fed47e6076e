"""A folder becomes a data set: description, files, spans; each thing that is wrong is told in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic_core import PydanticCustomError

from ..common.ceilings import refuse_above
from ..common.errors import InputError
from .columns import arrange
from .consistency import check_description, check_spans, common_channels, in_entry, of_axis, place_of
from .curves import curves_of
from .earth import earth_rate
from .overlap import shared_rows
from .problems import Problems
from .reading import Reader, Recording, open_file, open_recording
from .records import Applied, Dataset, DeclaredNoise, EarthRate, Exclusion, Run
from .schema import FILE, Description, RunEntry, check_serial, parse_description
from .shared import sketch
from .trust import check_channel_units, judge, suspected, suspected_of_earth

__all__ = ["axes_of", "load", "survey"]

_KINDS = (".csv", ".parquet")


def load(
    folder: Path,
    *,
    axis: str | None = None,
    applied: Applied | None = None,
    exam_only: bool = False,
    trust_units: bool = False,
) -> Dataset:
    """Reads the description of a data set and checks every file.

    Args:
        folder: The data set.
        axis: Axis of three-axis recordings, "x", "y" or "z"; None where there is one rate.
        applied: Model that was subtracted while recording, if the data set says that there was one.
        exam_only: A data set without a training run will do.
        trust_units: Values that contradict their units are taken nevertheless.

    Raises:
        InputError: Something is wrong; the first thing found is told.
    """
    problems = Problems(collect=False)
    dataset = survey(
        folder, problems, axis=axis, applied=applied, exam_only=exam_only, trust_units=trust_units
    )
    assert dataset is not None
    return dataset


def axes_of(folder: Path) -> tuple[str, ...]:
    """Axes that `load` can choose from; empty where the recordings have one rate.

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


def survey(  # long: a reader is told everything that it needs, by name
    folder: Path,
    problems: Problems,
    *,
    axis: str | None = None,
    applied: Applied | None = None,
    exam_only: bool = False,
    trust_units: bool = False,
) -> Dataset | None:
    """As `load`, with problems told to `problems`.

    Returns:
        The data set of the runs that are in order; None if there is none.
    """
    folder = Path(folder)
    description = _description(folder, problems)
    if description is None:
        return None
    check_description(description, applied, exam_only, problems)
    check_spans(description, problems)
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
        f"{r.file.name}: the last line is unfinished and is left out: {r.file.torn[:60]!r}"
        for r in recordings.values()
        if r.file.torn
    ]
    check_channel_units(description, recordings, problems)
    doubted = [*suspected(description, recordings), *suspected_of_earth(axis, runs, recordings)]
    trusted = judge(doubted, trust_units or description.trust_units, problems)
    warnings += [f"{name}: units are trusted: {text}" for name, text in trusted]
    trusted_texts = tuple(f"{name}: {text}" for name, text in trusted)
    if description.temperature_late_s:
        warnings.append(
            f"temperature_late_s = {description.temperature_late_s:g}: every rate goes with the temperature that was "
            "recorded so many seconds later"
        )
    dataset = _dataset(folder, description, axis, tuple(runs), channels, tuple(warnings), trusted_texts)
    return replace(
        dataset,
        shared=shared_rows(runs, recordings, problems),
        sketch=sketch([r.fingerprints for r in recordings.values()]),
        curves=curves_of(description, runs_by_entry, recordings),
    )


def _description(folder: Path, problems: Problems) -> Description | None:
    try:
        there, is_folder = folder.exists(), folder.is_dir()
    except OSError as error:
        problems.add(InputError(str(folder), f"cannot be read ({error.strerror})", "a folder of recordings"))
        return None
    if not is_folder:
        found = "is no folder" if there else "does not exist"
        problems.add(InputError(str(folder), found, "a folder of recordings"))
        return None
    if (folder / FILE).exists():
        return parse_description(folder / FILE, problems)
    files = sorted(f.name for f in folder.iterdir() if f.suffix.lower() in _KINDS and f.name[0] != ".")
    if not files:
        problems.add(InputError(str(folder), f"no recordings and no {FILE}", "*.csv or *.parquet files"))
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
        problems.add(InputError(where, repr(serial), expected))
        serial = "unknown"
    runs = tuple(RunEntry(file=name, power_on_s="unknown") for name in files)
    return Description(serial=serial, run=runs)


def _recordings(
    folder: Path, description: Description, problems: Problems
) -> tuple[dict[str, Recording], set[int]]:
    """Every file that is in order, by name, without its times; and which runs have rows in them."""
    recordings: dict[str, Recording] = {}
    with_rows: set[int] = set()
    for name in dict.fromkeys(entry.file for entry in description.run):
        recording = open_recording(
            name,
            folder / name,
            description.columns,
            description.units,
            description.pulse_weight_arcsec,
            problems,
        )
        if recording is None:
            continue
        first, last = recording.time_s[[0, -1]]
        for index, entry in enumerate(description.run):
            if entry.file != name:
                continue
            if in_entry(entry, recording.time_s).any():
                with_rows.add(index)
            else:
                expected = f"one that meets the rows of the file, {first:.10g} ... {last:.10g} s"
                where = place_of(description, index)
                problems.add(InputError(where, "a span without rows", expected))
        recordings[name] = replace(recording, time_s=np.zeros(0))
    return recordings, with_rows


def _earth(description: Description, index: int, axis: str | None, problems: Problems) -> EarthRate | None:
    """Earth's rate for one run where the description wants it computed."""
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
    found = "is missing" if stated is None else repr(stated)
    expected = f'{field} = {form}, as earth_rate = "compute"'
    problems.add(InputError(f"{where}, field {field}", found, expected))
    return None


def _run(folder: Path, entry: RunEntry, recording: Recording, reader: Reader) -> Run:
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
        trusted=trusted,
        sources=tuple(entry.model_dump() for entry in description.source),
    )
