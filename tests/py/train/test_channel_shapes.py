"""What a channel adds along a bent line, or with a slope that goes with the temperature: from recordings to code."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from campaigns import up_and_down
from conftest import run_gyrotc
from gyrotc.model import Model, load_model
from gyrotc.recordings.load import load
from gyrotc.simulate.campaign import simulate
from gyrotc.train.fitting import FitOptions, fit_dataset
from libc_build import ROOT

sys.path.insert(0, str(ROOT))
from bench.signals import rms_of, without

BENT = """
[[channel]]
name = "supply_v"
level = 28.0
wander_sigma = 0.1
wander_tau_s = 600.0
noise = 0.002
[[channel]]
name = "magnetic_ut"
level = 40.0
wander_sigma = 1.0
wander_tau_s = 600.0
noise = 0.01
[[cause]]
id = "auxiliary_curve"
channel = "supply_v"
reference = 27.9
second_center = 28.15
width = 0.12
slope_dph_per_unit = 0.005
first_dph = -4e-3
second_dph = 2e-3
[[cause]]
id = "auxiliary_product"
channel = "magnetic_ut"
reference = 40.0
reference_c = 20.0
slope_dph_per_unit = 1.2e-3
slope_dph_per_unit_per_c = 1.2e-4
"""


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shapes")
    (folder / "bent.toml").write_text(up_and_down("separating", 6) + BENT, "utf-8")
    simulate(folder / "bent.toml", seed=3, out=folder / "data")
    return folder / "data"


@pytest.fixture(scope="module")
def built(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The steps of a build, as a user types them; one compiler, for time."""
    out = tmp_path_factory.mktemp("built")
    steps: list[list[str | Path]] = [
        ["fit", recordings, "--channels", "--out", out],
        ["emit", out / "model.json", "--out", out],
        ["verify", out, "--target", "host-gcc-O2"],
        ["evaluate", out, recordings],
        ["report", out],
    ]
    for step in steps:
        done = run_gyrotc(*step)
        assert done.returncode == 0, done.stdout + done.stderr
        if step[0] == "fit":
            (out / "fit.txt").write_text(done.stdout, "utf-8")
    return out


@pytest.fixture(scope="module")
def model(built: Path) -> Model:
    return load_model(built / "model.json")


@pytest.mark.slow
def test_a_bent_channel_and_one_that_goes_with_temperature_stand_in_the_table_as_such(
    built: Path, model: Model
) -> None:
    assert {t.channel: t.id for t in model.terms} == {
        "supply_v": "auxiliary_curve",
        "magnetic_ut": "auxiliary_product",
    }
    assert all(t.stand_in is not None for t in model.terms)
    training = json.loads((built / "training.json").read_text("utf-8"))
    shapes = {row["name"]: row["shape"] for row in training["channels"]}
    assert shapes == {"supply_v": "curve", "magnetic_ut": "product"}
    (product,) = (t.parameters for t in model.terms if t.id == "auxiliary_product")
    assert product["slope_dph_per_unit_per_c"] == pytest.approx(1.2e-4, rel=0.2)
    told = (built / "fit.txt").read_text("utf-8")
    assert "along a bent line" in told
    assert "slope that depends on temperature" in told
    page = (built / "report.html").read_text("utf-8")
    assert "taken: a bent line, two Gaussians beside a straight one" in page


@pytest.mark.slow
def test_the_code_gives_what_was_trained_bit_for_bit(built: Path) -> None:
    verified = json.loads((built / "verify.json").read_text("utf-8"))
    assert {(t["numeric"], t["status"], t["mismatches"]) for t in verified["targets"]} == {
        ("f32", "pass", 0),
        ("q31", "pass", 0),
    }
    evaluated = json.loads((built / "evaluate.json").read_text("utf-8"))
    assert evaluated["mismatches"] == 0
    after = evaluated["exam"]["after"]["rms_dph"]
    assert after < 1.3 * evaluated["noise_floor_dph"]


def test_the_correction_is_better_than_that_of_straight_lines_and_one_thermometer(
    recordings: Path, model: Model, tmp_path: Path
) -> None:
    """And with channels lost in the exam no worse than one thermometer by 2 %: each alone, and both at once."""
    dataset = load(recordings)
    exam = [run.rows() for run in dataset.runs if run.role == "exam"]
    plain = rms_of(fit_dataset(dataset, FitOptions()).model, exam, tmp_path)
    assert rms_of(model, exam, tmp_path) < 0.3 * plain
    rows = exam
    for name in ("supply_v", "magnetic_ut"):
        assert rms_of(model, [without(r, name) for r in exam], tmp_path) <= 1.02 * plain
        rows = [without(r, name) for r in rows]
    assert rms_of(model, rows, tmp_path) <= 1.02 * plain
