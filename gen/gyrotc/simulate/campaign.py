"""`simulate`: from a scenario and a seed to a data set on disk, its rows written in chunks.

Physics and noise live on a grid of one second; rows are whole numbers of seconds, or a whole number of rows a second.
Any row length therefore shows the same angle and the same temperature readings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.progress import Progress, silent
from ..recordings.description import dataset_toml
from ..recordings.importers.rows import FileFormat
from ..results.files import create, write_own
from ..results.folder import result_folder
from ..results.json_text import json_text
from ..results.recordings import SimulatedTruth, TrueLot, TrueRun
from .gyro import CELL_S, BiasMap, bridge_arcsec, draw_map, quantised
from .instrument import SimulatedRecord, record
from .scenario import TRUTH_FILE, NoiseLevels, Scenario, read

__all__ = [
    "NOISE",
    "FileFormat",
    "NoiseName",
    "RecordingPart",
    "RowForm",
    "RowLength",
    "SimulatedGyro",
    "SimulatedRunFile",
    "gyro_map",
    "records",
    "rows",
    "simulate",
    "simulate_campaign",
    "with_noise",
    "write_gyro",
]

NoiseName = Literal["paper", "class"]

NOISE: dict[str, NoiseLevels] = {
    # 7e-4 deg/h of 100-s means, what Ding et al. 2014 report after compensation
    "paper": NoiseLevels(arw_deg_per_sqrt_h=7e-4 * (100.0 / 3600.0) ** 0.5),
    # a dithered unit of the 0.008 deg/h class: 0.012 deg/h of 100-s means
    "class": NoiseLevels(
        arw_deg_per_sqrt_h=2e-3, bias_instability_dph=1e-3, rate_random_walk_dph_per_sqrt_h=2e-4, quantum_arcsec=0.5
    ),
}
"""Levels that stand where a scenario gives none."""

_DECLARED = ("arw_deg_per_sqrt_h", "bias_instability_dph", "rate_random_walk_dph_per_sqrt_h", "quantum_arcsec")
_SHOWN = {"gyro", "chamber", "sensor", "channel"}
_DEFAULT_PULSE_ARCSEC = 0.01  # finer than the noise of any row, so that only a declared quantum shows
_PULSES_PER_QUANTUM = 16  # a power of 2, so that pulses and quantum are exact multiples


def simulate(
    scenario: str | Path,
    *,
    seed: int,
    out: Path,
    row_s: float = 10.0,
    raw_hz: float | None = None,
    pulses: bool = False,
    format: FileFormat = "csv",
    noise: NoiseName = "paper",
    progress: Progress = silent,
) -> None:
    """Simulates a campaign and writes it as a data set with its truth beside it.

    Scenario, seed and options fix every byte of the files; other row lengths show the same physics and noise.

    Args:
        scenario: Name of a scenario that comes with gyrotc, or a TOML file.
        seed: 0 or more; draws gyro and noise.
        out: Folder to make; a simulated data set there is replaced.
        row_s: Length of a row, s: a whole number, or one that divides a second.
        raw_hz: Rows a second instead of `row_s`.
        pulses: Integer pulses instead of rates.
        format: The run files are written in it: "csv" or "parquet".
        noise: Levels where the scenario gives none: the paper's, or typical ones of the class.
        progress: Takes note of what is done.

    Raises:
        InputError: scenario, seed, row length or folder cannot be.
    """
    name, plan = read(scenario)
    form = RowForm.of(row_s, raw_hz, pulses, format)
    plan = with_noise(plan, noise)
    serial = plan.gyro.serial.replace("{seed}", f"{seed:04d}")
    gyro = SimulatedGyro(plan, serial, gyro_map(plan, seed), seed, _seeds(seed)[1], name)
    with result_folder(Path(out), "simulate") as stage:
        stage.of(gyro.serial)
        write_gyro(stage.folder, gyro, form, progress)
    progress("simulating", 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class RowForm:
    """How rows are written: their length, integer pulses or rates, the format of the files."""

    length: RowLength
    pulses: bool
    format: FileFormat

    @classmethod
    def of(
        cls, row_s: float = 10.0, raw_hz: float | None = None, pulses: bool = False, format: FileFormat = "csv"
    ) -> RowForm:
        """Raises `InputError` for a length that cannot be."""
        if format not in ("csv", "parquet"):
            raise InputError("--format", repr(format), "csv or parquet")
        return cls(RowLength.of(row_s, raw_hz), pulses, format)


@dataclass(frozen=True, slots=True)
class SimulatedGyro:
    """One gyro of a scenario: what it is, and what its noise is drawn from.

    Attributes:
        plan: The scenario, with this gyro's instrument in it.
        serial: Its serial.
        bias_map: Its static map.
        seed: The number that the user gave.
        seeds: What the noise of its runs is drawn from.
        scenario: Name of the scenario.
        lot: What `truth.json` says of its place in a lot.
    """

    plan: Scenario
    serial: str
    bias_map: BiasMap
    seed: int
    seeds: np.random.SeedSequence
    scenario: str
    lot: TrueLot | None = None


def write_gyro(folder: Path, gyro: SimulatedGyro, form: RowForm, progress: Progress) -> None:
    """Writes recordings and truth of one gyro into a folder that is there."""
    weight = (gyro.plan.noise.quantum_arcsec / _PULSES_PER_QUANTUM or _DEFAULT_PULSE_ARCSEC) if form.pulses else None
    runs = _planned(gyro.plan)
    truths = []
    (folder / "truth").mkdir()
    for index, made in enumerate(records(gyro.plan, gyro.bias_map, gyro.seeds)):
        file = f"run-{index + 1:02d}.{form.format}"
        runs[index] = {"file": file, **runs[index], "power_on_s": made.power_on_s}
        for share in _write_run(folder / file, form.format, made, form.length, weight):
            progress("simulating", index + share, len(runs))
        truths.append(_truth_of_run(folder, file, made, form.length, weight))
    _write_texts(folder, gyro, weight, runs, truths)


def simulate_campaign(plan: Scenario, seed: int) -> Iterator[SimulatedRecord]:
    """The runs of a scenario, one after the other.

    Raises:
        InputError: the seed is negative.
    """
    return records(plan, gyro_map(plan, seed), _seeds(seed)[1])


def records(plan: Scenario, bias_map: BiasMap, seeds: np.random.SeedSequence) -> Iterator[SimulatedRecord]:
    """The runs of a scenario with a gyro's map, one after the other."""
    runs = _planned(plan)
    first = min(run["started"] for run in runs)
    for run, child in zip(runs, seeds.spawn(len(runs)), strict=True):
        day = (run["started"] - first) / timedelta(days=1)
        yield record(plan, plan.profile[run["environment"]], bias_map, day, child)


def gyro_map(plan: Scenario, seed: int) -> BiasMap:
    """The static map of the gyro that a seed draws; the same in every scenario of the same bias range."""
    return draw_map(np.random.default_rng(_seeds(seed)[0]), plan.gyro.bias_dph)


def _seeds(seed: int) -> list[np.random.SeedSequence]:
    if seed < 0:
        raise InputError("seed", str(seed), "0 or more")
    return np.random.SeedSequence(seed).spawn(2)


def with_noise(plan: Scenario, noise: NoiseName) -> Scenario:
    """The scenario with the chosen levels wherever it does not give its own."""
    if noise not in NOISE:
        raise InputError("noise", str(noise), ", ".join(NOISE))
    own = {key: getattr(plan.noise, key) for key in plan.noise.model_fields_set}
    return plan.model_copy(update={"noise": NOISE[noise].model_copy(update=own)})


def _planned(plan: Scenario) -> list[dict[str, Any]]:
    return [
        {
            "role": run_set.role,
            "environment": name,
            "started": run_set.started + timedelta(hours=index * run_set.every_h),
        }
        for run_set in plan.set
        for index, name in enumerate(run_set.profiles)
    ]


def _write_run(
    path: Path, format: FileFormat, made: SimulatedRecord, length: RowLength, weight: float | None
) -> Iterator[float]:
    """Writes the rows of a run; yields the share that is done."""
    total_s = CELL_S * len(made.reading_c)
    columns = list(made.channels)
    with SimulatedRunFile(path, format, row_s=length.row_s, pulse_weight_arcsec=weight, channels=columns) as file:
        for chunk in rows(made, length):
            file.write(chunk)
            yield float(chunk.time_s[-1] + length.row_s) / total_s


def _truth_of_run(folder: Path, file: str, made: SimulatedRecord, length: RowLength, weight: float | None) -> TrueRun:
    """Writes the noise of a run (mean of each row, or of each second where rows are shorter)."""
    step_s = length.cells * CELL_S
    edges = made.angle_arcsec[:: length.cells]
    if weight is not None:
        edges = weight * np.floor(edges / weight)
    noise = (np.diff(edges) - np.diff(made.true_arcsec[:: length.cells])) / step_s
    path = f"truth/{Path(file).stem}.noise.npy"
    _save(folder / path, noise)
    bias = float(made.bias_dph.min()), float(made.bias_dph.max())
    true = TrueRun(file=file, noise=path, noise_step_s=step_s, bias_dph=bias)
    if not made.states:
        return true
    return true.model_copy(update={"states": _written_states(folder, file, made, length.cells)})


def _written_states(folder: Path, file: str, made: SimulatedRecord, cells: int) -> dict[str, str]:
    """Writes the means of the true states over the steps of the noise; names of the files."""
    paths = {name: f"truth/{Path(file).stem}.{name}.npy" for name in made.states}
    for name, values in made.states.items():
        whole = values[: len(values) - len(values) % cells]
        _save(folder / paths[name], whole.reshape(-1, cells).mean(axis=1))
    return paths


def _save(path: Path, values: NDArray[np.float64]) -> None:
    with create(path) as stream:
        np.save(stream, values.astype(np.float32))


def _write_texts(
    folder: Path, gyro: SimulatedGyro, weight: float | None, runs: list[dict[str, Any]], truths: list[TrueRun]
) -> None:
    plan = gyro.plan
    head: dict[str, Any] = {
        "schema": 1,
        "serial": gyro.serial,
        "description": f"{plan.title} (simulated)",
        "earth_rate": "none",
    }
    if weight is not None:
        head["pulse_weight_arcsec"] = weight
    levels = plan.noise.model_dump()
    tables = {"meta": {"simulated": True}, "noise": {key: levels[key] for key in _DECLARED if levels[key]}}
    write_own(folder / "dataset.toml", dataset_toml(head, tables, runs))
    truth = SimulatedTruth(
        scenario=gyro.scenario,
        seed=gyro.seed,
        noise=levels,
        map=gyro.bias_map.described(),
        causes=tuple({"id": cause.id, "channel": cause.channel, **_finite(cause.values())} for cause in plan.cause),
        plan=plan.model_dump(
            mode="json", include=_SHOWN | ({"thermometer", "difference", "laser"} & plan.model_fields_set)
        ),
        runs=tuple(truths),
    )
    truth = truth.model_copy(update={"lot": gyro.lot}) if gyro.lot else truth
    write_own(folder / TRUTH_FILE, json_text(truth.content()))


def _finite(values: dict[str, float]) -> dict[str, float | None]:
    return {key: value if math.isfinite(value) else None for key, value in values.items()}


_CHUNK_ROWS = 200_000  # at once: 1.6 MB a column
_MOST = 10_000  # rows a second or seconds a row: faster than any gyro is read, slower than any is logged


@dataclass(frozen=True, slots=True)
class RowLength:
    """Length of a row: `cells` cells a row, or `per_cell` rows a cell; one of both is 1."""

    cells: int
    per_cell: int

    @property
    def row_s(self) -> float:
        """Seconds a row."""
        return CELL_S * self.cells / self.per_cell

    @classmethod
    def of(cls, row_s: float, raw_hz: float | None) -> RowLength:
        """Rows of `row_s`, or `raw_hz` rows a second if given.

        Raises:
            InputError: neither a whole number of seconds a row nor a whole number of rows a second.
        """
        given = f"{row_s:g} s" if raw_hz is None else f"{raw_hz:g} Hz"
        per_s = raw_hz if raw_hz is not None else 1.0 / row_s if row_s > 0.0 else 0.0
        per_cell = per_s * CELL_S
        if per_cell > 0.0:
            long, short = cls(round(1.0 / per_cell), 1), cls(1, round(per_cell))
            for ratio, made in ((1.0 / per_cell, long), (per_cell, short)):
                if 1 <= round(ratio) <= _MOST and abs(ratio - round(ratio)) < 1e-9 * ratio:
                    return made
        raise InputError("row length", given, f"1 ... {_MOST} whole seconds a row, or whole rows a second")


@dataclass(frozen=True, slots=True)
class RecordingPart:
    """Consecutive rows.

    Attributes:
        time_s: Start of each row on the record's clock, s, shape (n,).
        temperature_c: Mean of the temperature readings in each row, C, shape (n,).
        channels: Samples of the auxiliary channels, likewise.
        edge_arcsec: Angle read at the rows' edges, arcsec, shape (n + 1,).
    """

    time_s: FloatArray
    temperature_c: FloatArray
    channels: dict[str, FloatArray]
    edge_arcsec: FloatArray


def rows(record: SimulatedRecord, length: RowLength) -> Iterator[RecordingPart]:
    """The rows of a record, in chunks; a last row that is not full is left out."""
    fine = _Fine(record, length.per_cell)
    whole = len(record.reading_c) - len(record.reading_c) % length.cells
    step = max(1, _CHUNK_ROWS // length.per_cell) * length.cells
    for start in range(0, whole, step):
        stop = min(start + step, whole)
        first = start * length.per_cell // length.cells
        count = (stop - start) * length.per_cell // length.cells
        edges = record.angle_arcsec[start : stop + 1 : length.cells]
        yield RecordingPart(
            time_s=length.row_s * np.arange(first, first + count, dtype=np.float64),
            temperature_c=_held(record.reading_c[start:stop], length),
            channels={name: _held(values[start:stop], length) for name, values in record.channels.items()},
            edge_arcsec=edges if length.per_cell == 1 else fine.edges(start, stop),
        )


def _held(readings: FloatArray, length: RowLength) -> FloatArray:
    """Mean of the readings in each row; in rows shorter than a cell, the last reading."""
    if length.per_cell > 1:
        return np.repeat(readings, length.per_cell)
    return np.asarray(readings.reshape(-1, length.cells).mean(axis=1))


class _Fine:
    """Angle at the edges of rows shorter than a cell; at full seconds it is the record's own."""

    def __init__(self, record: SimulatedRecord, parts: int) -> None:
        self._record = record
        self._parts = parts
        self._share = np.arange(1, parts) / parts
        self._bridges, self._phases = (np.random.default_rng(child) for child in record.seeds.spawn(2))

    def edges(self, start: int, stop: int) -> FloatArray:
        """Angle at the edges of all rows from cell `start` to cell `stop`, arcsec."""
        record = self._record
        inner = self._smooth(start, stop)
        inner += bridge_arcsec(self._bridges, self._parts, record.white_arcsec[start:stop])
        if record.quantum_arcsec:
            inner = quantised(inner, record.quantum_arcsec, self._phases.random(inner.shape))
        edges = np.empty((stop - start) * self._parts + 1)
        edges[:: self._parts] = record.angle_arcsec[start : stop + 1]
        edges[:-1].reshape(-1, self._parts)[:, 1:] = inner
        return edges

    def _smooth(self, start: int, stop: int) -> FloatArray:
        """Bias linear within the cell, noise grown evenly, shape (cells, parts − 1)."""
        record, share = self._record, self._share
        bias = record.bias_dph[start : stop + 1, None]
        bowed = 0.5 * CELL_S * (bias[1:] - bias[:-1]) * share * (share - 1.0)
        grown = record.rough_arcsec[start : stop + 1, None]
        return np.asarray(grown[:-1] + (grown[1:] - grown[:-1]) * share + bowed)


_RATE_DECIMALS = 9  # deg/h: far below the noise of any row
_DECIMALS = 6  # s, C: far below the resolution of any logger


class _Writer(Protocol):
    def write_table(self, table: pa.Table) -> None: ...
    def close(self) -> None: ...


class SimulatedRunFile:
    """One run on disk, written chunk by chunk.

    Rates are stamped with the start of their row. Pulses are counts since the last row, stamped with the end
    of theirs; a first row starts the clock.
    """

    def __init__(
        self,
        path: Path,
        format: FileFormat,
        *,
        row_s: float,
        pulse_weight_arcsec: float | None,
        channels: Sequence[str] = (),
    ) -> None:
        self._row_s = row_s
        self._weight = pulse_weight_arcsec
        self._started = False
        value = ("rate_dph", pa.float64()) if pulse_weight_arcsec is None else ("pulses", pa.int64())
        floats = [(name, pa.float64()) for name in channels]
        self._schema = pa.schema([("time_s", pa.float64()), ("temperature_c", pa.float64()), value, *floats])
        self._writer: _Writer
        self._sink = create(path)
        if format == "csv":
            self._sink.write((",".join(self._schema.names) + "\n").encode("utf-8"))
            plain = pyarrow.csv.WriteOptions(include_header=False, quoting_style="none")
            self._writer = pyarrow.csv.CSVWriter(self._sink, self._schema, write_options=plain)
        else:
            self._writer = pyarrow.parquet.ParquetWriter(self._sink, self._schema, use_dictionary=False)

    def write(self, chunk: RecordingPart) -> None:
        """Appends rows."""
        columns = [chunk.temperature_c, *chunk.channels.values()]
        rounded = [np.round(column, _DECIMALS) for column in columns]
        time_s: NDArray[Any] = chunk.time_s
        value: NDArray[Any]
        if self._weight is None:
            value = np.round(np.diff(chunk.edge_arcsec) / self._row_s, _RATE_DECIMALS)
        else:
            value = np.diff(np.floor(chunk.edge_arcsec / self._weight).astype(np.int64))
            time_s = time_s + self._row_s
            if not self._started:
                time_s, value = np.append(0.0, time_s), np.append(0, value)
                rounded = [np.append(column[0], column) for column in rounded]
        self._started = True
        arrays = [np.round(time_s, _DECIMALS), rounded[0], value, *rounded[1:]]
        self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema))

    def __enter__(self) -> SimulatedRunFile:
        return self

    def __exit__(self, *error: object) -> None:
        self._writer.close()
        self._sink.close()
