"""Measured recordings with the last span left out: results into docs/real.md, pictures into docs/real/ (`make real`).

usage: python tools/real.py FOLDER-OF-DATA-SETS DOCS WORK
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from gyrotc.dataset import axes_of, load
from gyrotc.metrics import average
from gyrotc.pages.plots import AFTER, BEFORE, svg
from gyrotc.paper.page import filled
from gyrotc.train.fitting import front_end, samples_of
from gyrotc.train.spans import training_spans
from matplotlib.figure import Figure

SETS = ("mpu6000-chamber-cycle", "mpu6050-isothermal")
BLOCK_S = 10.0
PICTURE_S = 20.0  # shorter than the 100 s of the table, so that eleven minutes show something


@dataclass(frozen=True)
class Result:
    """One axis of one set: the JSON of `evaluate`, and where its traces lie."""

    name: str
    axis: str
    evaluation: dict[str, Any]
    folder: Path


def last_span_starts(folder: Path, axis: str) -> float:
    """Where the last span of the only run of a set begins, s."""
    runs = load(folder, axis=axis).runs
    front = front_end(runs, BLOCK_S)
    return training_spans(runs, samples_of(front.blocks(runs[0]), front.block_s, 0))[-1].from_s


def with_exam(source: Path, folder: Path, cut_s: float) -> None:
    """The recording of a set as two runs: before the cut to train on, after it for the exam."""
    folder.mkdir(parents=True, exist_ok=True)
    data = next(source.glob("*.csv"))
    (folder / data.name).write_bytes(data.read_bytes())
    run = f'[[run]]\nfile = "{data.name}"\npower_on_s = "unknown"\n'
    (folder / "dataset.toml").write_text(
        f'schema = 1\nserial = "{source.name}"\ndescription = "the last span is the exam"\n'
        f'{run}to_s = {cut_s!r}\n{run}from_s = {cut_s!r}\nrole = "exam"\n'
    )


def built(source: Path, work: Path) -> list[Result]:
    """Builds every axis of a set with its last span left out."""
    axes = axes_of(source)
    data, out = work / f"{source.name}-data", work / source.name
    with_exam(source, data, last_span_starts(source, axes[0]))
    program = Path(sys.executable).with_name("gyrotc")
    subprocess.run([program, "build", data, "--axis", "all", "--out", out], check=True)
    return [
        Result(source.name, axis, json.loads((out / axis / "evaluate.json").read_text()), out / axis)
        for axis in axes
    ]


def table(results: list[Result]) -> str:
    """A row for each axis; rates in deg/h, means over 100 s."""
    head = (
        "set",
        "axis",
        "RMS with a constant, exam",
        "RMS after, training",
        "RMS after, exam",
        "noise floor",
        "centers",
        "findings",
    )
    lines = ["| " + " | ".join(head) + " |", "| --- " * len(head) + "|"]
    for r in results:
        e = r.evaluation
        cells = [
            r.name,
            r.axis,
            f"{constant_rms(e):.1f}",
            f"{e['train']['after']['rms_dph']:.1f}",
            f"{e['exam']['after']['rms_dph']:.1f}",
            f"{e['noise_floor_dph']:.1f}",
            str(e["model"]["centers"]),
            ", ".join(f"`{f['id']}`" for f in e["findings"]),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def constant_rms(evaluation: dict[str, Any]) -> float:
    """RMS on the exam where the mean of training is the correction, deg/h."""
    before = evaluation["exam"]["before"]
    return float(np.hypot(before["std_dph"], before["mean_dph"] - evaluation["train"]["before"]["mean_dph"]))


def picture(results: list[Result]) -> str:
    """Before (without its mean in training) and after compensation over time, a panel for each axis."""
    figure = Figure(figsize=(7.2, 1.9 * len(results)), layout="constrained")
    panels = figure.subplots(len(results), 1, sharex=True, squeeze=False)[:, 0]
    for panel, result in zip(panels, results, strict=True):
        mean = result.evaluation["train"]["before"]["mean_dph"]
        for trace, run in zip(_traces(result), result.evaluation["runs"], strict=True):
            minutes = trace[0] / 60.0
            panel.plot(minutes, trace[1] - mean, color=BEFORE, lw=0.9, label="before")
            panel.plot(minutes, trace[2], color=AFTER, lw=0.9, label="after")
            if run["role"] == "exam":
                panel.axvspan(run["from_s"] / 60.0, minutes[-1], color="#eeeeee", zorder=0)
        panel.set_ylabel(f"{result.axis}, deg/h")
    handles, labels = panels[0].get_legend_handles_labels()
    panels[0].legend(handles[:2], labels[:2], ncols=2, loc="best")
    panels[-1].set_xlabel("time, min (grey: left out of training)")
    return svg(figure)


def _traces(result: Result) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Times, rates before and after of every run in order of time, short means."""
    parts = []
    for path in (result.folder / "trace").glob("*.csv"):
        rows = {name: column.to_numpy() for name, column in _columns(path)}
        a = average(
            rows["time_s"],
            rows["temperature_c"],
            rows["rate_dph"],
            rows["compensated_dph"],
            scored=np.ones(len(rows["time_s"]), dtype=bool),
            average_s=PICTURE_S,
        )
        parts.append((a.time_s, a.before_dph, a.after_dph))
    return sorted(parts, key=lambda part: float(part[0][0]))


def _columns(path: Path) -> list[tuple[str, pa.ChunkedArray]]:
    trace = pacsv.read_csv(path)
    return list(zip(trace.column_names, trace.columns, strict=True))


def main(source: Path, docs: Path, work: Path) -> None:
    """Writes the table and the pictures of every set that is there."""
    results: list[Result] = []
    (docs / "real").mkdir(exist_ok=True)
    for name in SETS:
        if not (source / name).is_dir():
            print(f"{name} is absent in {source}: skipped")
            continue
        of_set = built(source / name, work)
        (docs / "real" / f"{name}.svg").write_text(picture(of_set), "utf-8")
        results += of_set
    if results:
        page = docs / "real.md"
        page.write_text(filled(page.read_text("utf-8"), {"results": table(results)}), "utf-8")


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:4]))
