"""Diagnosis of measured recordings: tables of docs/real.md (part of `make real`).

usage: python -m bench.real.diagnosis FOLDER-OF-DATA-SETS DOCS WORK
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.diagnose import Effect, Refitting, cycle_of, records_of
from gyrotc.recordings import load
from gyrotc.train import FitOptions, TrainingData, front_end, samples_of

from ..paper.page import filled
from ..records import Record, read_record, rounded, write_record
from .page import with_exam

CYCLE, ISOTHERMAL = "mpu6000-chamber-cycle", "mpu6050-isothermal"
CUT_S = {
    CYCLE: 3130.0,
    ISOTHERMAL: 524.0,
}  # training before, scored after; the cycle: where the second cooling begins
SIZES = (None, 2, 3, 4, 5, 6, 8, 10, 12)
AVERAGE_S = 10.0
Result = dict[str, Any]


def diagnosed(data: Path, axis: str, out: Path) -> Result:
    """One run of the installed command."""
    command = [Path(sys.executable).with_name("gyrotc"), "diagnose", data, "--axis", axis, "--out", out]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    print(done.stdout.splitlines()[0])
    return dict(json.loads((out / "diagnose.json").read_text("utf-8")))


def of_sizes(data: Path, axis: str) -> list[float]:
    """RMS on the unseen branch with the best states, beside maps of all sizes."""
    dataset = load(data, axis=axis)
    records = records_of(dataset, "train", block_s=AVERAGE_S, average_s=AVERAGE_S)
    effects = [Effect.of(state) for state in cycle_of(records).states]
    found = []
    for size in SIZES:
        options = FitOptions(method="mrbf", centers=size, average_s=AVERAGE_S)
        runs = Refitting(dataset, records, options, single_cycle=True).on_exam([effects])[0]
        found.append(float(np.sqrt(np.mean(np.concatenate([run.after_dph for run in runs]) ** 2))))
    return found


def cubic(data: Path, axis: str) -> float:
    """RMS on the unseen branch of a cubic in T with a term in dT/dt, the commonest correction: least squares."""
    runs = load(data, axis=axis).runs
    front = front_end([r for r in runs if r.role == "train"], AVERAGE_S)
    train, exam = (
        samples_of(front.blocks(next(r for r in runs if r.role == role)), front.block_s, 0)
        for role in ("train", "exam")
    )

    def columns(d: TrainingData) -> np.ndarray:
        x = (d.temperature_c - 30.0) / 40.0
        return np.column_stack([x**0, x, x**2, x**3, d.slope_c_per_min])

    weights = np.linalg.lstsq(columns(train), train.bias_dph, rcond=None)[0]
    return float(np.sqrt(np.mean((exam.bias_dph - columns(exam) @ weights) ** 2)))


def parts(record: Record) -> dict[str, str]:
    """Return the table and the sentence of docs/real.md that a record gives."""
    head = (
        "| axis | verdict | cubic in T with dT/dt | map of (T, dT/dt) | map of T with states, nine sizes of the map |"
    )
    lines = [head, "| --- | --- | ---: | ---: | --- |"]
    for axis, of in record["cycle"].items():
        rms = (f"{of[name]:.0f}" for name in ("cubic_dph", "map_dph"))
        sizes = f"{min(of['sizes_dph']):.0f} to {max(of['sizes_dph']):.0f}"
        lines.append("| " + " | ".join((axis, f"`{of['verdict']}`", *rms, sizes)) + " |")
    still = ", ".join(f"`{verdict}` on {axis}" for axis, verdict in record["isothermal"].items())
    return {"gains": "\n".join(lines), "isothermal": f"The verdict is {still}."}


def entry(result: Result, cubic_dph: float, sizes_dph: list[float]) -> Result:
    """Return what the record keeps of the diagnosis of an axis."""
    cycle = result["single_cycle"]
    return {
        "verdict": result["verdict"],
        "cubic_dph": cubic_dph,
        "map_dph": result["baseline"]["exam_rms_dph"],
        "sizes_dph": sizes_dph,
        "gain": cycle["gain"],
        "static": cycle["static"],
        "tried": cycle["tried"],
    }


def _data(source: Path, work: Path, name: str) -> Path:
    folder = work / f"{name}-diagnosis-data"
    with_exam(source / name, folder, CUT_S[name])
    with (folder / "dataset.toml").open("a") as description:
        description.write(f"[fit]\naverage_s = {AVERAGE_S}\n")
    return folder


def main(source: Path, docs: Path, work: Path) -> None:
    """Runs everything and fills the page."""
    absent = [name for name in CUT_S if not (source / name).is_dir()]
    if absent:
        print(f"{', '.join(absent)} absent in {source}: skipped")
        return
    data = _data(source, work, CYCLE)
    cycles = {axis: diagnosed(data, axis, work / f"diagnosis-{axis}") for axis in "xyz"}
    rest = _data(source, work, ISOTHERMAL)
    still = {axis: diagnosed(rest, axis, work / f"diagnosis-still-{axis}") for axis in "xyz"}
    found = {
        "cycle": {axis: entry(r, cubic(data, axis), of_sizes(data, axis)) for axis, r in cycles.items()},
        "isothermal": {axis: result["verdict"] for axis, result in still.items()},
    }
    record = (read_record(docs, "real") or {}) | rounded(found)
    write_record(docs, "real", record)
    page = docs / "real.md"
    page.write_text(filled(page.read_text("utf-8"), parts(record)), "utf-8")


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:4]))
