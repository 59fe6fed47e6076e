"""The paper's experiment on simulated recordings: a model for each environment, trained on set 1, judged on set 2.

Beside it gyrotc's own way: one model over all environments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..common.arrays import FloatArray
from ..common.metrics import average, statistics
from ..pages.comparison import ENVIRONMENTS, NEURONS
from ..recordings.load import load
from ..simulate.campaign import Noise, simulate
from ..simulate.truth import simulated_floor
from ..train.data import TrainingData, joined, scaling_of
from ..train.fitting import front_end, samples_of
from ..train.methods import fit, trained
from ..train.result import Fit, predict

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
    """What one method makes of one environment: exam means over 100 s, deg/h, and how many centers it took.

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
    """All cells by method and environment, and the noise that was really added to the exam runs, deg/h."""

    cells: Mapping[str, Mapping[str, Cell]]
    floor_dph: float

    def figures(self, *, whole: bool) -> dict[str, Any]:
        """What docs/paper.md is made of, in deg/h: mean, σ and RMS before and after, and centers; else RMS after."""
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
    found = statistics(values)
    return {name: found[name] for name in ("mean_dph", "std_dph", "rms_dph")}


def experiment(seed: int, noise: Noise, folder: Path) -> Experiment:
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
    """The environments of a simulated data set in the order of Table 1, and the noise of its exam runs, deg/h."""
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
    means = average(
        exam.time_s,
        exam.temperature_c,
        exam.bias_dph,
        exam.bias_dph - predicted,
        scored=np.ones(len(exam), dtype=bool),
        average_s=AVERAGE_S,
        from_s=group.exam_begins_s,
    )
    return means.before_dph, means.after_dph
