"""A finer map: bumps that are there are found with their place and width, and none where there are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gyrotc.train.data import TrainingData, cleaned, scaling_of
from gyrotc.train.methods import fit
from gyrotc.train.mrbf import Bumps, find_bumps
from gyrotc.train.result import predict

SEED, BLOCK_S, NOISE_DPH = 20261123, 10.0, 3e-3
HIDDEN = ((-20.0, 1.5, 6e-3), (15.0, 2.0, -4e-3), (40.0, 2.5, 4e-3))  # C, C, deg/h


def smooth(t: np.ndarray, r: np.ndarray) -> np.ndarray:
    return np.asarray(0.01 + 1e-4 * t + 2e-3 * np.tanh((t - 10.0) / 30.0) + 2e-4 * r * (1.0 + t / 100.0))


def samples(rng: np.random.Generator, *, bumps: bool) -> TrainingData:
    """Four runs of eight hours between −40 and 60 C at 1, 2, 3 and 5 C/min, with a hold at the end of each."""
    parts = []
    for run, speed in enumerate((1.0, 2.0, 3.0, 5.0)):
        time = np.arange(0.0, 8 * 3600.0, BLOCK_S)
        phase = np.minimum(speed * time / 60.0, 600.0) % 200.0
        t = -40.0 + np.where(phase < 100.0, phase, 200.0 - phase)
        r = np.gradient(t, time) * 60.0
        y = smooth(t, r) + NOISE_DPH * rng.standard_normal(t.size)
        if bumps:
            y = y + sum(h * np.exp(-(((t - c) / w) ** 2)) for c, w, h in HIDDEN)
        one = np.ones(t.size)
        parts.append(TrainingData(t, r, y, one, np.full(t.size, run), time, BLOCK_S * one))
    names = TrainingData.__slots__
    return cleaned(TrainingData(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names}))


def test_bumps_have_their_place_and_width_and_mend_what_a_smooth_map_cannot() -> None:
    print("seed", SEED)
    data = samples(np.random.default_rng(SEED), bumps=True)
    found = find_bumps(data, scaling_of(data))
    assert len(found.centers_c) == len(HIDDEN), found
    order = np.argsort(found.centers_c)
    for k, (center, width, height) in zip(order, HIDDEN, strict=True):
        assert abs(found.centers_c[k] - center) < 0.3, found
        assert abs(found.widths_c[k] / width - 1.0) < 0.3, found
        assert abs(found.heights_dph[k] / height - 1.0) < 0.3, found
    t, r = data.temperature_c, data.slope_c_per_min
    truth = smooth(t, r) + sum(h * np.exp(-(((t - c) / w) ** 2)) for c, w, h in HIDDEN)
    plain = fit(data)
    finer = fit(replace(data, bias_dph=data.bias_dph - found(t)))
    before = np.sqrt(np.mean((predict(plain, t, r) - truth) ** 2))
    after = np.sqrt(np.mean((predict(finer, t, r) + found(t) - truth) ** 2))
    print(f"error of the map {before:.2e} -> {after:.2e} deg/h")
    assert after < 0.5 * before
    whole = replace(finer, outcome=replace(finer.outcome, networks=[_beside(found, finer)]))
    assert np.allclose(predict(whole, t, r), predict(finer, t, r) + found(t), atol=1e-9), (
        "one network holds both"
    )


def _beside(found: Bumps, finer) -> dict:  # type: ignore[no-untyped-def]
    return found.beside(finer.networks[0], finer.scaling.half_range_c)


@pytest.mark.slow
def test_a_smooth_map_gets_no_bumps() -> None:
    rng = np.random.default_rng(SEED + 1)
    counts = [
        len(find_bumps(data, scaling_of(data)).centers_c)
        for data in (samples(rng, bumps=False) for _ in range(6))
    ]
    assert sum(counts) <= 1, counts
