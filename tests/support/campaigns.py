"""Small campaigns: for diagnosis four hours a run, so that a search takes seconds; for channels shorter ones."""

from __future__ import annotations

import json
from pathlib import Path

from conftest import run_gyrotc

PROFILES = """
[profile.loops]
start_c = 20.0
record_min = 240
steps = [{ramp_to_c = 60.0, c_per_min = 5.0}, {hold_min = 30}, {ramp_to_c = -30.0, c_per_min = 5.0}, {hold_min = 40},
  {nested_c = 10.0, half_ranges_c = [35.0, 15.0], c_per_min = 3.0}]

[profile.slow]
start_c = -30.0
record_min = 240
steps = [{hold_min = 20}, {ramp_to_c = 55.0, c_per_min = 0.8}, {hold_min = 20}, {ramp_to_c = -10.0, c_per_min = 1.5}]

[profile.steps]
start_c = 50.0
record_min = 240
steps = [{hold_min = 20}, {staircase_to_c = -30.0, tread_c = 20.0, hold_min = 25, c_per_min = 3.0},
  {staircase_to_c = 40.0, tread_c = 35.0, hold_min = 20, c_per_min = 2.0}]

[[set]]
role = "train"
started = 2026-03-02T08:00:00Z
profiles = ["loops", "slow", "steps"]

[[set]]
role = "exam"
started = 2026-03-16T08:00:00Z
profiles = ["loops", "steps"]
"""

GRADIENT = '[[cause]]\nid = "thermal_gradient"\ntau_s = 900.0\namplitude_dph_per_c = 3e-4\n'


def up_and_down(base: str, runs: int) -> str:
    """A campaign of a known scenario's gyro in runs of 2.5 h, one more of them a week later as the test run."""
    return f"""
extends = "{base}"
[profile."up and down"]
start_c = 10.0
record_min = 150
steps = [{{hold_min = 20}}, {{ramp_to_c = 40.0, c_per_min = 2.0}}, {{hold_min = 20}},
  {{ramp_to_c = 0.0, c_per_min = 2.0}}, {{hold_min = 30}}, {{ramp_to_c = 20.0, c_per_min = 2.0}}, {{hold_min = 30}}]
[[set]]
started = 2026-01-01T00:00:00Z
profiles = {json.dumps(["up and down"] * runs)}
[[set]]
role = "exam"
started = 2026-01-08T00:00:00Z
profiles = ["up and down"]
"""


def scenario(folder: Path, cause: str = "", name: str = "short") -> Path:
    """A scenario file."""
    path = folder / f"{name}.toml"
    path.write_text(f'extends = "paper"\ntitle = {json.dumps(name)}\n{cause}{PROFILES}', "utf-8")
    return path


def simulated(folder: Path, cause: str = "", seed: int = 4) -> Path:
    """A data set of the scenario."""
    out = folder / "data"
    done = run_gyrotc("simulate", scenario(folder, cause), "--seed", str(seed), "--out", out)
    assert done.returncode == 0, done.stderr
    return out
