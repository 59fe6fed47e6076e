"""A diagnosis through the installed command: named, extended, emitted, verified, shown on a page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from campaigns import GRADIENT, simulated
from conftest import HOST, Command
from gyrotc.simulate.scenario import read


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory, gyrotc: Command) -> Path:
    """A folder with `data` (a gyro with a thermal gradient) and `result` (what build --extend made of it)."""
    folder = tmp_path_factory.mktemp("extended")
    data = simulated(folder, GRADIENT)
    done = gyrotc("build", data, "--out", folder / "result", "--extend", *HOST)
    assert done.returncode == 0, done.stderr
    (folder / "stdout").write_text(done.stdout)
    return folder


def read_json(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text("utf-8")))


def test_the_cause_is_named_with_its_size(built: Path) -> None:
    result = read_json(built / "result" / "diagnosis" / "diagnose.json")
    assert result["verdict"] in ("explained", "ambiguous"), result["text"]
    (cause,) = [c for c in result["causes"] if c["family"] != "noise"]
    assert cause["id"] == "thermal_gradient"
    assert cause["parameters"]["tau_s"]["low"] < 900.0 < cause["parameters"]["tau_s"]["high"]
    amplitude = cause["parameters"]["amplitude_dph_per_c"]
    assert amplitude["low"] < 3e-4 < amplitude["high"]


def test_the_extended_model_is_emitted_and_verified(built: Path) -> None:
    folder = built / "result"
    assert [t["id"] for t in read_json(folder / "model.json")["terms"]] == ["thermal_gradient"]
    assert "gtc_f32_term_memory" in (folder / "c" / "gtc_sim_0004.c").read_text()
    verification = read_json(folder / "verify.json")
    assert verification["failed"] == 0 and verification["passed"] > 0
    assert read_json(folder / "evaluate.json")["mismatches"] == 0


def test_the_compiled_code_gains_what_the_diagnosis_promises(built: Path) -> None:
    promised = read_json(built / "result" / "diagnosis" / "diagnose.json")["extended"]
    found = read_json(built / "result" / "evaluate.json")["exam"]["after"]["rms_dph"]
    assert found == pytest.approx(promised["exam_rms_dph"], rel=0.01)
    gain = promised["gain"]
    assert gain["exam_rms_after_dph"] < 0.8 * gain["exam_rms_before_dph"]
    assert 0.0 < gain["rms_removed_dph"]["low"] <= gain["rms_removed_dph"]["value"]
    assert gain["angle_1h_removed_arcsec"]["low"] > 0.0
    assert promised["rate_left_out"]["environment"] in ("loops", "slow", "steps")
    assert promised["forward_in_time"] is not None, "the exam runs are later than all training runs"


def test_build_tells_what_was_added(built: Path) -> None:
    text = (built / "stdout").read_text()
    assert "added: thermal_gradient" in text and "RMS on runs not fitted to" in text
    page = (built / "result" / "report.html").read_text("utf-8")
    assert "What was added, and what it gains" in page and 'href="diagnosis/report.html"' in page


def test_the_page_shows_verdict_pictures_and_limits(built: Path) -> None:
    folder = built / "result" / "diagnosis"
    page = (folder / "report.html").read_text("utf-8")
    for text in (
        "What the simulation gets wrong",
        "What could still hide",
        "What else was considered",
        "next",
    ):
        assert text in page
    names = {p.stem for p in (folder / "pictures").glob("*.svg")}
    assert {"residual", "statistics", "inputs", "considered", "likelihood-1", "before-and-after"} <= names
    assert page.count("<svg") == len(names)


def test_report_draws_the_same_page_again_from_the_two_results_alone(
    built: Path, tmp_path: Path, gyrotc: Command
) -> None:
    folder = built / "result" / "diagnosis"
    for name in ("diagnose.json", "series.json"):
        shutil.copy(folder / name, tmp_path)
    assert gyrotc("report", tmp_path).returncode == 0
    assert (tmp_path / "report.html").read_bytes() == (folder / "report.html").read_bytes()


def test_the_extended_scenario_simulates_what_was_found(built: Path) -> None:
    _, plan = read(built / "result" / "diagnosis" / "scenario-extended.toml")
    assert [c.id for c in plan.cause] == ["thermal_gradient"]
    assert plan.cause[0].values()["tau_s"] == pytest.approx(900.0, rel=0.5)


def test_the_extended_simulation_does_what_the_plain_one_does_not(built: Path) -> None:
    found = read_json(built / "result" / "diagnosis" / "diagnose.json")["discrepancies"]
    rare = [d for d in found if d["p_value"] < 0.01]
    assert rare, "the plain simulation misses the gradient"
    assert all(d["extended"]["p_value"] > 0.01 for d in rare), "the extended one does not"


@pytest.mark.slow
def test_the_truth_is_not_looked_at(built: Path, tmp_path: Path, gyrotc: Command) -> None:
    """Without truth.json and truth/ the same result, but for the names of the files."""
    blind = tmp_path / "blind"
    shutil.copytree(built / "data", blind, ignore=shutil.ignore_patterns("truth*"))
    done = gyrotc("diagnose", blind, "--json", tmp_path / "result.json")
    assert done.returncode == 0, done.stderr
    result, seen = (
        read_json(p) for p in (tmp_path / "result.json", built / "result" / "diagnosis" / "diagnose.json")
    )
    for key in ("pictures", "series", "scenario"):
        seen.pop(key)
    assert result["extended"].pop("model") is None, "without --out nothing is written"
    assert seen["extended"].pop("model") == "model-extended.json"
    assert result == seen


def test_nothing_is_found_in_a_plain_gyro(tmp_path: Path, gyrotc: Command) -> None:
    done = gyrotc("diagnose", simulated(tmp_path, seed=5), "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    result = read_json(tmp_path / "out" / "diagnose.json")
    assert (result["verdict"], result["causes"], result["extended"]) == ("consistent", [], None)
    limits = {c["id"]: c["detection_limit"] for c in result["considered"] if c["detection_limit"]}
    assert {"thermal_gradient", "hysteresis", "warm_up", "cavity_lag"} <= set(limits)
    assert "consistent" in done.stdout and "what could still hide" in done.stdout
    assert not (tmp_path / "out" / "model-extended.json").exists()


def test_a_constant_temperature_is_not_testable(tmp_path: Path, gyrotc: Command) -> None:
    data = tmp_path / "RLG-1"
    data.mkdir()
    for number in range(3):
        rows = [f"{10 * k},{25 + 0.01 * (k % 3)},{7e-3 + 1e-4 * ((7 * k) % 5)}" for k in range(400)]
        (data / f"{number}.csv").write_text("time_s,temperature_c,rate_dph\n" + "\n".join(rows) + "\n")
    done = gyrotc("diagnose", data, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "not testable" in done.stdout and "nothing can be learnt about temperature" in done.stdout
    assert read_json(tmp_path / "out" / "diagnose.json")["verdict"] == "not_testable"
    assert "Not testable" in (tmp_path / "out" / "report.html").read_text("utf-8")


def test_a_build_is_not_overwritten(built: Path, gyrotc: Command) -> None:
    done = gyrotc("diagnose", built / "data", "--out", built / "result")
    assert done.returncode == 2
    assert "holds the result of gyrotc build" in done.stderr


def test_a_broken_result_is_told(tmp_path: Path, gyrotc: Command) -> None:
    (tmp_path / "diagnose.json").write_text('{"schema": "gyrotc.diagnose/1"}')
    done = gyrotc("report", tmp_path)
    assert done.returncode == 2 and "diagnose.json" in done.stderr
