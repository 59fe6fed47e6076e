"""Diagnosis of measured recordings: tables of docs/real.md (part of `make real`).

usage: python -m bench.real.diagnosis FOLDER-OF-DATA-SETS DOCS WORK
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.diagnose import Effect, Refitting, cycle_of, records_of
from gyrotc.recordings import load
from gyrotc.train import FitOptions, TrainingData, front_end, samples_of

from ..paper.page import filled
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


def after(result: Result) -> float:
    """RMS on the unseen branch with the best states, named and shipped or not; without any the plain map's."""
    gain = result["single_cycle"]["gain"]
    return float(gain["exam_rms_after_dph"] if gain else result["baseline"]["exam_rms_dph"])


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


def gains(results: dict[str, Result], spreads: dict[str, list[float]], cubics: dict[str, float]) -> Iterator[str]:
    """A row for each axis: unseen branch without and with what was named, over the sizes of the map."""
    yield (
        "| axis | verdict | cubic in T with dT/dt | map of (T, dT/dt) alone, default size "
        "| with the states, default size | removed, 95 % | median over map sizes | smallest … largest |"
    )
    yield "| --- " * 8 + "|"
    for axis, first in results.items():
        spread = spreads[axis]
        gain = first["single_cycle"]["gain"]
        removed = gain["rms_removed_dph"] if gain else {"low": 0.0, "high": 0.0}
        cells = [
            axis, first["verdict"], f"{cubics[axis]:.0f}", f"{first['baseline']['exam_rms_dph']:.0f}",
            f"{after(first):.0f}", f"{removed['low']:.0f} … {removed['high']:.0f}", f"{np.median(spread):.0f}",
            f"{min(spread):.0f} … {max(spread):.0f}",
        ]  # fmt: skip
        yield "| " + " | ".join(cells) + " |"


def tried(results: dict[str, Result]) -> Iterator[str]:
    """What was tried beside a map of T on the first 3130 s."""
    yield "| axis | beside a map of T | parameters (95 %) | RMS left in training, deg/h | criterion | resolved | |"
    yield "| --- " * 7 + "|"
    for axis, result in results.items():
        named = sorted(c["id"] for c in result["causes"] if c["family"] != "noise")
        cycle = result["single_cycle"]
        yield f"| {axis} | nothing | | {cycle['map_rms_dph']:.0f} | 0 | | |"
        best = cycle["static"][0]
        powers = ", ".join(_product(*power) for power in best["powers"])
        yield f"| {axis} | no memory: {powers} | | {best['rms_dph']:.0f} | {best['criterion']:.1f} | | |"
        for t in cycle["tried"]:
            ids = [s["id"] for s in t["states"]]
            cells = [
                axis, " + ".join(f"`{i}`" for i in ids), "; ".join(map(_parameters, t["states"])),
                f"{t['rms_dph']:.0f}", f"{t['criterion']:.1f}", "yes" if t["resolved"] else "no",
                "**named**" if sorted(ids) == named else "",
            ]  # fmt: skip
            yield "| " + " | ".join(cells) + " |"


def _product(of_t: int, of_rate: int) -> str:
    """A product of powers of T and r = dT/dt."""
    factors = [f"{name}^{power}" if power > 1 else name for name, power in (("T", of_t), ("r", of_rate)) if power]
    return " ".join(factors)


def _parameters(state: Result) -> str:
    return ", ".join(f"{n} {p['value']:.3g} ({p['low']:.3g} … {p['high']:.3g})" for n, p in state.items() if n != "id")


def isothermal(results: dict[str, Result]) -> Iterator[str]:
    """What is said where nothing can be learnt."""
    yield "| axis | verdict | in words |"
    yield "| --- | --- | --- |"
    for axis, result in results.items():
        yield f"| {axis} | `{result['verdict']}` | {result['text']} |"


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
    cycles: dict[str, Result] = {}
    for axis in "xyz":
        cycles[axis] = diagnosed(data, axis, work / f"diagnosis-{axis}")
    rest = _data(source, work, ISOTHERMAL)
    still = {axis: diagnosed(rest, axis, work / f"diagnosis-still-{axis}") for axis in "xyz"}
    page = docs / "real.md"
    cubics = {axis: cubic(data, axis) for axis in cycles}
    parts: dict[str, Sequence[str]] = {
        "gains": list(gains(cycles, {axis: of_sizes(data, axis) for axis in cycles}, cubics)),
        "tried": list(tried(cycles)),
        "isothermal": list(isothermal(still)),
    }
    text = filled(page.read_text("utf-8"), {name: "\n".join(lines) for name, lines in parts.items()})
    page.write_text(text, "utf-8")


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:4]))
