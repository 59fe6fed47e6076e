"""Odd but valid samples for training, each from a seed: what labs, loggers and thermometers do to a recording."""

from __future__ import annotations

import numpy as np
from gyrotc.train import TrainingData
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_MOST = 4000


def odd_samples(seed: int) -> TrainingData:
    """Samples of 1 to 7 runs: profile, rate of rows, resolution, scale, noise and faults drawn independently."""
    rng = np.random.default_rng([17, seed])
    runs = int(rng.choice([1, 1, 1, 2, 3, 4, 7]))
    block_s = float(rng.choice([0.001, 0.1, 1.0, 10.0, 10.0, 50.0, 300.0]))
    span_c = float(rng.choice([0.01, 1.9, 2.1, 8.0, 40.0, 100.0]))
    scale = float(10.0 ** rng.uniform(-9.0, 9.0)) if rng.random() < 0.5 else float(10.0 ** rng.uniform(-3.0, 4.0))
    shape = rng.normal(0.0, 1.0, 5)
    noise = float(rng.choice([0.0, 1e-6, 1e-3, 0.1, 1.0]))
    lowest_c = rng.uniform(-20.0, 30.0 - 0.5 * span_c)
    kind = str(rng.choice(["cycle", "ramp", "hold", "steps", "walk"]))
    parts = [_run(rng, k, kind, block_s, lowest_c, span_c, shape, noise) for k in range(runs)]
    t, r, y, run, time = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    if rng.random() < 0.3:
        step = float(rng.choice([0.06, 0.5, 2.0]))
        t, r = np.round(t / step) * step, np.round(r / step) * step
    y = scale * (y + float(rng.choice([0.0, 1.0, 1e4])))
    n = len(t)
    data = TrainingData(t, r, y, rng.choice([1.0, 10.0], 1).repeat(n), run, time, np.full(n, block_s))
    if rng.random() < 0.2:  # rows handed over twice
        data = data.select(np.r_[np.arange(n), rng.integers(0, n, n // 2)])
    return data


def _run(
    rng: np.random.Generator,
    k: int,
    kind: str,
    block_s: float,
    lowest_c: float,
    span_c: float,
    shape: Floats,
    noise: float,
) -> tuple[Floats, ...]:
    n = int(rng.integers(8, _MOST // 4))
    phase = np.linspace(0.0, 1.0, n)
    profile = {
        "cycle": 0.5 - 0.5 * np.cos(2.0 * np.pi * phase * rng.integers(1, 4)),
        "ramp": phase,
        "hold": np.full(n, rng.random()) + 0.01 * phase,
        "steps": np.floor(phase * 5.0) / 4.0,
        "walk": np.cumsum(rng.normal(0.0, 1.0 / np.sqrt(n), n)),
    }[kind]
    t = lowest_c + float(rng.choice([0.0, 0.0, 0.3])) * span_c * rng.normal() + span_c * profile
    seconds = block_s * np.arange(n)
    r = np.clip(np.gradient(t, 60.0 * 10.0 / n) if n > 1 else np.zeros(n), -1000.0, 1000.0)
    z = profile - 0.5
    y = shape[0] * z + shape[1] * z**2 + shape[2] * z**3 + shape[3] * np.tanh(r) + shape[4] * np.sin(9.0 * z)
    y = y + noise * rng.normal(0.0, 1.0, n) + float(rng.choice([0.0, 0.0, 0.0, 1.0])) * rng.normal()
    y = y + float(rng.choice([0.0, 0.0, 0.0, 0.0, 0.1])) * np.cumsum(rng.normal(0.0, 0.3, n))
    if rng.random() < 0.2:  # spikes, a start-up row
        y[rng.integers(0, n, max(1, n // 50))] += 1e3 * rng.normal()
    if rng.random() < 0.1:  # a dead or quantised rate
        y = np.round(y)
    return t, r, y, np.full(n, k, dtype=np.int64), seconds
