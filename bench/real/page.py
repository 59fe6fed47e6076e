"""Measured recordings with whole runs or spans left out: docs/results/real.json, docs/real.md and its pictures.

Every axis of every set is judged: the correction of `gyrotc build` against a constant, a cubic in T and a cubic with a
slope in dT/dt, fitted to the same block samples, and against a Gaussian process of scikit-learn (`make real`).

usage: python -m bench.real.page FOLDER-OF-DATA-SETS DOCS WORK
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from gyrotc.assess import evaluate
from gyrotc.common import average_rows
from gyrotc.recordings import axes_of, load
from gyrotc.tables import emit
from gyrotc.train import FitOptions, fit_dataset, folds, front_end, samples_of
from matplotlib.figure import Figure

from ..paper.experiment import AFTER, BEFORE, png
from ..paper.page import filled
from ..records import Record, measured_with, rounded, write_record
from .peers import AVERAGE_S, BLOCK_S, GPR, TRIVIAL, of_others

CYCLE, ISOTHERMAL = "mpu6000-chamber-cycle", "mpu6050-isothermal"
SPANS = (CYCLE, ISOTHERMAL, "pan-lsm6dsm-cold")  # one run each: its branches, or parts, are left out
RUNS = ("atoms3-mpu6886-heating",)  # runs are left out whole
PLOTTED = (CYCLE, ISOTHERMAL)  # with the last span left out
PICTURE_S = 20.0  # shorter than the 100 s of the table, so that eleven minutes show something
ALLOWED = 1.02


@dataclass(frozen=True)
class Case:
    """A data set with a part of it as the exam."""

    name: str
    left_out: str
    data: Path
    plotted: bool


@dataclass(frozen=True)
class Result:
    """One axis of one case: the JSON of `evaluate`, what others leave on the exam (deg/h), where traces lie."""

    case: Case
    axis: str
    method: str
    said: tuple[str, ...]
    evaluation: dict[str, Any]
    others: dict[str, float]
    folder: Path

    @property
    def rms(self) -> float:
        return float(self.evaluation["exam"]["after"]["rms_dph"])


def cases(source: Path, work: Path) -> Iterator[Case]:
    """Every set that is there with every run, or span of its only run, left out in turn."""
    for name in (*SPANS, *RUNS):
        if not (source / name).is_dir():
            print(f"{name} is absent in {source}: skipped")
        elif name in SPANS:
            yield from _spans_out(source / name, work)
        else:
            yield from _runs_out(source / name, work)


def _spans_out(source: Path, work: Path) -> Iterator[Case]:
    data = next(source.glob("*.csv"))
    plain = work / f"{source.name}-plain"
    _described(plain, source.name, [data], ['power_on_s = "unknown"'])
    runs = load(plain, axis=axes_of(plain)[0]).runs
    front = front_end(runs, BLOCK_S)
    pieces = folds(samples_of(front.blocks(runs[0]), front.block_s, 0))
    for k, fold in enumerate(pieces):
        [span] = fold.spans
        folder = work / f"{source.name}-data-{k}"
        before, after = f"to_s = {span.from_s!r}", f"from_s = {span.to_s!r}"
        held = f'from_s = {span.from_s!r}\nto_s = {span.to_s!r}\nrole = "exam"'
        parts = [*([before] if k else []), held, *([after] if k + 1 < len(pieces) else [])]
        _described(folder, source.name, [data] * len(parts), parts)
        label = f"{fold.kind} {span.from_s:.0f} ... {span.to_s:.0f} s"
        yield Case(source.name, label, folder, source.name in PLOTTED and k + 1 == len(pieces))


def _runs_out(source: Path, work: Path) -> Iterator[Case]:
    files = sorted(source.glob("*.csv"))
    for k, held in enumerate(files):
        folder = work / f"{source.name}-data-{k}"
        _described(folder, source.name, files, [f'role = "{"exam" if f == held else "train"}"' for f in files])
        yield Case(source.name, held.stem, folder, False)


def with_exam(source: Path, folder: Path, cut_s: float) -> None:
    """The recording of a set as two runs: before the cut to train on, after it for the exam."""
    data = next(source.glob("*.csv"))
    _described(folder, source.name, [data, data], [f"to_s = {cut_s!r}", f'from_s = {cut_s!r}\nrole = "exam"'])


def _described(folder: Path, serial: str, files: Sequence[Path], runs: Sequence[str]) -> None:
    """A data set of copies of files with a run of each description."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in files:
        (folder / file.name).write_bytes(file.read_bytes())
    text = [f'schema = 1\nserial = "{serial}"\n']
    for file, run in zip(files, runs, strict=True):
        power_on = "" if "power_on_s" in run else 'power_on_s = "unknown"\n'
        text.append(f'[[run]]\nfile = "{file.name}"\n{power_on}{run}\n')
    (folder / "dataset.toml").write_text("".join(text))


def judged(case: Case, work: Path) -> Iterator[Result]:
    """Every axis of a case: fitted and emitted as `gyrotc build` does it, judged through the compiled code."""
    for axis in axes_of(case.data):
        dataset = load(case.data, axis=axis)
        out = work / "out" / case.data.name / axis
        fitted = fit_dataset(dataset, FitOptions(average_s=AVERAGE_S))
        out.mkdir(parents=True, exist_ok=True)
        emit(fitted.model, out, numerics=("f32",))
        trace = out / "trace" if case.plotted else None
        result = evaluate(out, dataset, average_s=AVERAGE_S, trace=trace, training=fitted.training).content()
        said = tuple(finding["id"] for finding in result["findings"])
        yield Result(case, axis, fitted.model.method, said, result, of_others(dataset, result["exam"]["samples"]), out)


def parts(record: Record) -> dict[str, str]:
    """Return the tables and the summary of docs/real.md that a record gives."""
    splits = [Split.of(row) for row in record["splits"]]
    return {"summary": _summary(record, splits), "results": _by_axis(splits), "worse": _worse(splits)}


@dataclass(frozen=True)
class Split:
    """A held-out part of one axis: names, method, and RMS of the correction and of others on it, deg/h."""

    name: str
    left_out: str
    axis: str
    method: str
    rms: float
    others: Mapping[str, float]

    @staticmethod
    def of(row: Mapping[str, Any]) -> Split:
        """Return the split of an entry of the record."""
        rms = float(row["rms_dph"])
        return Split(row["set"], row["left_out"], row["axis"], row["method"], rms, row["others_rms_dph"])

    @property
    def ratio(self) -> float:
        """RMS over that of the best trivial correction."""
        return self.rms / min(self.others[name] for name in TRIVIAL)

    @property
    def verdict(self) -> str:
        """Return whether the correction is as good as the best trivial one, a constant, or neither."""
        return "good" if self.ratio <= ALLOWED else "constant" if self.method == "constant" else "neither"


def _summary(record: Record, splits: Sequence[Split]) -> str:
    counts = {verdict: sum(s.verdict == verdict for s in splits) for verdict in ("good", "constant", "neither")}
    of_constant = sum(s.rms > ALLOWED * s.others["constant"] for s in splits)
    gpr = sum(s.others[GPR] > ALLOWED * s.rms / s.ratio for s in splits)
    with_ = record["measured"]
    return (
        f"Of {len(splits)} held-out parts, the correction of gyrotc is as good as the best trivial one (within "
        f"{ALLOWED - 1:.0%}) on {counts['good']}. On {counts['constant']} more a constant was all that the training "
        f"data supported, and the report says so. On {counts['neither']} a richer correction is worse than the best "
        f"trivial one. On {of_constant} the correction is worse than a constant by more than {ALLOWED - 1:.0%}. "
        f"A Gaussian process of scikit-learn is worse than the best trivial correction on {gpr}.\n\n"
        f"Measured by `make real` on commit {with_['commit']}, {with_['date']}."
    )


def _by_axis(splits: Sequence[Split]) -> str:
    lines = [
        "| set | axis | parts | as good | constant, reported | neither | RMS over the best trivial: median, worst |",
        "| --- | --- | ---: | ---: | ---: | ---: | --- |",
    ]
    for name, axis in dict.fromkeys((s.name, s.axis) for s in splits):
        own = [s for s in splits if (s.name, s.axis) == (name, axis)]
        counts = (sum(s.verdict == verdict for s in own) for verdict in ("good", "constant", "neither"))
        ratios = [s.ratio for s in own]
        cells = (name, axis, len(own), *counts, f"{np.median(ratios):.2f}, {max(ratios):.2f}")
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def _worse(splits: Sequence[Split]) -> str:
    lines = [
        "| set | axis | held-out part | correction | its RMS, deg/h | best trivial | constant |",
        "| --- | --- | --- | --- | ---: | ---: | ---: |",
    ]
    for s in splits:
        if s.verdict == "neither":
            figures = (f"{rms:.1f}" for rms in (s.rms, s.rms / s.ratio, s.others["constant"]))
            lines.append("| " + " | ".join((s.name, s.axis, s.left_out, s.method, *figures)) + " |")
    return "\n".join(lines)


def _named(r: Result) -> str:
    return f"{r.case.name} {r.axis} without {r.case.left_out} ({r.method})"


def picture(results: Sequence[Result]) -> Figure:
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
    return figure


def _traces(result: Result) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Times, rates before and after of every run in order of time, short means."""
    parts = []
    for path in (result.folder / "trace").glob("*.csv"):
        rows = {name: column.to_numpy() for name, column in _columns(path)}
        a = average_rows(
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
    """Writes the tables and the pictures of every set that is there."""
    results: list[Result] = []
    measured = measured_with()
    (docs / "real").mkdir(exist_ok=True)
    for case in cases(source, work):
        of_case = list(judged(case, work))
        for r in of_case:
            print(f"{_named(r)}: {r.rms:.4g}, best trivial {min(r.others[name] for name in TRIVIAL):.4g}", flush=True)
        if case.plotted:
            (docs / "real" / f"{case.name}.png").write_bytes(png(picture(of_case), dpi=125))
        results += of_case
    if results:
        record = {"measured": measured, **rounded({"splits": [_entry(r) for r in results]})}
        write_record(docs, "real", record)
        page = docs / "real.md"
        page.write_text(filled(page.read_text("utf-8"), parts(record)), "utf-8")


def _entry(r: Result) -> dict[str, Any]:
    return {
        "set": r.case.name,
        "left_out": r.case.left_out,
        "axis": r.axis,
        "method": r.method,
        "rms_dph": r.rms,
        "others_rms_dph": r.others,
        "noise_floor_dph": r.evaluation["noise_floor_dph"],
        "findings": list(r.said),
    }


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:4]))
