"""Peers of `page`: what is fitted to the same block samples and judged on the same rows.

A constant, a cubic in T, a cubic with a slope in dT/dt, and a Gaussian process of scikit-learn.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from gyrotc.common import average_rows
from gyrotc.recordings import Dataset, Run
from gyrotc.train import Blocks, FrontEnd, TrainingData, front_end, joined, samples_of
from gyrotc.train import average_samples as means_of

BLOCK_S = 10.0
AVERAGE_S = 100.0
TRIVIAL = {
    "constant": ((0, 0),),
    "cubic": ((0, 0), (1, 0), (2, 0), (3, 0)),
    "cubic + dT/dt": ((0, 0), (1, 0), (2, 0), (3, 0), (0, 1)),
}
GPR = "GPR"
Correction = Callable[[Blocks], np.ndarray]  # deg/h of every block of a run


def of_others(dataset: Dataset, scored: int) -> dict[str, float]:
    """RMS on the exam of what is fitted to the same block samples, on the rows that `evaluate` scores, deg/h."""
    runs = [run for run in dataset.runs if run.role == "train"]
    front = front_end(runs, BLOCK_S)
    train = joined([samples_of(front.blocks(run), front.block_s, k) for k, run in enumerate(runs)])
    peers: dict[str, Correction] = {n: _least_squares(train, powers) for n, powers in TRIVIAL.items()}
    peers[GPR] = _gaussian_process(train)
    exam = [_rows_of(front, run) for run in dataset.runs if run.role == "exam"]
    found = {name: _rms(exam, peer) for name, peer in peers.items()}
    judged = sum(_means(part, np.zeros(len(part.blocks.start_s))).size for part in exam)
    if judged != scored:
        raise SystemExit(f"{dataset.folder}: peers are judged on {judged} means, gyrotc on {scored}")
    return found


@dataclass(frozen=True)
class ExamRows:
    """A run of the exam: its rows within the span, the block of each, and which of them are scored."""

    blocks: Blocks
    time_s: np.ndarray
    temperature_c: np.ndarray
    rate_dph: np.ndarray
    block: np.ndarray
    scored: np.ndarray


def _rows_of(front: FrontEnd, run: Run) -> ExamRows:
    rows, blocks = run.rows(), front.blocks(run)
    position = blocks.stream.position
    block = position // blocks.settings.samples_per_block
    inside = run.in_span(rows.time_s)
    scored = blocks.valid[block] & (blocks.steps.in_force(position) >= 0)
    columns = (rows.time_s, rows.temperature_c, rows.rate_dph, block, scored)
    return ExamRows(blocks, *(column[inside] for column in columns))


def _rms(exam: Sequence[ExamRows], peer: Correction) -> float:
    """Of means over 100 s, as `evaluate` makes them."""
    left = np.concatenate([_means(part, peer(part.blocks)) for part in exam])
    return float(np.sqrt(np.mean(left**2)))


def _means(part: ExamRows, correction: np.ndarray) -> np.ndarray:
    """Return what a correction of each block leaves, means of the scored rows."""
    after = part.rate_dph - np.nan_to_num(correction)[part.block]
    return average_rows(
        part.time_s,
        part.temperature_c,
        part.rate_dph,
        after,
        scored=part.scored,
        average_s=AVERAGE_S,
    ).after_dph


def _scaled(train: TrainingData) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Standardised temperature and rate, held at the ends of what was trained on, as the runtime does."""

    def scaled(temperature_c: np.ndarray, slope_c_per_min: np.ndarray) -> np.ndarray:
        columns = []
        for known, asked in ((train.temperature_c, temperature_c), (train.slope_c_per_min, slope_c_per_min)):
            spread = float(known.std()) or 1.0
            columns.append((np.clip(asked, known.min(), known.max()) - known.mean()) / spread)
        return np.stack(columns, axis=1)

    return scaled


def _in_force(blocks: Blocks) -> tuple[np.ndarray, np.ndarray]:
    """Temperature, C, and rate, C/min, in force during each block."""
    per_minute = 60e6 / blocks.settings.block_us
    return blocks.temperature_c.astype(np.float64), blocks.slope_c.astype(np.float64) * per_minute


def _least_squares(train: TrainingData, powers: Sequence[tuple[int, int]]) -> Correction:
    scaled = _scaled(train)

    def columns(t: np.ndarray, r: np.ndarray) -> np.ndarray:
        x = scaled(t, r)
        return np.stack([x[:, 0] ** a * x[:, 1] ** b for a, b in powers], axis=1)

    root = np.sqrt(train.weight)
    design = columns(train.temperature_c, train.slope_c_per_min)
    found = np.linalg.lstsq(design * root[:, None], train.bias_dph * root, rcond=None)[0]
    return lambda blocks: np.asarray(columns(*_in_force(blocks)) @ found)


def _gaussian_process(train: TrainingData) -> Correction:
    """scikit-learn with a kernel of two length scales and noise, on means over 50 s."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    means, scaled = means_of(train, 50.0), _scaled(train)
    kernel = ConstantKernel(1.0) * RBF([1.0, 1.0]) + WhiteKernel(0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = GaussianProcessRegressor(kernel, normalize_y=True).fit(
            scaled(means.temperature_c, means.slope_c_per_min), means.bias_dph
        )
    return lambda blocks: np.asarray(model.predict(np.nan_to_num(scaled(*_in_force(blocks)))))
