"""Runs of any length stand beside one another, in any order, with any rows and any clock."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from drawn import examples
from gyrotc.causes import CATALOGUE, History
from gyrotc.diagnose import diagnose, records_of
from gyrotc.mirror import first_order
from gyrotc.quality import Change, WalkNoise, found_events
from gyrotc.recordings import load
from gyrotc.results import Diagnosed
from gyrotc.train import FitOptions
from hypothesis import given
from hypothesis import strategies as st
from recordings import Columns, changes_in, toml, write_csv

SEED = 20261128
NOISE_DPH, STEP_DPH = 2.2e-3, 0.05
LONG_S = 28_800.0

rows_s = st.sampled_from([1.0, 10.0, 10.0, 60.0, 300.0])
clocks_s = st.sampled_from([0.0, -5e4, 1e5, 1e9])
shorts = st.lists(st.tuples(st.floats(10.0, 7200.0), rows_s, clocks_s), min_size=1, max_size=4)


def recording(rng: np.random.Generator, length_s: float, row_s: float = 10.0, clock_s: float = 0.0) -> Columns:
    """A bias that follows a temperature on ramps, with white noise of one density; ten rows at least."""
    time = np.arange(max(round(length_s / row_s), 10)) * row_s
    temperature = 20.0 + 30.0 * np.sin(2.0 * np.pi * time / 14_400.0)
    rate = 0.01 + 2e-4 * temperature + 1e-6 * temperature**2
    noise = NOISE_DPH * np.sqrt(10.0 / row_s) * rng.standard_normal(time.size)
    return {"time_s": clock_s + time, "temperature_c": temperature, "rate_dph": rate + noise}


def written(folder: Path, *runs: Columns, said: str = 'power_on_s = "unknown"') -> Path:
    for k, columns in enumerate(runs):
        write_csv(folder / f"{k}.csv", columns)
    text = toml(*(f'file = "{k}.csv"\n{said}' for k in range(len(runs))))
    (folder / "dataset.toml").write_text(text, "utf-8")
    return folder


def in_folder(*runs: Columns) -> list[Change]:
    with tempfile.TemporaryDirectory() as folder:
        return changes_in(Path(folder), *runs)


def placed(found: list[Change], order: list[int], clocks: list[float]) -> list[tuple[int, str, float]]:
    """Changes by the number that a run had in the first place, and by the time since its first row."""
    return sorted((order[one.run], one.kind, round(one.time_s[0] - clocks[one.run], 1)) for one in found)


@examples(8)
@given(shorts=shorts, row_s=st.sampled_from([10.0, 60.0]), clock_s=clocks_s, data=st.data())
def test_a_step_of_a_long_run_is_found_beside_any_other_runs(
    shorts: list[tuple[float, float, float]], row_s: float, clock_s: float, data: st.DataObject
) -> None:
    rng = np.random.default_rng(SEED)
    runs = [recording(rng, LONG_S, row_s, clock_s), *(recording(rng, *one) for one in shorts)]
    at = clock_s + 0.4 * LONG_S
    runs[0]["rate_dph"] += STEP_DPH * (runs[0]["time_s"] >= at)
    order = data.draw(st.permutations(range(len(runs))))
    clocks = [float(runs[k]["time_s"][0]) for k in order]
    found = in_folder(*(runs[k] for k in order))
    assert (0, "step") in [(order[one.run], one.kind) for one in found], placed(found, order, clocks)
    (step,) = [one for one in found if order[one.run] == 0]
    assert step.time_s[1] <= at <= step.time_s[2]
    assert step.size[1] <= 1.1 * STEP_DPH and step.size[2] >= 0.9 * STEP_DPH


@examples(4)
@given(shorts=shorts, data=st.data())
def test_order_and_clocks_move_no_change(shorts: list[tuple[float, float, float]], data: st.DataObject) -> None:
    rng = np.random.default_rng(SEED)
    runs = [recording(rng, LONG_S, 20.0), *(recording(rng, length, row) for length, row, _ in shorts)]
    runs[0]["rate_dph"] += STEP_DPH * (runs[0]["time_s"] >= 12_000.0)
    order = data.draw(st.permutations(range(len(runs))))
    clocks = [data.draw(clocks_s) for _ in order]
    moved = [runs[k] | {"time_s": runs[k]["time_s"] + clock} for k, clock in zip(order, clocks, strict=True)]
    as_it_is = placed(in_folder(*runs), list(range(len(runs))), [0.0] * len(runs))
    assert placed(in_folder(*moved), order, clocks) == as_it_is != []


def test_a_filter_leaves_as_much_of_noise_in_cells_of_any_length() -> None:
    """A level that walks under white noise, in cells of 10 s and in their means over a minute."""
    rng = np.random.default_rng(SEED)
    noise = WalkNoise(3e-3, 1e-13, 10.0)
    rate = rng.standard_normal(120_000) + np.cumsum(np.sqrt(noise.level) * rng.standard_normal(120_000))
    means = rate.reshape(-1, 6).mean(axis=1)
    left = [np.std(noise.white(x, cell_s)[200:]) for x, cell_s in ((rate, 10.0), (means, 60.0))]
    assert left[1] == pytest.approx(left[0], rel=0.05)


@pytest.mark.parametrize("place", [0, 2, 4])
@pytest.mark.parametrize("minutes", [3, 30, 45, 60])
def test_a_short_run_stands_anywhere_beside_longer_ones(tmp_path: Path, minutes: int, place: int) -> None:
    rng = np.random.default_rng(SEED)
    runs = [recording(rng, 60.0 * minutes if k == place else LONG_S, 30.0) for k in range(5)]
    assert found_events(load(written(tmp_path, *runs))) == []


def answer(folder: Path) -> tuple[Diagnosed, dict[str, float]]:
    found = diagnose(load(folder)).result
    assert found.noise_floor_dph is not None and found.baseline is not None
    return found, {"floor": found.noise_floor_dph, "rms": found.baseline.exam_rms_dph}


def test_what_has_no_two_blocks_is_said_and_changes_nothing(tmp_path: Path) -> None:
    """Ten rows of a second beside runs of hours, first and in the midst."""
    rng = np.random.default_rng(SEED)
    long, short = [recording(rng, 10_800.0, 60.0) for _ in range(3)], [recording(rng, 10.0, 1.0) for _ in range(2)]
    alone, figures = answer(written(tmp_path / "alone", *long))
    beside, with_short = answer(written(tmp_path / "beside", short[0], *long[:2], short[1], long[2]))
    assert beside.verdict == alone.verdict
    assert with_short == pytest.approx(figures, rel=1e-6)
    assert [line[:5] for line in beside.missing if "no two blocks" in line] == ["0.csv", "3.csv"]


def test_runs_without_two_blocks_decide_nothing(tmp_path: Path) -> None:
    rng = np.random.default_rng(SEED)
    found = diagnose(load(written(tmp_path, *(recording(rng, 10.0, 1.0) for _ in range(2)))))
    assert found.result.verdict == "not_testable"
    assert re.search("No run has two blocks", found.result.text)


def test_runs_that_hold_their_temperature_name_no_memory(tmp_path: Path) -> None:
    """Each at one temperature: the map holds all that a memory of it could be."""
    rng = np.random.default_rng(SEED)
    runs = [recording(rng, 5400.0, 60.0) for _ in range(2)]
    for run, held_c in zip(runs, (10.0, 30.0), strict=True):
        run["temperature_c"] = np.full_like(run["time_s"], held_c)
    found = diagnose(load(written(tmp_path, *runs))).result
    assert found.verdict in ("not_testable", "consistent", "noise_differs")
    assert found.physical == ()


def test_samples_too_few_for_a_mean_when_left_out_are_scored_themselves(tmp_path: Path) -> None:
    """Two minutes of a quick ramp beside eleven rows."""
    rng = np.random.default_rng(SEED)
    runs = [recording(rng, 120.0, 10.0), recording(rng, 110.0, 10.0)]
    for run in runs:
        run["temperature_c"] = 20.0 + 0.05 * run["time_s"]
    found = diagnose(load(written(tmp_path, *runs))).result
    assert found.baseline is None or np.isfinite(found.baseline.exam_rms_dph)


SLOW = (((0.0, 20.0), (2.5, 60.0), (5.5, -20.0), (8.0, 20.0)), ((0.0, -20.0), (2.0, 40.0), (4.5, 60.0), (8.0, 0.0)))

FAST = ((0.0, 20.0), (0.15, 60.0), (0.4, 20.0))


def ramps(rng: np.random.Generator, corners: Sequence[tuple[float, float]], late_s: float, lag_dph: float) -> Columns:
    """Temperatures through (h, C), which are stamped late, and a bias that follows them also with a lag of 900 s."""
    hours, corners_c = zip(*corners, strict=True)
    time = np.arange(0.0, 3600.0 * hours[-1], 10.0)
    temperature = np.interp(time / 3600.0, hours, corners_c)
    seen = np.interp((time + late_s) / 3600.0, hours, corners_c)
    lag = first_order(900.0, time, temperature) - temperature
    rate = 0.01 + 2e-3 * seen + lag_dph * lag + 1e-3 * rng.standard_normal(time.size)
    return {"time_s": time, "temperature_c": temperature, "rate_dph": rate}


def test_a_fastest_environment_without_a_whole_mean_gives_no_gain(tmp_path: Path) -> None:
    rng = np.random.default_rng(SEED)
    folder = written(tmp_path, *(ramps(rng, one, 0.0, 1e-3) for one in (*SLOW, *SLOW, FAST)))
    text = (tmp_path / "dataset.toml").read_text("utf-8")
    (tmp_path / "dataset.toml").write_text(text.replace('"4.csv"', '"4.csv"\nenvironment = "fast"'), "utf-8")
    found = diagnose(load(folder), options=FitOptions(average_s=3600.0))
    assert [cause.id for cause in found.result.physical] == ["thermal_gradient"]
    assert found.extension is not None and found.extension.rate_left_out is None


def test_a_test_run_without_a_whole_mean_beside_the_cause_measures_no_gain(tmp_path: Path) -> None:
    """Temperatures are known 40 s later only: of 320 s too few are left for half of a mean over 600 s."""
    rng = np.random.default_rng(SEED)
    short = ((0.0, 20.0), (0.09, 22.0))
    folder = written(tmp_path, *(ramps(rng, one, 40.0, 0.0) for one in (*SLOW, FAST, short)))
    text = (tmp_path / "dataset.toml").read_text("utf-8")
    (tmp_path / "dataset.toml").write_text(text.replace('"3.csv"', '"3.csv"\nrole = "exam"'), "utf-8")
    found = diagnose(load(folder), options=FitOptions(average_s=600.0)).result
    assert [cause.id for cause in found.physical] == ["time_misalignment"]
    assert found.measured_on == "left out"


@pytest.mark.parametrize(("clock_s", "since_s"), [(0.0, 0.0), (600.0, 600.0), (1e5, 0.0), (1e9, 0.0), (-1e5, 0.0)])
def test_a_clock_that_starts_elsewhere_does_not_count_from_power_on(
    tmp_path: Path, clock_s: float, since_s: float
) -> None:
    """Power-on that is not stated is where the clock starts, or the first row where that cannot be."""
    run = recording(np.random.default_rng(SEED), 3600.0, 60.0, clock_s)
    (record,) = records_of(load(written(tmp_path, run, said="")), "train", block_s=10.0, average_s=100.0).runs
    assert record.history.on_s is not None
    assert record.history.on_s[0] == since_s


def test_a_warm_up_that_is_over_has_no_amplitude() -> None:
    """It would be fitted at power-on with 10 to the power of 16 deg/h."""
    features = CATALOGUE["warm_up"].features
    assert features is not None
    time = np.arange(0.0, 7200.0, 60.0)
    shown = [
        float(features(History(time, np.zeros_like(time), on_s=time + before), {"tau_s": 2000.0}).max())
        for before in (0.0, 2000.0, 1e5)
    ]
    assert shown == pytest.approx([1.0, np.exp(-1.0), 0.0])
