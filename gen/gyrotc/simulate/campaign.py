"""`simulate`: from a scenario and a seed to a data set on disk."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..errors import InputError
from . import biasmap
from . import scenario as scenarios
from .biasmap import BiasMap
from .noise import CELL_S
from .recording import Record, Rows, record, rows
from .scenario import NoiseLevels, Scenario
from .truth import FILE as TRUTH_FILE
from .truth import SCHEMA
from .write import Format, RunFile, complete_folder, dataset_toml

__all__ = ["NOISE", "simulate"]

NOISE: dict[str, NoiseLevels] = {
    # 7e-4 deg/h of 100-s means, as Ding et al. 2014 report after compensation
    "paper": NoiseLevels(arw_deg_per_sqrt_h=7e-4 * (100.0 / 3600.0) ** 0.5),
    # a dithered unit of the 0.008 deg/h class: 0.012 deg/h of 100-s means
    "class": NoiseLevels(
        arw_deg_per_sqrt_h=2e-3,
        bias_instability_dph=1e-3,
        rate_random_walk_dph_per_sqrt_h=2e-4,
        quantum_arcsec=0.5,
    ),
}
_AVERAGES_S = (10.0, 50.0, 100.0, 200.0)
_DEFAULT_PULSE_ARCSEC = 0.01
_PULSES_PER_QUANTUM = 16


def simulate(
    scenario: str | Path,
    *,
    seed: int,
    out: Path,
    row_s: float = 10.0,
    raw_hz: float | None = None,
    pulses: bool = False,
    format: Format = "csv",
    noise: Literal["paper", "class"] = "paper",
    progress: Callable[[float], None] | None = None,
) -> None:
    """Simulates a campaign and writes it as a data set with its truth beside it.

    The same scenario, seed and options give the same files; other row lengths show the same physics and noise.

    Args:
        scenario: Name of a scenario that comes with gyrotc, or a TOML file.
        seed: 0 or more; draws gyro and noise.
        out: Folder to make; a simulated data set there is replaced.
        row_s: Length of a row, s: a whole number, or one that divides a second.
        raw_hz: Rows a second instead of `row_s`.
        pulses: Integer pulses instead of rates.
        format: Of the run files.
        noise: Levels: the paper's, or typical ones of the class; a scenario's own levels replace both.
        progress: Called with the share that is done, 0 ... 1.

    Raises:
        InputError: scenario, seed, row length or folder cannot be.
    """
    name, plan = scenarios.read(scenario)
    if seed < 0:
        raise InputError("seed", str(seed), "0 or more")
    length = _rows(row_s, raw_hz)
    levels = plan.noise or NOISE[noise]
    seeds = np.random.SeedSequence(seed)
    gyro_seeds, run_seeds = seeds.spawn(2)
    bias_map = biasmap.draw(np.random.default_rng(gyro_seeds), plan.gyro.bias_dph)
    weight = _pulse_weight(levels) if pulses else None
    planned = _planned(plan)
    tell = progress or (lambda share: None)
    entries: list[dict[str, Any]] = []
    truths: list[dict[str, Any]] = []
    with complete_folder(Path(out)) as folder:
        (folder / "truth").mkdir()
        for index, (entry, child) in enumerate(zip(planned, run_seeds.spawn(len(planned)), strict=True)):
            made = record(plan, plan.profile[entry["environment"]], bias_map, levels, child)
            entry["file"] = f"run-{index + 1:02d}.{format}"
            entry["power_on_s"] = made.power_on_s
            file = RunFile(folder / entry["file"], format, length.row_s, weight)
            total = len(made.reading_c) * length.per_cell / length.cells
            for chunk in rows(made, length):
                file.write(chunk)
                tell((index + (chunk.time_s[-1] / length.row_s + 1) / total) / len(planned))
            file.close()
            entries.append({"file": entry.pop("file"), **entry})
            truths.append(_truth_of_run(folder, entries[-1]["file"], made, length, weight))
        _write_texts(folder, name, plan, seed, levels, weight, entries, truths, bias_map)
    tell(1.0)


def _rows(row_s: float, raw_hz: float | None) -> Rows:
    where, expected = (
        "row length",
        "a whole number of seconds, or a whole number of rows a second up to 10000",
    )
    per_cell = (raw_hz if raw_hz is not None else 1.0 / row_s if row_s > 0.0 else 0.0) * CELL_S
    if per_cell > 0.0:
        cells = 1.0 / per_cell
        for value, made in ((cells, Rows(round(cells), 1)), (per_cell, Rows(1, round(per_cell)))):
            if 1 <= round(value) <= 10_000 and abs(value - round(value)) < 1e-9 * value:
                return made
    raise InputError(where, f"{raw_hz} Hz" if raw_hz is not None else f"{row_s} s", expected)


def _pulse_weight(levels: NoiseLevels) -> float:
    """A readout whose rounding adds little to the noise that was asked for, arcsec."""
    return levels.quantum_arcsec / _PULSES_PER_QUANTUM or _DEFAULT_PULSE_ARCSEC


def _planned(plan: Scenario) -> list[dict[str, Any]]:
    runs: list[dict[str, Any]] = []
    for run_set in plan.set:
        for index, name in enumerate(run_set.profiles):
            started: datetime = run_set.started + timedelta(hours=index * run_set.every_h)
            runs.append({"role": run_set.role, "environment": name, "started": started.isoformat()})
    return runs


def _truth_of_run(
    folder: Path, file: str, made: Record, length: Rows, weight: float | None
) -> dict[str, Any]:
    """Writes the noise of a run (mean of each row, or of each second where rows are shorter) and describes it."""
    step = length.cells
    edges = made.angle_arcsec[::step]
    if weight is not None:
        edges = weight * np.floor(edges / weight)
    step_s = step * CELL_S
    noise = (np.diff(edges) - np.diff(made.true_arcsec[::step])) / step_s
    path = f"truth/{Path(file).stem}.noise.npy"
    np.save(folder / path, noise.astype(np.float32))
    rms = {
        f"{average:g}": _rms(noise, round(average / step_s)) for average in _AVERAGES_S if average >= step_s
    }
    return {"file": file, "noise": path, "noise_step_s": step_s, "noise_rms_dph": rms}


def _rms(noise: np.ndarray[Any, np.dtype[np.float64]], count: int) -> float:
    means = noise[: len(noise) - len(noise) % count].reshape(-1, count).mean(axis=1)
    return float(np.sqrt(np.mean(means**2)))


def _write_texts(
    folder: Path,
    name: str,
    plan: Scenario,
    seed: int,
    levels: NoiseLevels,
    weight: float | None,
    entries: list[dict[str, Any]],
    truths: list[dict[str, Any]],
    bias_map: BiasMap,
) -> None:
    head: dict[str, Any] = {
        "schema": 1,
        "serial": plan.gyro.serial.replace("{seed}", f"{seed:04d}"),
        "description": f"{plan.title} (simulated)",
        "earth_rate": "none",
    }
    if weight is not None:
        head["pulse_weight_arcsec"] = weight
    declared = {key: value for key, value in levels.model_dump().items() if value}
    tables = {"meta": {"simulated": True}, "noise": declared}
    (folder / "dataset.toml").write_text(dataset_toml(head, tables, entries), "utf-8")
    truth = {
        "schema": SCHEMA,
        "scenario": name,
        "seed": seed,
        "noise": levels.model_dump(),
        "map": {"scale_dph": bias_map.scale_dph, "offset_dph": bias_map.offset_dph, **bias_map.parameters},
        "plan": plan.model_dump(mode="json", exclude={"profile", "set"}),
        "causes": [],
        "runs": truths,
    }
    (folder / TRUTH_FILE).write_text(json.dumps(truth, indent=1, ensure_ascii=False) + "\n", "utf-8")
