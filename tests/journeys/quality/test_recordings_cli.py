"""Every accepted recording through the installed command; a change of a run beside memories."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import HOST, Command
from gyrotc.mirror import first_order, play
from gyrotc.quality import evidence_beside_memories
from numpy.typing import NDArray
from recordings import ACCEPTED, ROWS, columns, described, write_csv


@pytest.mark.parametrize("case", ACCEPTED)
def test_check_accepts(case: str, tmp_path: Path, gyrotc: Command) -> None:
    folder = tmp_path / "RLG-1"
    ACCEPTED[case](folder)
    done = gyrotc("check", folder, "--json", tmp_path / "check.json")
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads((tmp_path / "check.json").read_text())
    assert result["schema"] == "gyrotc.check/1"
    assert result["problems"] == []
    assert len(result["runs"]) >= 1


def test_a_refused_build_leaves_an_older_result_alone(tmp_path: Path, gyrotc: Command) -> None:
    described(tmp_path / "RLG-1")
    small = columns() | {"rate_dph": columns()["rate_dph"] - 20.0}
    write_csv(tmp_path / "RLG-1" / "run-01.csv", small)
    assert gyrotc("build", tmp_path / "RLG-1", "--out", tmp_path / "out", *HOST).returncode == 0
    before = {p: p.read_bytes() for p in (tmp_path / "out").rglob("*") if p.is_file()}
    write_csv(tmp_path / "RLG-1" / "run-01.csv", columns(4))
    assert gyrotc("build", tmp_path / "RLG-1", "--out", tmp_path / "out").returncode == 2
    assert {p: p.read_bytes() for p in (tmp_path / "out").rglob("*") if p.is_file()} == before


@pytest.mark.parametrize("case", ["pulses", "several runs", "one constant temperature"])
def test_fit_takes_what_check_accepts(case: str, tmp_path: Path, gyrotc: Command) -> None:
    ACCEPTED[case](tmp_path / "RLG-1")
    done = gyrotc("fit", tmp_path / "RLG-1", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    model = json.loads((tmp_path / "out" / "model.json").read_text())
    assert model["data"]


def quiet_build(folder: Path, out: Path, gyrotc: Command) -> dict[str, Any]:
    """Evaluation of a build that says nothing on stderr."""
    done = gyrotc("build", folder, "--out", out, *HOST)
    assert (done.returncode, done.stderr) == (0, "")
    result: dict[str, Any] = json.loads((out / "evaluate.json").read_text())
    return result


def test_one_temperature_and_one_rate_build_all_the_same(tmp_path: Path, gyrotc: Command) -> None:
    """Nothing varies, not even the noise: a constant model, said in words, and no complaint of a library."""
    same = {"temperature_c": np.full(ROWS, 25.0), "rate_dph": np.full(ROWS, 3.25)}
    write_csv(tmp_path / "RLG-1" / "a.csv", columns() | same)
    result = quiet_build(tmp_path / "RLG-1", tmp_path / "out", gyrotc)
    assert "no_temperature_information" in [f["id"] for f in result["findings"]]
    network = json.loads((tmp_path / "out" / "model.json").read_text())["networks"][0]
    assert (network["w0"], network["linear"], network["centers"]) == (3.25, [0.0, 0.0], [])
    assert result["train"]["after"]["max_abs_dph"] < 1e-6


def test_a_build_can_be_evaluated_again_with_the_same_figures(tmp_path: Path, gyrotc: Command) -> None:
    described(tmp_path / "RLG-1")
    write_csv(tmp_path / "RLG-1" / "run-01.csv", columns(360) | {"rate_dph": columns(360)["rate_dph"] - 20.0})
    first = quiet_build(tmp_path / "RLG-1", tmp_path / "out", gyrotc)
    assert first["left_out"]["after"]["rms_dph"] > 0.0
    assert gyrotc("evaluate", tmp_path / "out", tmp_path / "RLG-1").returncode == 0
    assert json.loads((tmp_path / "out" / "evaluate.json").read_text()) == first


def test_meta_and_warnings_travel_into_the_model(tmp_path: Path, gyrotc: Command) -> None:
    described(tmp_path / "RLG-1", tail='[meta]\noperator = "A. B."\nchamber = "K 3"')
    assert gyrotc("fit", tmp_path / "RLG-1", "--out", tmp_path / "out").returncode == 0
    meta = json.loads((tmp_path / "out" / "model.json").read_text())["meta"]
    assert meta["operator"] == "A. B."
    assert meta["chamber"] == "K 3"


def test_check_takes_every_axis_and_fit_names_them(tmp_path: Path, gyrotc: Command) -> None:
    base = columns()
    table = {name: base[name] for name in ("time_s", "temperature_c")}
    write_csv(tmp_path / "IMU" / "a.csv", table | {f"rate_{a}_dph": base["rate_dph"] for a in "xyz"})
    refused = gyrotc("fit", tmp_path / "IMU", "--out", tmp_path / "out")
    assert refused.returncode == 2 and "--axis x|y|z|all" in refused.stderr
    every = gyrotc("check", tmp_path / "IMU")
    assert every.returncode == 0 and [f", axis {a} " in every.stdout for a in "xyz"] == [True] * 3


def test_the_model_does_not_depend_on_the_form_of_a_recording(tmp_path: Path, gyrotc: Command) -> None:
    """The same numbers give the same model, but for name and hash of the file."""
    models = []
    for case in ("no dataset.toml", "byte order mark, CRLF", "Parquet"):
        folder = tmp_path / case.replace(" ", "-").replace(",", "")
        ACCEPTED[case](folder)
        (folder / "dataset.toml").write_text(
            f'schema = 1\nserial = "A"\n[[run]]\nfile = "{next(folder.glob("a.*")).name}"\n'
        )
        assert gyrotc("fit", folder, "--out", tmp_path / "out").returncode == 0
        model = json.loads((tmp_path / "out" / "model.json").read_text())
        del model["data"], model["checksum"]
        models.append(model)
    assert all(model == models[0] for model in models)
    assert np.isfinite(models[0]["networks"][0]["w0"])


def test_earth_rate_that_is_not_stated_warns_in_model_and_header(tmp_path: Path, gyrotc: Command) -> None:
    table = columns() | {"rate_dph": columns()["rate_dph"] - 20.0}
    write_csv(tmp_path / "RLG-1" / "a.csv", table)
    assert gyrotc("fit", tmp_path / "RLG-1", "--out", tmp_path / "out").returncode == 0
    meta = json.loads((tmp_path / "out" / "model.json").read_text())["meta"]
    assert meta["earth_rate"] == "not stated"
    assert "Earth's rate" in meta["warnings"][0]
    done = gyrotc("emit", tmp_path / "out" / "model.json", "--out", tmp_path / "out", "--numeric", "f32")
    assert done.returncode == 0, done.stderr
    assert "Earth's rate" in next((tmp_path / "out" / "c").glob("gtc_rlg*.h")).read_text()


def test_a_computed_earth_rate_is_said_with_its_uncertainty(tmp_path: Path, gyrotc: Command) -> None:
    ACCEPTED["computed earth rate"](tmp_path / "RLG-1")
    assert gyrotc("fit", tmp_path / "RLG-1", "--out", tmp_path / "out").returncode == 0
    meta = json.loads((tmp_path / "out" / "model.json").read_text())["meta"]
    assert meta["earth_rate"] == "computed and taken off: 0.0000 +- 0.0263 deg/h (1 sigma)"
    assert meta["warnings"] == []


Array = NDArray[np.float64]

TIME_S = 60.0 * np.arange(400)
HALF = TIME_S >= 12000.0


def _temperature() -> Array:
    return np.asarray(25.0 + 30.0 * np.sin(2.0 * np.pi * TIME_S / 9000.0) + 8.0 * np.sin(TIME_S / 700.0))


def _evidence(y: Array, known: Array) -> float:
    """For another factor on the known curve in the second half."""
    side = np.column_stack([np.ones_like(TIME_S), known])
    change = np.hstack([side * ~HALF[:, None], side * HALF[:, None]])
    means = TIME_S, _temperature(), y
    return evidence_beside_memories(means, np.ones(TIME_S.size, dtype=bool), change, known[:, None])


@pytest.mark.parametrize("seed", range(4))
def test_memories_are_no_change_and_a_factor_is_no_memory(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise, t = rng.standard_normal(TIME_S.size), _temperature()
    curve = 0.2 * t + 3.0 * np.tanh((t - 20.0) / 12.0)
    loops = play(float(rng.uniform(2.0, 10.0)), t) - t
    lag = first_order(float(rng.uniform(300.0, 2000.0)), TIME_S, t) - t
    assert _evidence(curve + 0.6 * loops + noise, curve) < 0.0
    assert _evidence(curve + 0.6 * lag + noise, curve) < 0.0
    assert _evidence(curve * np.where(HALF, 1.5, 1.0) + noise, curve) > 10.0


def test_the_step_after_a_check_against_an_earlier_result_keeps_that_result(tmp_path: Path, gyrotc: Command) -> None:
    write_csv(tmp_path / "RLG-1" / "run-01.csv", columns(720))
    assert gyrotc("fit", tmp_path / "RLG-1", "--out", tmp_path / "result").returncode == 0
    alone = gyrotc("check", tmp_path / "RLG-1").stdout.splitlines()[-1]
    assert alone.endswith(f"gyrotc build {tmp_path / 'RLG-1'} --out result")
    after = gyrotc("check", tmp_path / "RLG-1", "--previous", tmp_path / "result").stdout.splitlines()[-1]
    assert after.endswith(f"gyrotc build {tmp_path / 'RLG-1'} --prior {tmp_path / 'result'} --out renewed")
