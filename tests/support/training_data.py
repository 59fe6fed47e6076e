"""Samples for the tests of training: a smooth map on a chamber-like path through (T, dT/dt), with white noise."""

from __future__ import annotations

import numpy as np
from gyrotc.train import TrainingData
from numpy.typing import NDArray

NOISE_DPH = 7e-4  # of 100-s means
BLOCK_S = 10.0


def true_bias(temperature_c: NDArray[np.float64], slope: NDArray[np.float64]) -> NDArray[np.float64]:
    """A map without Gaussians: rational in T, saturating in dT/dt. deg/h, C, C/min."""
    t = temperature_c / 40.0
    flow = slope / np.sqrt(1.0 + (slope / 3.0) ** 2)
    well = 1.0 / (1.0 + ((temperature_c - 15.0) / 18.0) ** 2)
    return np.asarray(7e-3 + 1.2e-3 * t / (1.0 + t * t) - 1e-3 * well + 1e-4 * flow)


def samples(seed: int, *, noise_dph: float = NOISE_DPH, hours: float = 4.0) -> TrainingData:
    """Three runs: a hold at 20 C, ramps at 1 and at 4 C/min between -40 and 60 C with holds at both ends."""
    rng = np.random.default_rng(seed)
    n = int(hours * 3600.0 / BLOCK_S)
    time_s = BLOCK_S * np.arange(n)
    parts = []
    for run, rate in enumerate((0.0, 1.0, 4.0)):
        t, r = _path(rate, time_s)
        t, r = t + rng.normal(0.0, 0.01, n), r + rng.normal(0.0, 0.02, n)
        noise = rng.normal(0.0, noise_dph * np.sqrt(100.0 / BLOCK_S), n)
        parts.append((t, r, true_bias(t, r) + noise, np.full(n, run), time_s))
    t, r, y, run, time = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    n = len(y)
    return TrainingData(t, r, y, np.full(n, 10.0), run.astype(np.int64), time, np.full(n, BLOCK_S))


def _path(rate: float, time_s: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if rate == 0.0:
        return np.full(len(time_s), 20.0), np.zeros(len(time_s))
    ramp_s, hold_s = 100.0 / rate * 60.0, 1800.0
    phase = np.mod(time_s, 2.0 * (ramp_s + hold_s))
    knots = np.array([0.0, ramp_s, ramp_s + hold_s, 2 * ramp_s + hold_s, 2 * (ramp_s + hold_s)])
    t = np.interp(phase, knots, [-40.0, 60.0, 60.0, -40.0, -40.0])
    slopes = np.array([rate, 0.0, -rate, 0.0])
    return t, slopes[np.searchsorted(knots, phase, side="right") - 1]


def rms(x: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(x))))
