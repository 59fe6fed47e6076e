"""Clean single chamber cycles: simulated gyros without any hidden cause, each with a programme of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from gyrotc.diagnose import Records, records_of
from gyrotc.recordings import load
from gyrotc.simulate import simulate

NOISE = (0.2, 0.5, 1.0, 2.0)
"""Levels of the noise, of 7e-4 deg/h of 100-s means."""
_WHITE = 7e-4 * (100.0 / 3600.0) ** 0.5


def clean_cycle(folder: Path, seed: int, noise: float) -> Records:
    """Records of one cycle, or a ramp, whose gyro has a static map of (T, dT/dt) and white noise."""
    rng = np.random.default_rng([seed, 17])
    low, high = rng.uniform(-40.0, -10.0), rng.uniform(40.0, 60.0)
    turns = [high, low] if rng.uniform() < 0.5 else [low, high]
    start = float(rng.uniform(10.0, 30.0)) if rng.uniform() < 0.5 else turns[1]
    legs = [*turns, start][: int(rng.integers(1, 4))]
    rates = np.exp(rng.uniform(np.log(0.7), np.log(5.0), len(legs)))
    steps = ", ".join(f"{{ramp_to_c = {t:.1f}, c_per_min = {r:.2f}}}" for t, r in zip(legs, rates, strict=True))
    minutes = _minutes(start, legs, rates) + float(rng.uniform(0.0, 20.0))
    scenario = folder / f"cycle-{seed}.toml"
    scenario.write_text(
        f'title = "one cycle"\n[noise]\narw_deg_per_sqrt_h = {noise * _WHITE}\n'
        f"[profile.cycle]\nstart_c = {start:.1f}\nrecord_min = {minutes:.0f}\nsteps = [{steps}, {{hold_min = 60}}]\n"
        '[[set]]\nrole = "train"\nstarted = 2026-03-02T08:00:00Z\nprofiles = ["cycle"]\n',
        "utf-8",
    )
    data = folder / f"data-{seed}"
    simulate(scenario, seed=seed, out=data, row_s=10.0)
    return records_of(load(data), "train", block_s=10.0, average_s=100.0)


def _minutes(start: float, legs: Sequence[float], rates: Sequence[float]) -> float:
    return float(np.sum(np.abs(np.diff([start, *legs])) / rates))
