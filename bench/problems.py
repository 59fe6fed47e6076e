"""What is solved: simulated gyros in the paper's environments, and clouds of samples of any size."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from gyrotc.recordings.load import load
from gyrotc.simulate.campaign import simulate
from gyrotc.simulate.truth import read_truth
from gyrotc.train.data import TrainingData, average, joined
from gyrotc.train.fitting import front_end, samples_of
from numpy.typing import NDArray

__all__ = ["AVERAGE_S", "BLOCK_S", "Gyro", "Predictor", "cloud", "gyro", "joined", "means", "ratio"]

Floats = NDArray[np.float64]
Predictor = Callable[[Floats, Floats], Floats]

BLOCK_S = 10.0
AVERAGE_S = 100.0


@dataclass(frozen=True, slots=True)
class Gyro:
    """A simulated gyro: blocks of set 1, blocks of set 2 by run, noise of the 100-s means of set 2 by run."""

    train: tuple[TrainingData, ...]
    exam: tuple[TrainingData, ...]
    noise: tuple[Floats, ...]


@lru_cache(maxsize=40)
def gyro(scenario: str, seed: int) -> Gyro:
    """Simulates a scenario and passes it through the front end."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "data"
        simulate(scenario, seed=seed, out=folder)
        dataset, truth = load(folder), read_truth(folder)
        assert truth is not None
        front = front_end(dataset.runs, BLOCK_S)
        parts = [samples_of(front.blocks(run), front.block_s, k) for k, run in enumerate(dataset.runs)]
        roles = [run.role for run in dataset.runs]
        noise = tuple(truth.mean_noise_dph(r.file, AVERAGE_S) for r in dataset.runs if r.role == "exam")
    train = tuple(p for p, role in zip(parts, roles, strict=True) if role == "train")
    exam = tuple(p for p, role in zip(parts, roles, strict=True) if role == "exam")
    return Gyro(train, exam, noise)


def means(data: TrainingData) -> tuple[Floats, Floats, Floats]:
    """Temperature, its rate and bias of 100-s means: what the peers are trained on."""
    m = average(data, AVERAGE_S)
    return m.temperature_c, m.slope_c_per_min, m.bias_dph


def ratio(predict: Predictor, unit: Gyro, runs: Sequence[int] | None = None) -> float:
    """Exam RMS of compensated 100-s means over the RMS of the noise that was really added."""
    squares, noise = 0.0, 0.0
    for k in range(len(unit.exam)) if runs is None else runs:
        s = unit.exam[k]
        after = s.bias_dph - predict(s.temperature_c, s.slope_c_per_min)
        per = round(AVERAGE_S / BLOCK_S)
        residual = after[: len(after) // per * per].reshape(-1, per).mean(axis=1)
        squares += float(residual @ residual)
        noise += float(unit.noise[k] @ unit.noise[k])
    return float(np.sqrt(squares / noise))


def cloud(n: int) -> tuple[Floats, Floats, Floats]:
    """n samples at normalised inputs, distributed as the paper's: half in holds, half on ramps; a smooth map, noise."""
    rng = np.random.default_rng(n)
    half = n // 2
    t = np.concatenate(
        [rng.choice([-0.95, 0.2, 0.95], half) + rng.normal(0.0, 0.01, half), rng.uniform(-1, 1, n - half)]
    )
    r = np.concatenate([rng.normal(0.0, 0.01, half), rng.choice([-1.0, -0.6, -0.2, 0.2, 0.6, 1.0], n - half)])
    t, r = np.clip(t, -1.0, 1.0), np.clip(r + rng.normal(0.0, 0.01, n), -1.0, 1.0)
    y = np.sin(3.0 * t) / (1.5 + t * t) + 0.3 * r * np.exp(t) / (1.0 + r * r) + rng.normal(0.0, 0.5, n)
    return t, r, y
