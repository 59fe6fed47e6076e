"""The paper's experiment on simulated recordings: a model for each environment, trained on set 1, judged on set 2.

Beside it gyrotc's own way: one model over all environments. Figures 5 to 11 of the paper again, and one simulated run
as a chamber record: PNG files, as web pages show them.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from gyrotc.common import FloatArray, average_rows, statistics_of
from gyrotc.pages import ENVIRONMENTS, LINE_COLOURS, NEURONS
from gyrotc.recordings import load
from gyrotc.results import write_atomically
from gyrotc.simulate import CELL_S, NoiseName, SimulatedRecord, simulate, simulated_floor
from gyrotc.train import Fit, TrainingData, fit, front_end, joined, predict, samples_of, scaling_of, trained
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

AVERAGE_S = 100.0  # the paper's means
LITERAL_RHO = 3.0e-4  # the paper's "sum of errors", taken as 1 - sum of the error reductions: eq. (16)
METHODS = {
    "constant": "a constant",
    "mlr": "MLR",
    "rbf_random": "RBFNN, random centers",
    "rbf_random_plain": "RBFNN, random centers, no ridge",
    "mrbf_paper": "modified RBFNN",
    "mrbf_paper_literal": "modified RBFNN, ρ = 3.0e-4",
    "mrbf": "gyrotc, one model",
}
_BLOCK_S = 10.0  # as `fit` has it where nothing else is asked for


@dataclass(frozen=True, slots=True)
class PaperGroup:
    """One environment: blocks of set 1 and of set 2.

    Attributes:
        exam_begins_s: Where the means of set 2 begin, s: with the run, although its first block has no input yet.
    """

    environment: str
    train: TrainingData
    exam: TrainingData
    exam_begins_s: float


@dataclass(frozen=True, slots=True)
class Cell:
    """Result of a method in an environment: means of a test run over 100 s, deg/h, and the number of centers.

    Attributes:
        before, after: Measured and compensated bias, shape (n,).
        centers: How many the model has that was used here.
        moved: `after` with the temperature of set 2 moved onto that of set 1, by the difference of their medians.
    """

    before: FloatArray
    after: FloatArray
    centers: int
    moved: FloatArray

    @property
    def predicted(self) -> FloatArray:
        """The model's bias, deg/h."""
        return self.before - self.after


@dataclass(frozen=True, slots=True)
class Experiment:
    """All cells by method and environment, and the noise that was really added to the test runs, deg/h."""

    cells: Mapping[str, Mapping[str, Cell]]
    floor_dph: float

    def figures(self, *, whole: bool) -> dict[str, Any]:
        """Return the figures of docs/paper.md, deg/h: mean, σ and RMS before and after, and centers; else RMS after."""
        before = {name: _figures(cell.before) for name, cell in self.cells["constant"].items()}
        after = {
            method: {name: _after(cell, whole) for name, cell in cells.items()} for method, cells in self.cells.items()
        }
        kept = {"floor_dph": self.floor_dph, "after": after}
        return kept | {"before": before} if whole else kept


def _after(cell: Cell, whole: bool) -> dict[str, Any]:
    rms = {"rms_dph": _figures(cell.after)["rms_dph"], "moved_rms_dph": _figures(cell.moved)["rms_dph"]}
    return {**_figures(cell.after), "centers": cell.centers, **rms} if whole else rms


def _figures(values: FloatArray) -> dict[str, Any]:
    found = statistics_of(values)
    return {name: found[name] for name in ("mean_dph", "std_dph", "rms_dph")}


def experiment(seed: int, noise: NoiseName, folder: Path) -> Experiment:
    """Simulates the paper's two sets for one gyro into `folder`, trains and judges every method."""
    simulate("paper", seed=seed, out=folder, noise=noise)
    groups, floor = groups_of(folder)
    whole = joined([group.train for group in groups])
    ours = fit(whole, method="mrbf", average_s=AVERAGE_S)
    cells = {
        method: {
            group.environment: _cell(group, ours if method == "mrbf" else _trained(method, group, seed))
            for group in groups
        }
        for method in METHODS
    }
    return Experiment(cells, floor)


def groups_of(folder: Path) -> tuple[list[PaperGroup], float]:
    """The environments of a simulated data set in the order of Table 1, and the noise of its test runs, deg/h."""
    dataset = load(folder)
    front = front_end(dataset.runs, _BLOCK_S)
    blocks, begins = {}, {}
    for number, run in enumerate(dataset.runs):
        found = front.blocks(run)
        blocks[run.environment, run.role] = samples_of(found, front.block_s, number)
        begins[run.environment, run.role] = found.begins_s or 0.0
    groups = [
        PaperGroup(name, blocks[name, "train"], blocks[name, "exam"], begins[name, "exam"]) for name in ENVIRONMENTS
    ]
    floor = simulated_floor(folder, [run.file for run in dataset.runs if run.role == "exam"], AVERAGE_S)
    assert floor is not None  # this data set was simulated
    return groups, floor


def _trained(method: str, group: PaperGroup, seed: int) -> Fit:
    """One model on one environment as the paper does, whatever the temperature tells there."""
    data = group.train
    scaling = scaling_of(data)
    options: dict[str, Any] = {}
    if method.startswith("rbf_random"):
        options["centers"] = NEURONS[group.environment]
    if method == "rbf_random_plain":
        options["ridge"] = 0.0
    if method == "mrbf_paper_literal":
        options["rho"] = LITERAL_RHO
    name = method.removesuffix("_plain").removesuffix("_literal")
    outcome = trained(name, data, scaling, seed=seed, average_s=AVERAGE_S, **options)
    return Fit(name, outcome, scaling, [], 0.0, AVERAGE_S, float(data.bias_dph.mean()))


def _cell(group: PaperGroup, fitted: Fit) -> Cell:
    exam = group.exam
    offset_c = float(np.median(exam.temperature_c) - np.median(group.train.temperature_c))
    before, after = _means(group, predict(fitted, exam.temperature_c, exam.slope_c_per_min))
    _, moved = _means(group, predict(fitted, exam.temperature_c - offset_c, exam.slope_c_per_min))
    return Cell(before, after, fitted.n_centers, moved)


def _means(group: PaperGroup, predicted: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Measured and compensated bias of set 2 as means over 100 s."""
    exam = group.exam
    means = average_rows(
        exam.time_s,
        exam.temperature_c,
        exam.bias_dph,
        exam.bias_dph - predicted,
        scored=np.ones(len(exam), dtype=bool),
        average_s=AVERAGE_S,
        from_s=group.exam_begins_s,
    )
    return means.before_dph, means.after_dph


BEFORE, AFTER, COVERED = (LINE_COLOURS[name][0] for name in ("before", "after", "covered"))
STYLE: Any = {
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
}

_ZOOM = slice(50, 101)
_DPI = 90  # 900 pixels across, as wide as a page of text
_COLOURS = 32  # of a picture with two kinds of lines; none is larger than 60 kB
_CONSTANT, _VARIABLE = ENVIRONMENTS[:3], ENVIRONMENTS[3:]

Series = Mapping[str, Mapping[str, Sequence[float]]]
"""Means over 100 s in deg/h by environment: `measured`, and what the model of each method says."""
_Shown = tuple[NDArray[np.float64], NDArray[np.float64]]  # measured and modelled bias of an environment
_Panel = Callable[[Axes, _Shown, slice], None]


def _measured(ax: Axes, shown: _Shown, part: slice) -> None:
    ax.plot(_samples(shown, part), 1e3 * shown[0][part], color=BEFORE, linewidth=0.7, label="zero bias")


def _identified(ax: Axes, shown: _Shown, part: slice) -> None:
    _measured(ax, shown, part)
    ax.plot(_samples(shown, part), 1e3 * shown[1][part], color=AFTER, linewidth=1.2, label="model")


def _compensated(ax: Axes, shown: _Shown, part: slice) -> None:
    ax.axhline(0.0, color="#222222", linewidth=0.6)
    after = 1e3 * (shown[0] - shown[1])[part]
    ax.plot(_samples(shown, part), after, color=AFTER, linewidth=0.7, label="compensated")


def _samples(shown: _Shown, part: slice) -> Any:
    return np.arange(len(shown[0]))[part]


FIGURES: dict[int, tuple[str, str, _Panel, bool]] = {
    5: ("mlr", "Filtered zero bias", _measured, False),
    6: ("mlr", "Forecasting by MLR", _identified, False),
    7: ("rbf_random", "Identification by the RBFNN with random centers", _identified, True),
    8: ("mrbf_paper", "Identification by the modified RBFNN", _identified, True),
    9: ("mlr", "Compensated zero bias, MLR", _compensated, False),
    10: ("rbf_random", "Compensated zero bias, RBFNN with random centers", _compensated, False),
    11: ("mrbf_paper", "Compensated zero bias, modified RBFNN", _compensated, False),
}
"""Number in the paper: method, title, what a panel shows, whether samples 50 to 100 are enlarged."""


def draw(series: Series, folder: Path, numbers: Iterable[int] = tuple(FIGURES)) -> list[Path]:
    """Writes `figure-05.png` to `figure-11.png`, or those of `numbers`, into `folder`.

    Each has the checksum of the series as its description.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for number in numbers:
        path = folder / f"figure-{number:02d}.png"
        write_atomically(path, _figure(series, number))
        written.append(path)
    return written


def checksum(series: Series) -> str:
    """Which series a figure shows."""
    return "sha256:" + hashlib.sha256(json.dumps(series, sort_keys=True).encode()).hexdigest()


def _figure(series: Series, number: int) -> bytes:
    method, title, panel, enlarged = FIGURES[number]
    cells = {
        name: (np.array(measured), np.array(series[method][name])) for name, measured in series["measured"].items()
    }
    whole = slice(None)
    rows = [(_CONSTANT, whole), (_VARIABLE, whole)]
    if enlarged:
        rows += [(_CONSTANT, _ZOOM), (_VARIABLE, _ZOOM)]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 0.6 + 1.8 * len(rows)), layout="constrained")
        axes = figure.subplots(len(rows), 3, sharey=True, squeeze=False)
        for letter, line, (environments, part) in zip("abcd", axes, rows, strict=False):
            _line(line, letter, [(name, cells[name]) for name in environments], panel, part)
        for ax in axes[-1]:
            ax.set_xlabel("time, 100 s")
        handles, labels = axes[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=2)
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
        return png(figure, checksum(series))


def png(figure: Figure, description: str = "", dpi: int = _DPI, colours: int = _COLOURS) -> bytes:
    """A picture with a palette, less than half the bytes of one without."""
    drawn, small, about = io.BytesIO(), io.BytesIO(), PngInfo()
    figure.savefig(drawn, format="png", dpi=dpi)
    about.add_text("Description", description)
    picture = Image.open(drawn).convert("RGB").quantize(colours)
    picture.save(small, "png", optimize=True, pnginfo=about)
    return small.getvalue()


def _line(axes: Sequence[Axes], letter: str, cells: Sequence[tuple[str, _Shown]], panel: _Panel, part: slice) -> None:
    for ax, (name, shown) in zip(axes, cells, strict=True):
        panel(ax, shown, part)
        ax.set_title(f"({letter}) {name}", fontsize=8.5, loc="left")
    axes[0].set_ylabel("1e-3 deg/h")


def draw_run(record: SimulatedRecord, title: str, path: Path) -> None:
    """Writes one simulated run: temperatures, and the bias under its noise, over hours."""
    path.parent.mkdir(parents=True, exist_ok=True)
    hours = CELL_S * np.arange(len(record.cavity_c)) / 3600.0
    cells = round(AVERAGE_S / CELL_S)
    measured, true = (np.diff(angle[::cells]) / AVERAGE_S for angle in (record.angle_arcsec, record.true_arcsec))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 4.6), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True)
        above.plot(hours, record.air_c, color=COVERED, linewidth=0.8, label="air in the chamber")
        above.plot(hours[:-1], record.reading_c, color=BEFORE, linewidth=1.2, label="sensor on the block")
        above.plot(hours, record.cavity_c, color=AFTER, linewidth=0.8, linestyle="--", label="cavity")
        above.set_ylabel("C")
        below.plot(hours[cells::cells], 1e3 * measured, color=BEFORE, linewidth=0.7, label="measured, 100 s")
        below.plot(hours[cells::cells], 1e3 * true, color=AFTER, linewidth=1.2, label="true bias")
        below.set_ylabel("1e-3 deg/h")
        below.set_xlabel("time, h")
        for ax in (above, below):
            ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
        write_atomically(path, png(figure, colours=4 * _COLOURS))
