"""A recording in which the gyro was switched on anew holds two power-ons, for every job that learns from it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from conftest import Command
from gyrotc.diagnose import diagnose, series_of
from gyrotc.jobs import compare
from gyrotc.model import load_model
from gyrotc.quality import found_events, judge
from gyrotc.recordings import load
from gyrotc.train import FitOptions, fit_dataset
from recordings import toml, write_csv

SEED, ROW_S, HOURS = 20261128, 10.0, 8
STOP_S, BACK_S = 10_000.0, 10_400.0
STEP_DPH, NOISE_DPH = 0.012, 2.2e-3


def recorded(folder: Path, files: int, garbage: int = 0) -> Path:
    """Ramps of eight hours; the first file has no rows for seven minutes and goes on at another level.

    So many rows on either side of the gap are `garbage`.
    """
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    time = np.arange(0.0, 3600.0 * HOURS, ROW_S)
    for k in range(files):
        temperature = np.interp(time / 3600.0, [0, 1, 2, 4, 6, 8], [0, 0, 60, 60, -30, -30]) + 0.01 * np.sin(time / 300)
        rate = 0.01 + 2e-4 * temperature + 1e-6 * temperature**2 + NOISE_DPH * rng.standard_normal(time.size)
        kept = (time < STOP_S) | (time > BACK_S) if k == 0 else np.ones(time.size, dtype=bool)
        rate += STEP_DPH * (time > STOP_S) * (k == 0)
        near = (time > STOP_S - ROW_S * garbage) & (time <= BACK_S + ROW_S * garbage)
        rate += 5.0 * near * rng.standard_normal(time.size) * (k == 0 and garbage > 0)
        columns = {"time_s": time, "temperature_c": temperature, "rate_dph": rate}
        write_csv(folder / f"{k}.csv", {name: values[kept] for name, values in columns.items()})
    (folder / "dataset.toml").write_text(toml(*(f'file = "{k}.csv"' for k in range(files))), "utf-8")
    return folder


def test_each_side_of_a_restart_is_a_run_that_is_not_cut_again(tmp_path: Path) -> None:
    dataset = load(recorded(tmp_path, 3))
    judged = judge(dataset)
    runs = judged.cut(dataset.runs)
    assert len(runs) == 4
    assert [judged.cut([run]) for run in runs] == [(run,) for run in runs]


@pytest.mark.parametrize("files", [1, 3])
def test_both_sides_of_a_restart_are_left_out_one_by_one(tmp_path: Path, files: int) -> None:
    training = fit_dataset(load(recorded(tmp_path, files)), FitOptions()).training
    found = [(span.file, span.from_s, span.to_s, span.kind) for span in training.spans]
    assert len(found) == files + 1
    (first, *before), (second, *after) = found[:2]
    assert first == second == "0.csv" and all(kind == "run" for *_, kind in found)
    assert before[1] <= BACK_S < after[0]


def test_a_recording_with_a_restart_is_built(tmp_path: Path, gyrotc: Command) -> None:
    """The repeatability is that of four power-ons in three files."""
    done = gyrotc("build", recorded(tmp_path / "data", 3), "--out", tmp_path / "result")
    assert done.returncode == 0, done.stderr
    known = load_model(tmp_path / "result" / "model.json").uncertainty_dph
    assert known is not None and known.rules is not None
    assert known.rules.turn_on_freedom == 3


def test_methods_are_compared_on_the_same_pieces_as_the_model_was_chosen_by(tmp_path: Path) -> None:
    """One file with a restart is two runs; each environment is one that was left out whole."""
    result = compare(load(recorded(tmp_path, 1)), methods=("constant",))
    training = fit_dataset(load(tmp_path), FitOptions(method="constant")).training
    assert [group.environment for method in result.methods for group in method.groups] == ["0.csv"]
    assert len(training.spans) == 2


def test_diagnosis_takes_both_sides_of_a_restart_as_runs(tmp_path: Path) -> None:
    found = diagnose(load(recorded(tmp_path, 3)))
    series = series_of(found)
    assert series is not None
    assert [run.name for run in series.runs] == ["0.csv", f"0.csv@{BACK_S + ROW_S:g}", "1.csv", "2.csv"]


def test_the_name_of_a_file_may_hold_the_sign_before_the_start_of_a_run(tmp_path: Path) -> None:
    folder = recorded(tmp_path, 3)
    text = (folder / "dataset.toml").read_text("utf-8")
    (folder / "0.csv").rename(folder / "0@1.csv")
    (folder / "dataset.toml").write_text(text.replace('"0.csv"', '"0@1.csv"'), "utf-8")
    series = series_of(diagnose(load(folder)))
    assert series is not None
    assert [run.file for run in series.runs] == ["0@1.csv", "0@1.csv", "1.csv", "2.csv"]


@pytest.mark.parametrize("garbage", [0, 3])
def test_a_restart_is_one_event_whatever_the_rows_beside_the_gap_are(tmp_path: Path, garbage: int) -> None:
    """Rows beside the gap that are left out leave neither a step nor a gap besides the restart."""
    found = [event.id for event in found_events(load(recorded(tmp_path, 3, garbage)))]
    assert [id for id in found if id != "rate_outliers"] == ["restart"]


def test_another_gap_of_a_file_with_a_restart_is_named(tmp_path: Path) -> None:
    """After the second one the gyro goes on at the level that it had."""
    rows = pd.read_csv(recorded(tmp_path, 3) / "0.csv")
    rows[(rows["time_s"] < 20_000.0) | (rows["time_s"] > 20_400.0)].to_csv(tmp_path / "0.csv", index=False)
    found = [(event.id, event.time_s.value) for event in found_events(load(tmp_path)) if event.time_s is not None]
    assert [id for id, _ in found] == ["restart", "dropout"]
    assert [at for _, at in found] == pytest.approx([STOP_S, 20_000.0], abs=500.0)
