"""What a build says of its residual: white noise passes, slow structure, spikes and outliers are told apart from it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from conftest import HOST, run_here
from gyrotc.assess import residual_test
from gyrotc.cli.results import summary_lines
from gyrotc.pages import write_report
from gyrotc.recordings import load
from gyrotc.results import RMS_OVER_FLOOR, ResidualTest
from gyrotc.train import FitOptions, robust_sigma
from jobs import built_for_fleet
from numpy.typing import NDArray
from recordings import columns, toml, write_csv

Floats = NDArray[np.float64]
SEED = 7
LENGTHS = (200, 150, 250)


def judged(series: list[Floats], floor: float = 1.0) -> ResidualTest:
    rms = float(np.sqrt(np.mean(np.concatenate(series) ** 2)))
    found = residual_test(series, rms, floor, [])
    assert found is not None
    return found


def test_white_noise_passes() -> None:
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    drawn = [judged([rng.normal(size=n) for n in LENGTHS]) for _ in range(200)]
    assert sum(bool(one.reasons) for one in drawn) <= 1, "two figures at four sigma: one clean build in thousands"


@pytest.mark.parametrize(
    ("lengths", "trained"), [(LENGTHS, LENGTHS), (LENGTHS, None), ((60,), (300, 40)), ((8, 9), (30, 30)), ((100,), ())]
)
def test_white_noise_stays_within_its_band_of_rms_over_floor(
    lengths: tuple[int, ...], trained: tuple[int, ...] | None
) -> None:
    """The band is of draws of its own; these are others, with the floor as training estimates it."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    beyond = 0
    for _ in range(300):
        runs = [rng.normal(size=n) for n in lengths]
        floor = 1.0
        others = runs if trained is None else [rng.normal(size=n) for n in trained]
        if others:
            differences = [np.diff(x) for x in others]
            floor = robust_sigma(np.concatenate(differences)) / float(np.sqrt(2.0))
        rms = float(np.sqrt(np.mean(np.concatenate(runs) ** 2)))
        found = residual_test(runs, rms, floor, trained)
        assert found is not None
        low, high = found.rms_over_floor_band
        assert high <= RMS_OVER_FLOOR
        if high < RMS_OVER_FLOOR:
            beyond += not low <= found.rms_over_floor <= high
    assert beyond <= 1


@pytest.mark.parametrize("likeness", [0.0, 0.3, 0.6, 0.9])
@pytest.mark.parametrize("lengths", [(6,), (12, 9), (40,), LENGTHS])
def test_an_rms_above_its_limit_is_never_silent(lengths: tuple[int, ...], likeness: float) -> None:
    """Whatever the number of means, and however alike neighbours are."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    above = 0
    for _ in range(60):
        runs = [rng.normal(size=n) for n in lengths]
        for run in runs:
            for k in range(1, run.size):
                run[k] += likeness * run[k - 1]
        found = judged(runs, floor=float(rng.uniform(0.4, 1.1)))
        if found.rms_over_floor > RMS_OVER_FLOOR:
            above += 1
            assert found.reasons
    assert above > 10


@pytest.mark.parametrize(("name", "size"), [("slow", 0.4), ("slow", 1.0), ("offset", 0.4), ("steep", 0.5)])
def test_structure_below_the_noise_is_seen(name: str, size: float) -> None:
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    shape = {
        "slow": lambda u, k: np.sqrt(2.0) * np.sin(2.0 * np.pi * 2.0 * u + k),
        "offset": lambda u, k: np.full(u.size, (1.0, -1.0, 1.0)[k]),  # of each power-on its own
        "steep": lambda u, k: np.sqrt(3.0) * (2.0 * u - 1.0),
    }[name]
    series = [rng.normal(size=n) + size * shape(np.linspace(0.0, 1.0, n), k) for k, n in enumerate(LENGTHS)]
    assert judged(series).reasons


def test_short_runs_have_no_autocorrelation_and_no_runs_no_test() -> None:
    short = residual_test([np.zeros(12)], 1.0, 1.0, [12])
    assert short and short.autocorrelation is None and short.autocorrelation_limit is None
    assert not short.reasons
    assert residual_test([np.zeros(12)], 1.4, 1.0, [1]) is not None, "runs of an exam alone: the floor is known"
    assert residual_test([np.ones(100)], 1.0, None, [100]) is None
    assert residual_test([], None, 1.0, []) is None


def recorded(folder: Path, spikes: int = 0) -> Path:
    """Four runs without an exam; the last has spikes."""
    rng = np.random.default_rng(SEED)
    text = 'schema = 1\nserial = "G1"\nearth_rate = "removed"\n'
    for k in range(4):
        time = np.arange(0.0, 7200.0, 5.0)
        t = 10.0 + 20.0 * np.sin(2.0 * np.pi * (time / 7200.0 + 0.2 * k))
        rate = 0.01 + 2e-4 * t + 2e-3 * rng.normal(size=time.size)
        if k == 3 and spikes:
            rate[rng.choice(time.size, spikes, replace=False)] += 5.0
        write_csv(folder / f"{k}.csv", {"time_s": time, "temperature_c": t, "rate_dph": rate})
        text += f'[[run]]\nfile = "{k}.csv"\n'
    (folder / "dataset.toml").write_text(text + "[fit]\nblock_s = 50.0\n")
    return folder


def test_runs_without_an_exam_are_judged_by_each_left_out_and_without_their_spikes(tmp_path: Path) -> None:
    text = run_here("build", recorded(tmp_path / "d", 12), *HOST, "--out", tmp_path / "r")
    result = json.loads((tmp_path / "r" / "evaluate.json").read_text())
    left_out = result["left_out"]
    assert result["exam"] is None and left_out["samples"] > 200
    assert left_out["after"]["rms_dph"] < 1e-3, "training has left the spikes out"
    usual = result["usable"]["rms_dph"]
    assert usual < 1e-3 < result["train"]["after"]["rms_dph"]
    assert "without 12 rows" in text
    stated = re.search(r"improvement ([\d.]+).* against a constant on spans left out", text)
    assert stated and float(stated[1]) == pytest.approx(left_out["improvement"], rel=0.05)
    page = (tmp_path / "r" / "report.html").read_text()
    assert "left out" in page and "beside white noise of the same runs" in page
    assert "gyrotc diagnose" not in text, "nothing but noise and spikes is left"


def test_spikes_of_an_exam_are_in_the_plain_figure_and_not_in_the_robust_one(tmp_path: Path) -> None:
    spikes = [100, 333, 501]
    for name, seed in (("a.csv", 1), ("b.csv", 2), ("c.csv", 3)):
        rows = columns(720, seed=seed)
        rate = rows["rate_dph"] - 20.0
        if name == "c.csv":
            rate[spikes] += 500.0 * np.std(np.diff(rate))
        write_csv(tmp_path / "RLG-1" / name, rows | {"rate_dph": rate})
    head = 'schema = 1\nserial = "RLG-1"\nearth_rate = "none"'
    runs = ['file = "a.csv"', 'file = "b.csv"', 'file = "c.csv"\nrole = "exam"']
    (tmp_path / "RLG-1" / "dataset.toml").write_text(toml(*runs, head=head))
    built = built_for_fleet(tmp_path / "out", load(tmp_path / "RLG-1"), FitOptions(), numerics=["f32"])
    clean, exam = built.evaluation.runs[0], built.evaluation.runs[2]
    assert exam.rows.left_out == {"rate outlier": len(spikes)} and clean.rows.left_out == {} and clean.usable is None
    assert exam.usable is not None and built.evaluation.usable == exam.usable
    plain, robust, other = exam.after.rms_dph, exam.usable.rms_dph, clean.after.rms_dph
    assert plain and robust and other and plain > 5.0 * robust and robust < 2.0 * other
    assert "without 3 rows" in " ".join(summary_lines(built.evaluation))
    assert "(without 3 rows)" in write_report(tmp_path / "out").read_text("utf-8")
