"""Measured recordings: every axis, built from end to end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from conftest import HOST, MEASURED, Command

SETS = ("mpu6000-chamber-cycle", "mpu6050-isothermal")


def built(name: str, out: Path, gyrotc: Command) -> dict[str, dict[str, Any]]:
    """Evaluation and model of every axis."""
    done = gyrotc("build", MEASURED / name, "--axis", "all", "--out", out, *HOST)
    assert done.returncode == 0, done.stderr
    return {
        axis: {
            part: json.loads((out / axis / f"{part}.json").read_text()) for part in ("evaluate", "model", "training")
        }
        for axis in "xyz"
    }


def found(result: dict[str, Any]) -> set[str]:
    return {finding["id"] for finding in result["evaluate"]["findings"]}


@pytest.mark.measured("mpu6000-chamber-cycle")
def test_one_chamber_cycle_gives_no_correction_that_is_not_shown_to_hold(tmp_path: Path, gyrotc: Command) -> None:
    """Whatever is emitted is, on branches left out, no worse than a constant; and it is said."""
    for result in built("mpu6000-chamber-cycle", tmp_path / "out", gyrotc).values():
        assert ("does_not_generalise" in found(result)) == (result["model"]["method"] == "constant")
        assert "temperature_outliers" in found(result), "the start-up row"
        assert result["evaluate"]["mismatches"] == 0
        candidates = {row["id"]: row for row in result["training"]["candidates"]}
        [chosen] = (row for row in candidates.values() if row["chosen"])
        assert chosen["id"] == result["model"]["method"]
        assert chosen["left_out_rms_dph"] <= candidates["constant"]["left_out_rms_dph"]
        assert result["evaluate"]["generalises"] == (chosen["id"] != "constant")
        assert [span["kind"] for span in result["training"]["spans"]] == ["branch"] * 3


@pytest.mark.measured("mpu6050-isothermal")
def test_nothing_can_be_learnt_from_a_constant_temperature(tmp_path: Path, gyrotc: Command) -> None:
    """What the bias does at this temperature may be more than noise; that is all that is found besides."""
    for result in built("mpu6050-isothermal", tmp_path / "out", gyrotc).values():
        assert found(result) - {"residual_above_noise"} == {"no_temperature_information"}
        assert "nothing can be learnt about temperature" in result["evaluate"]["findings"][0]["text"]
        network = result["model"]["networks"][0]
        assert (network["centers"], network["linear"]) == ([], [0.0, 0.0])
        mean = result["evaluate"]["train"]["before"]["mean_dph"]
        assert network["w0"] == pytest.approx(mean, abs=10.0)


@pytest.mark.measured("mpu6000-chamber-cycle")
def test_findings_follow_the_rates_and_not_the_folder(tmp_path: Path, gyrotc: Command) -> None:
    """A thousandth of every rate in a folder of another name: the same findings, and now a mean like Earth's rate."""
    name = SETS[0]
    rows = (MEASURED / name / "data.csv").read_text().splitlines()
    results = []
    for folder, scale in ((tmp_path / name, 1.0), (tmp_path / SETS[1], 1e-3)):
        scaled = [",".join([*line.split(",")[:2], f"{float(line.split(',')[2]) * scale!r}"]) for line in rows[1:]]
        folder.mkdir()
        (folder / "data.csv").write_text("\n".join(["time_s,temperature_c,rate_dph", *scaled]) + "\n")
        assert gyrotc("build", folder, "--out", tmp_path / f"out{scale}", *HOST).returncode == 0
        results.append(found({"evaluate": json.loads((tmp_path / f"out{scale}" / "evaluate.json").read_text())}))
    assert "temperature_outliers" in results[0] and results[1] == results[0] | {"earth_rate_not_stated"}


def test_simulated_data_under_a_real_name_have_no_findings(tmp_path: Path, gyrotc: Command) -> None:
    folder = tmp_path / SETS[1]
    assert gyrotc("simulate", "paper", "--seed", 5, "--out", folder).returncode == 0
    assert gyrotc("build", folder, "--out", tmp_path / "out", *HOST).returncode == 0
    assert found({"evaluate": json.loads((tmp_path / "out" / "evaluate.json").read_text())}) == set()
