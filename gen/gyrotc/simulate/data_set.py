"""Write a simulated gyro as a data set: run files, `dataset.toml` and the truth beside them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.errors import InputError, quoted
from ..common.progress import Progress, silent
from ..recordings.description import dataset_toml
from ..recordings.importers.rows import FileFormat
from ..results.files import create, write_own
from ..results.folder import result_folder
from ..results.json_text import json_text
from ..results.recordings import SimulatedTruth, TrueLot, TrueRun
from .bias_map import BiasMap
from .campaign import NoiseName, gyro_map, noise_seeds, planned_runs, records, with_noise
from .grid import CELL_S
from .record import SimulatedRecord
from .rows import RowLength, rows
from .run_file import SimulatedRunFile
from .scenario import Scenario, read
from .truth import TRUTH_FILE

# The names that tools/reference.py documents.
__all__ = ["FileFormat", "NoiseName", "RowForm", "RowLength", "SimulatedGyro", "simulate", "write_gyro"]

# Levels that `dataset.toml` states, as a data sheet would.
_DECLARED = ("arw_deg_per_sqrt_h", "bias_instability_dph", "rate_random_walk_dph_per_sqrt_h", "quantum_arcsec")
# Tables of the scenario that `truth.json` repeats.
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
    """Simulate a campaign and write it as a data set with its truth beside it.

    Scenario, seed and options fix every byte of the files. Other row lengths show the same physics and noise, since
    both live on a grid of one second.

    Args:
        scenario: Name of a scenario that comes with gyrotc, or path of a TOML file.
        seed: Number from which gyro and noise are drawn, 0 or more.
        out: Folder to make; a simulated data set there is replaced.
        row_s: Length of a row, s: a whole number, or one that divides a second.
        raw_hz: Rows a second, in place of `row_s`.
        pulses: Write integer pulses instead of rates.
        format: Format of the run files, "csv" or "parquet".
        noise: Levels of what the scenario does not give: "paper", or "class" for typical ones of the class.
        progress: Called with what is done.

    Raises:
        InputError: The scenario, the seed, the row length or the folder is not valid.
    """
    name, plan = read(scenario)
    form = RowForm.of(row_s, raw_hz, pulses, format)
    plan = with_noise(plan, noise)
    serial = plan.gyro.serial.replace("{seed}", f"{seed:04d}")
    gyro = SimulatedGyro(plan, serial, gyro_map(plan, seed), seed, noise_seeds(seed), name)
    with result_folder(Path(out), "simulate") as stage:
        stage.of(gyro.serial)
        write_gyro(stage.folder, gyro, form, progress)
    progress("simulating", 1.0, 1.0)


@dataclass(frozen=True, slots=True)
class RowForm:
    """Form of the rows: their length, integer pulses or rates, the format of the files."""

    length: RowLength
    pulses: bool
    format: FileFormat

    @classmethod
    def of(
        cls, row_s: float = 10.0, raw_hz: float | None = None, pulses: bool = False, format: FileFormat = "csv"
    ) -> RowForm:
        """Return a form; it raises `InputError` for a length or format that is not valid."""
        if format not in ("csv", "parquet"):
            raise InputError("--format", quoted(format), "csv or parquet")
        return cls(RowLength.of(row_s, raw_hz), pulses, format)


@dataclass(frozen=True, slots=True)
class SimulatedGyro:
    """One gyro of a scenario.

    Attributes:
        plan: The scenario, with this gyro's instrument in it.
        serial: Serial number.
        bias_map: Static map.
        seed: Seed that the user gave.
        seeds: Seeds of the noise of its runs.
        scenario: Name of the scenario.
        lot: Place in a lot, for `truth.json`; None: it is no gyro of a lot.
    """

    plan: Scenario
    serial: str
    bias_map: BiasMap
    seed: int
    seeds: np.random.SeedSequence
    scenario: str
    lot: TrueLot | None = None


def write_gyro(folder: Path, gyro: SimulatedGyro, form: RowForm, progress: Progress) -> None:
    """Write recordings and truth of one gyro into an existing folder."""
    weight = (gyro.plan.noise.quantum_arcsec / _PULSES_PER_QUANTUM or _DEFAULT_PULSE_ARCSEC) if form.pulses else None
    runs = planned_runs(gyro.plan)
    truths = []
    (folder / "truth").mkdir()
    for index, made in enumerate(records(gyro.plan, gyro.bias_map, gyro.seeds)):
        file = f"run-{index + 1:02d}.{form.format}"
        runs[index] = {"file": file, **runs[index], "power_on_s": made.power_on_s}
        for share in _write_run(folder / file, form.format, made, form.length, weight):
            progress("simulating", index + share, len(runs))
        truths.append(_truth_of_run(folder, file, made, form.length, weight))
    _write_texts(folder, gyro, weight, runs, truths)


def _write_run(
    path: Path, format: FileFormat, made: SimulatedRecord, length: RowLength, weight: float | None
) -> Iterator[float]:
    """Write the rows of a run and yield the share that is done."""
    total_s = CELL_S * len(made.reading_c)
    columns = list(made.channels)
    with SimulatedRunFile(path, format, row_s=length.row_s, pulse_weight_arcsec=weight, channels=columns) as file:
        for chunk in rows(made, length):
            file.write(chunk)
            yield float(chunk.time_s[-1] + length.row_s) / total_s


def _truth_of_run(folder: Path, file: str, made: SimulatedRecord, length: RowLength, weight: float | None) -> TrueRun:
    """Write noise and states of a run, as means of rows or, if these are shorter, of seconds; return its entry."""
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
    """Write the means of the true states over the steps of the noise, and return the names of the files."""
    paths = {name: f"truth/{Path(file).stem}.{name}.npy" for name in made.states}
    for name, values in made.states.items():
        whole = values[: len(values) - len(values) % cells]
        _save(folder / paths[name], whole.reshape(-1, cells).mean(axis=1))
    return paths


def _save(path: Path, values: NDArray[np.float64]) -> None:
    """Write an array in single precision."""
    with create(path) as stream:
        np.save(stream, values.astype(np.float32))


def _write_texts(
    folder: Path, gyro: SimulatedGyro, weight: float | None, runs: list[dict[str, Any]], truths: list[TrueRun]
) -> None:
    """Write the description of the data set and its truth."""
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
    """Return values as JSON can hold them: what is not finite becomes null."""
    return {key: value if math.isfinite(value) else None for key, value in values.items()}
