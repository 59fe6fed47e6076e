"""The paper's experiment on simulated recordings: a model for each environment, trained on set 1, judged on set 2.

Beside it gyrotc's own way: one model over all environments.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..dataset import load
from ..pages.published import ENVIRONMENTS, NEURONS
from ..simulate import simulate
from ..simulate.campaign import Noise
from ..simulate.truth import simulated_floor
from ..train import Fit, TrainingData, fit, predict
from ..train.data import joined, scaling_of
from ..train.fitting import front_end, samples_of
from ..train.ols import fit_ols
from ..train.result import Outcome, network

__all__ = ["AVERAGE_S", "METHODS", "Cell", "Experiment", "PaperGroup", "experiment"]

Array = NDArray[np.float64]

AVERAGE_S = 100.0  # the paper's means
METHODS = {
    "constant": "a constant",
    "mlr": "MLR",
    "rbf_random": "RBFNN, random centers",
    "mrbf_paper": "modified RBFNN",
    "mrbf": "gyrotc, one model",
}
_BLOCK_S = 10.0  # as `fit` has it where nothing else is asked for


@dataclass(frozen=True, slots=True)
class PaperGroup:
    """One environment: blocks of set 1 and of set 2."""

    environment: str
    train: TrainingData
    exam: TrainingData


@dataclass(frozen=True, slots=True)
class Cell:
    """What one method makes of one environment: exam means over 100 s, deg/h, and how many centers it took.

    Attributes:
        before, predicted: Measured bias and the model's, shape (n,).
        centers: How many the model has that was used here.
    """

    before: Array
    predicted: Array
    centers: int

    @property
    def after(self) -> Array:
        """Compensated bias, deg/h."""
        return self.before - self.predicted


@dataclass(frozen=True, slots=True)
class Experiment:
    """All cells by method and environment, and the noise that was really added to the exam runs."""

    cells: dict[str, dict[str, Cell]]
    floor_dph: float

    def exam_ratio(self, method: str) -> float:
        """Pooled RMS after compensation ÷ the noise floor."""
        after = np.concatenate([cell.after for cell in self.cells[method].values()])
        return float(np.sqrt(np.mean(after**2)) / self.floor_dph)


def experiment(seed: int, noise: Noise, folder: Path) -> Experiment:
    """Simulates the paper's two sets for one gyro into `folder`, trains and judges every method."""
    simulate("paper", seed=seed, out=folder, noise=noise)
    groups, floor = _groups(folder)
    cells: dict[str, dict[str, Cell]] = {}
    for method in ("constant", "mlr", "rbf_random", "mrbf_paper"):
        cells[method] = {group.environment: _cell(group, _trained(method, group, seed)) for group in groups}
    whole = joined([group.train for group in groups])
    trained = fit(whole, method="mrbf", average_s=AVERAGE_S)
    cells["mrbf"] = {group.environment: _cell(group, trained) for group in groups}
    return Experiment(cells, floor)


def _groups(folder: Path) -> tuple[list[PaperGroup], float]:
    dataset = load(folder)
    front = front_end(dataset.runs, _BLOCK_S)
    blocks = {
        (run.environment, run.role): samples_of(front.blocks(run), front.block_s, number)
        for number, run in enumerate(dataset.runs)
    }
    groups = [PaperGroup(name, blocks[name, "train"], blocks[name, "exam"]) for name in ENVIRONMENTS]
    floor = simulated_floor(folder, [run.file for run in dataset.runs if run.role == "exam"], AVERAGE_S)
    assert floor is not None  # this data set was simulated
    return groups, floor


def _trained(method: str, group: PaperGroup, seed: int) -> Fit:
    """One model on one environment as the paper does, whatever the temperature tells there."""
    data = group.train
    scaling = scaling_of(data)
    if method in ("constant", "mlr"):
        outcome = _least_squares(data, variables=2 if method == "mlr" else 0)
    else:
        outcome = fit_ols(
            method,
            data,
            scaling,
            seed=seed,
            centers=NEURONS[group.environment] if method == "rbf_random" else None,
            rho=None,
            size_rule=None,
            average_s=AVERAGE_S,
        )
    return Fit(method, outcome, scaling, [], 0.0, AVERAGE_S, float(data.bias_dph.mean()))


def _least_squares(data: TrainingData, variables: int) -> Outcome:
    """Constant and, with two variables, T and dT/dt: what the paper's criterion left of its MLR."""
    inputs = scaling_of(data).normalise(data.temperature_c, data.slope_c_per_min)
    columns = np.column_stack((np.ones(len(data.bias_dph)), *inputs[:variables]))
    weights = np.zeros(3)
    weights[: variables + 1] = np.linalg.lstsq(columns, data.bias_dph, rcond=None)[0]
    return Outcome(networks=(network(weights[0], (weights[1], weights[2])),), curves={})


def _cell(group: PaperGroup, trained: Fit) -> Cell:
    return Cell(
        before=_means(group.exam, group.exam.bias_dph),
        predicted=_means(group.exam, _predicted(trained, group.exam)),
        centers=sum(len(part["centers"]) for part in trained.networks),
    )


def _predicted(trained: Fit, data: TrainingData) -> Array:
    return np.asarray(predict(trained, data.temperature_c, data.slope_c_per_min))


def _means(data: TrainingData, values: Array) -> Array:
    """Means over 100 s of blocks that follow one another without gaps."""
    count = round(AVERAGE_S / float(data.duration_s[0]))
    return np.asarray(values[: len(values) - len(values) % count].reshape(-1, count).mean(axis=1))
