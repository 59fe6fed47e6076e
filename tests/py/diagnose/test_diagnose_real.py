"""Measured recordings diagnosed with their end left out; skipped, and told, where they are absent."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT, Command

pytestmark = pytest.mark.slow

REAL = Path(os.environ.get("GYROTC_REAL_DATA", ROOT / ".." / "shared" / "data" / "real"))
STATIC_MAP_DPH = 1311.0  # a map of (T, dT/dt) on the x axis of the branch that it has not seen


def diagnosed(name: str, cut_s: float, axis: str, folder: Path, gyrotc: Command) -> dict[str, Any]:
    """Everything after the cut is scored once."""
    if not (REAL / name).is_dir():
        pytest.skip(f"{name} is absent: see GYROTC_REAL_DATA")
    data = folder / "data"
    data.mkdir()
    (data / "data.csv").write_bytes((REAL / name / "data.csv").read_bytes())
    run = '[[run]]\nfile = "data.csv"\npower_on_s = "unknown"\n'
    (data / "dataset.toml").write_text(
        f'schema = 1\nserial = "R1"\n{run}to_s = {cut_s}\n{run}from_s = {cut_s}\nrole = "exam"\n'
    )
    done = gyrotc("diagnose", data, "--axis", axis, "--average-s", 10, "--out", folder / "out")
    assert done.returncode == 0, done.stderr
    return dict(json.loads((folder / "out" / "diagnose.json").read_text()))


def test_memory_of_a_chamber_cycle_holds_on_the_branch_it_has_not_seen(
    tmp_path: Path, gyrotc: Command
) -> None:
    result = diagnosed("mpu6000-chamber-cycle", 3130.0, "x", tmp_path, gyrotc)
    assert result["extended"]["exam_rms_dph"] < 0.5 * STATIC_MAP_DPH
    assert result["extended"]["terms"] == ["thermal_gradient", "thermal_gradient"]
    assert result["verdict"] == "not_testable", "one cycle does not tell a memory from a static dT/dt"
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert "How much can be said" in page and "no memory: products of T and dT/dt" in page
    assert {"warm_up", "turn_on_offset", "ageing"} <= {
        c["id"] for c in result["considered"] if "not_testable" in c
    }


def test_nothing_is_said_of_a_constant_temperature(tmp_path: Path, gyrotc: Command) -> None:
    result = diagnosed("mpu6050-isothermal", 524.0, "x", tmp_path, gyrotc)
    assert (result["verdict"], result["causes"], result["extended"]) == ("not_testable", [], None)
