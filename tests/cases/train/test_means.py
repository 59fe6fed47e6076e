"""Figures are of means over 100 s, whatever the distance of the rows and however uneven the clock is."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import Command
from gyrotc.recordings import load
from gyrotc.train import FitOptions, fit_dataset
from recordings import toml, write_csv

SEED, HOURS, NOISE_DPH = 20261129, 30, 0.01
AVERAGE_S = 100.0


def recorded(folder: Path, row_s: float, jitter_s: float, *roles: str) -> Path:
    """White noise on ramps; `jitter_s`: largest departure of a time stamp from its even place."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    even = np.arange(0.0, 3600.0 * HOURS, row_s)
    for k, _ in enumerate(roles):
        temperature = 20.0 + 30.0 * np.sin(even / 4000.0)
        rate = 0.5 + 1e-3 * temperature + NOISE_DPH * np.sqrt(10.0 / row_s) * rng.standard_normal(even.size)
        time = np.round(even + rng.uniform(-jitter_s, jitter_s, even.size) + jitter_s, 4)
        write_csv(folder / f"{k}.csv", {"time_s": time, "temperature_c": temperature, "rate_dph": rate})
    runs = (f'file = "{k}.csv"\nrole = "{role}"' for k, role in enumerate(roles))
    (folder / "dataset.toml").write_text(toml(*runs), "utf-8")
    return folder


@pytest.mark.parametrize("jitter_s", [0.0, 0.8])
@pytest.mark.parametrize("row_s", [9.999, 10.0, 10.0005, 10.02])
def test_a_mean_holds_all_rows_of_its_hundred_seconds(tmp_path: Path, row_s: float, jitter_s: float) -> None:
    training = fit_dataset(load(recorded(tmp_path, row_s, jitter_s, "train", "train")), FitOptions()).training
    expected = NOISE_DPH / np.sqrt(AVERAGE_S / 10.0)
    assert training.left_out is not None and training.left_out.after.rms_dph is not None
    assert training.left_out.samples == pytest.approx(2 * 3600 * HOURS / AVERAGE_S, rel=0.01)
    assert training.left_out.after.rms_dph == pytest.approx(expected, rel=0.15)
    assert training.noise_floor_dph == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("row_s", [10.0005, 60.0, 70.0])
def test_the_residual_of_white_noise_is_the_floor(tmp_path: Path, gyrotc: Command, row_s: float) -> None:
    """Training and evaluation make means of the same rows, so that nothing lies below the floor."""
    done = gyrotc("build", recorded(tmp_path / "data", row_s, 0.0, "train", "train", "exam"), "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "out" / "evaluate.json").read_text())
    after = found["exam"]["after"]["rms_dph"]
    assert after / found["noise_floor_dph"] == pytest.approx(1.0, abs=0.12)


def test_the_means_of_a_unit_do_not_depend_on_the_correction_that_was_asked_for(tmp_path: Path) -> None:
    """Slow noise, which differences of means do not show, counts whether a line or Gaussians are fitted."""
    rng = np.random.default_rng(SEED)
    time = np.arange(0.0, 3600.0 * HOURS, 10.0)
    for k in range(3):
        walk = 1e-3 * np.cumsum(rng.standard_normal(time.size))
        rate = walk + NOISE_DPH * rng.standard_normal(time.size)
        write_csv(tmp_path / f"{k}.csv", {"time_s": time, "temperature_c": 30.0 * np.sin(time / 4e3), "rate_dph": rate})
    (tmp_path / "dataset.toml").write_text(toml(*(f'file = "{k}.csv"' for k in range(3))), "utf-8")
    dataset = load(tmp_path)
    line, gaussians = (fit_dataset(dataset, FitOptions(method=m)).training.means for m in ("linear", "mrbf"))
    assert line is not None and gaussians is not None
    assert line.sigma_dph == pytest.approx(gaussians.sigma_dph)
    assert line.bias_dph == pytest.approx(gaussians.bias_dph, abs=1e-3 * line.sigma_dph)


def test_a_single_row_of_many_counts_for_a_share_of_a_mean(tmp_path: Path) -> None:
    """A hundred rows a second, whose rates are missing for a minute but for one: no mean that `lot` takes counts 0."""
    rng = np.random.default_rng(SEED)
    time = np.arange(0.0, 600.0, 0.01)
    for k in range(2):
        rate = NOISE_DPH * np.sqrt(1000.0) * rng.standard_normal(time.size)
        rate[(time > 290.0) & (time < 360.0) & (np.arange(time.size) != 32_000)] = np.nan
        write_csv(tmp_path / f"{k}.csv", {"time_s": time, "temperature_c": 0.05 * time + 1.2 * k, "rate_dph": rate})
    (tmp_path / "dataset.toml").write_text(toml(*(f'file = "{k}.csv"' for k in range(2))), "utf-8")
    means = fit_dataset(load(tmp_path), FitOptions(method="linear")).training.means
    assert means is not None
    assert 0.0 < min(means.count) < 1e-3
