"""A data set in memory: a description with its runs; rows are read when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray

__all__ = [
    "NO_CHANNEL",
    "NO_TEMPERATURE",
    "NO_TEMPERATURE_THEN",
    "Applied",
    "Curve",
    "Dataset",
    "DeclaredNoise",
    "EarthRate",
    "Exclusion",
    "Mark",
    "Role",
    "Rows",
    "Run",
    "SharedRows",
    "inside",
    "joined_runs",
]

Role = Literal["train", "exam"]
# Reasons for which a row of a file is not among its `Rows`.
NO_TEMPERATURE = "no temperature"
NO_CHANNEL = "no reading of a channel"
NO_TEMPERATURE_THEN = "no temperature temperature_late_s later"
_OWN = "temperature_c"  # what a difference calls the temperature of the gyro itself, whatever the column is named


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows of one recording: float64 arrays of one length, not to be written to.

    Attributes:
        time_s: Seconds on the file's clock, strictly increasing.
        temperature_c: Temperature, C.
        rate_dph: Measured rate of the chosen axis, deg/h, without Earth's rate where that is computed; NaN in
            the first row of counted pulses.
        channels: Auxiliary channels by column name, in their own units.
        absent_s: Times of the rows of the file that are not among these, by the reason, s.
    """

    time_s: FloatArray
    temperature_c: FloatArray
    rate_dph: FloatArray
    channels: dict[str, FloatArray]
    absent_s: Mapping[str, FloatArray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time_s)

    def from_row(self, first: int) -> Rows:
        """Return the rows from number `first` on, as views; all of them for 0."""
        if first == 0:
            return self
        channels = {name: values[first:] for name, values in self.channels.items()}
        return Rows(self.time_s[first:], self.temperature_c[first:], self.rate_dph[first:], channels)

    def has_channel(self, name: str) -> bool:
        """Test whether there is a channel of this name, or a difference of two columns."""
        first, minus, second = name.partition(" - ")
        return name in self.channels or (minus != "" and self._is_column(first) and self._is_column(second))

    def channel(self, name: str) -> FloatArray:
        """A recorded channel, or a difference of two columns by the name "a - b" (or of "temperature_c").

        Raises:
            KeyError: There is no such column.
        """
        if name in self.channels:
            return self.channels[name]
        first, _, second = name.partition(" - ")
        return np.asarray(self._column(first) - self._column(second))

    def _is_column(self, name: str) -> bool:
        return name in self.channels or name == _OWN

    def _column(self, name: str) -> FloatArray:
        return self.temperature_c if name == _OWN and _OWN not in self.channels else self.channels[name]


@dataclass(frozen=True, slots=True)
class Exclusion:
    """A stretch from_s <= t < to_s of the file's clock that belongs to no run, and why."""

    from_s: float
    to_s: float
    reason: str


@dataclass(frozen=True, slots=True)
class EarthRate:
    """Earth's rate along the sensitive axis, taken off every row, and its standard uncertainty, deg/h."""

    rate_dph: float
    sigma_dph: float


@dataclass(frozen=True, slots=True)
class Applied:
    """The model that was subtracted while recording.

    Attributes:
        hash: Hash of that model.
        correction_dph: Gives the correction in force at every row (deg/h) from rows and median period.
    """

    hash: str
    correction_dph: Callable[[Rows, float], FloatArray]


@dataclass(frozen=True, slots=True)
class DeclaredNoise:
    """Declared noise of the unit; None if it is not stated."""

    arw_deg_per_sqrt_h: float | None = None
    bias_instability_dph: float | None = None
    rate_random_walk_dph_per_sqrt_h: float | None = None
    quantum_arcsec: float | None = None


@dataclass(frozen=True, slots=True)
class Run:
    """One run: a recording or a span of one.

    Attributes:
        file: Name as in the data set.
        path: Where it lies.
        sha256: Of the bytes that were read, hexadecimal.
        role: What the run is for.
        environment: Free text.
        started: Start of the recording, with time zone; None if not stated.
        power_on_s: Power-on on this run's clock, s; None if unknown.
        from_s: Start of the span on the file's clock, s; None: the file's first row.
        to_s: End of the span (exclusive), s; None: beyond the file's last row.
        exclude: Stretches within it that do not count.
        row_period_s: Median row period of the file, s.
        n_rows: Rows of the file.
        earth: Earth's rate that is taken off, None where there is nothing to take off.
        pulse_weight_arcsec: Angle of one pulse, None where a rate was recorded.
        reader: Reads the whole file; `rows` is the way to call it.
    """

    file: str
    path: Path
    sha256: str
    role: Role
    environment: str
    started: datetime | None
    power_on_s: float | None
    from_s: float | None
    to_s: float | None
    exclude: tuple[Exclusion, ...]
    row_period_s: float
    n_rows: int
    earth: EarthRate | None
    pulse_weight_arcsec: float | None
    reader: Callable[[], Rows] = field(repr=False, compare=False)

    def rows(self) -> Rows:
        """All rows of the file, also those outside the span: the front end runs from the first row on.

        Raises:
            InputError: The file has been changed since it was first read.
        """
        return self.reader()

    def first_powered(self, time_s: FloatArray) -> int:
        """Return the number of the first row after a power-on within the file, 0 if power came before.

        A target is switched on with its gyro: replays begin there.
        """
        first = 0 if self.power_on_s is None else int(np.searchsorted(time_s, self.power_on_s))
        return first if first < len(time_s) else 0

    def in_span(self, time_s: FloatArray) -> NDArray[np.bool_]:
        """Return a mask of the times (s on the file's clock) of the run: from_s <= t < to_s and not excluded."""
        return inside(time_s, self.from_s, self.to_s, self.exclude)


def joined_runs(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Join runs of one role whose spans of a file touch, in order of file and time; copies of a run count once.

    So neither the order of runs in a description, nor where a recording is cut, nor how often it was handed over
    changes what is learnt.
    """
    found: list[Run] = []
    known: set[tuple[object, ...]] = set()
    for run in sorted(runs, key=lambda run: (run.file, -np.inf if run.from_s is None else run.from_s)):
        same = (run.sha256, run.role, run.from_s, run.to_s, run.exclude)
        if same in known:
            continue
        known.add(same)
        last = found[-1] if found else None
        if (
            last is not None
            and (last.file, last.role) == (run.file, run.role)
            and last.to_s is not None
            and last.to_s == run.from_s
        ):
            found[-1] = replace(last, to_s=run.to_s, exclude=(*last.exclude, *run.exclude))
        else:
            found.append(run)
    return tuple(found)


def inside(
    time_s: FloatArray, from_s: float | None, to_s: float | None, exclude: tuple[Exclusion, ...]
) -> NDArray[np.bool_]:
    """Return a mask of the times in a span without its exclusions; None means no limit on that side."""
    result = np.ones(np.shape(time_s), dtype=bool)
    if from_s is not None:
        result &= time_s >= from_s
    if to_s is not None:
        result &= time_s < to_s
    for gap in exclude:
        result &= (time_s < gap.from_s) | (time_s >= gap.to_s)
    return result


@dataclass(frozen=True, slots=True)
class SharedRows:
    """Consecutive rows that two files hold, or one file twice.

    Attributes:
        file: The one file.
        rows: First and last of its rows, counted from 1.
        span_s: Their times on its clock, s: first row, row after the last.
        other_file: The other file, or the same.
        other_rows: First and last row in the other file, as `rows`.
        other_span_s: As `span_s`.
    """

    file: str
    rows: tuple[int, int]
    span_s: tuple[float, float]
    other_file: str
    other_rows: tuple[int, int]
    other_span_s: tuple[float, float]

    @property
    def marks(self) -> tuple[Mark, Mark]:
        """The marks of both stretches."""
        return (Mark(self.file, self.rows, self.span_s), Mark(self.other_file, self.other_rows, self.other_span_s))


@dataclass(frozen=True, slots=True)
class SharedAxes:
    """Two axes of a file that hold the same values: one of them was recorded, or neither.

    Attributes:
        file: The file.
        axes: Their names.
    """

    file: str
    axes: tuple[str, str]


@dataclass(frozen=True, slots=True)
class Mark:
    """Rows that something is reported of.

    Attributes:
        file: Their file.
        rows: First and last of them, counted from 1.
        span_s: Their times on its clock, s: first row, row after the last; None where times are in disorder.
    """

    file: str
    rows: tuple[int, int] | None = None
    span_s: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Mean rates of a run at each degree.

    Attributes:
        file: Its file.
        from_s: Where the run begins in it, s, if not with its first row.
        role: The run's.
        axes: Axes of the file; none where it has one rate.
        temperature_c: Temperatures, C, shape (p,).
        rates_dph: Mean rates as they were recorded, deg/h, shape (p, axes).
        cells: How many means of equal length are behind each, shape (p,).
        earth_dph: Earth's rate along each axis, deg/h, where it is to be computed.
    """

    file: str
    from_s: float | None
    role: str
    axes: tuple[str, ...]
    temperature_c: FloatArray
    rates_dph: FloatArray
    cells: NDArray[np.int64]
    earth_dph: tuple[float, ...] | None


@dataclass(frozen=True, slots=True, repr=False)
class Dataset:
    """A folder of recordings of one axis of one serial.

    Attributes:
        folder: Where it lies.
        serial: Serial of the gyro.
        axis: Chosen axis, None where the recordings have one rate.
        description: Free text.
        earth_rate: What the data set states: "removed", "none" or "compute"; None if not stated.
        noise: Declared noise, None if not declared.
        applied_table: Hash of the model that was subtracted while recording, None: none.
        meta: Free facts, JSON types only.
        fit: `[fit]` as stated: options of training by name.
        runs: In the order of the description.
        channels: Auxiliary channels that every run has.
        warnings: What a user should know of what was done to the data.
        units: `[units]` as declared.
        trusted: What the values look like against their units, where the user's word was taken for them.
        sources: Files of loggers that the runs were imported from: file, sha256, bytes, imported_by, map, run.
        shared: Rows that runs of one role have in common, or that a run has twice; they count once.
        shared_axes: Axes that hold the same values.
        sketch: Hashes of rows by which gyros of a fleet are compared (`fingerprints.sketch`).
        curves: Mean rates over temperature, of every axis of every run.
    """

    folder: Path
    serial: str
    axis: str | None
    description: str
    earth_rate: str | None
    noise: DeclaredNoise | None
    applied_table: str | None
    meta: dict[str, Any]
    runs: tuple[Run, ...]
    channels: tuple[str, ...]
    warnings: tuple[str, ...]
    units: dict[str, str] = field(default_factory=dict)
    fit: dict[str, Any] = field(default_factory=dict)
    trusted: tuple[str, ...] = ()
    sources: tuple[dict[str, Any], ...] = ()
    shared: tuple[SharedRows, ...] = ()
    shared_axes: tuple[SharedAxes, ...] = ()
    sketch: tuple[int, ...] = ()
    curves: tuple[Curve, ...] = ()

    def __repr__(self) -> str:
        axis = f" axis {self.axis}" if self.axis else ""
        train, test = (sum(run.role == role for run in self.runs) for role in ("train", "exam"))
        rows = sum(run.n_rows for run in self.runs)
        return f"Dataset({self.serial}{axis}: {train} training runs, {test} test runs, {rows} rows)"
