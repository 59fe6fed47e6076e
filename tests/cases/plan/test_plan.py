"""`gyrotc plan`: limits, separability, accuracy, the shortest profile, further runs."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from campaigns import scenario, simulated
from conftest import Command, invoked
from gyrotc.cli.plan import limits_of, pair_of
from gyrotc.common import InputError
from gyrotc.plan import Sensitivity, programme_of
from gyrotc.plan.plan import plan, shortest


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("plan")


@pytest.fixture(scope="module")
def planned(folder: Path) -> dict[str, Any]:
    return plan(scenario(folder), seed=4, required={"hysteresis": 1.5e-4}).content()


@pytest.fixture(scope="module")
def sensitivity(folder: Path) -> Sensitivity:
    return Sensitivity(programme_of(scenario(folder), noise="paper", seed=4))


def values(result: dict[str, Any]) -> dict[str, float | None]:
    return {c["id"]: c["detection_limit"]["value"] for c in result["limits"]}


def test_limits_are_those_that_a_diagnosis_prints(planned: dict[str, Any], tmp_path: Path, gyrotc: Command) -> None:
    """Same profiles, recorded: the limits follow the noise that the recordings have, within its uncertainty."""
    done = gyrotc("diagnose", simulated(tmp_path, seed=4), "--json", tmp_path / "d.json")
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "d.json").read_text())["considered"]
    limits = {c["id"]: c["detection_limit"]["value"] for c in found if c["detection_limit"]}
    for id in ("thermal_gradient", "hysteresis", "warm_up", "path_length_periodicity"):
        assert values(planned)[id] == pytest.approx(limits[id], rel=0.3), id


def test_what_more_hours_buy(sensitivity: Sensitivity) -> None:
    once, twice = sensitivity.limits(), sensitivity.limits([0, 1, 2, 0, 1, 2])
    for id in ("thermal_gradient", "hysteresis", "warm_up"):
        first, second = once[id].value, twice[id].value
        assert first is not None and second is not None
        assert first / second == pytest.approx(2.0**0.5, rel=0.01), "limits fall with the root of the hours"
    errors = [sensitivity.map_error(range(k)) for k in (1, 2, 3)]
    assert errors == sorted(errors, reverse=True)


def test_ten_times_the_noise_is_ten_times_the_limit(sensitivity: Sensitivity, folder: Path) -> None:
    path = scenario(folder, "[noise]\narw_deg_per_sqrt_h = 1.1666667e-3\n", "noisy")
    noisy = Sensitivity(programme_of(path, noise="paper", seed=4)).limits()
    for id in ("thermal_gradient", "hysteresis", "warm_up"):
        quiet, loud = sensitivity.limits()[id].value, noisy[id].value
        assert quiet is not None and loud is not None
        assert loud / quiet == pytest.approx(10.0, rel=1e-3)


def test_the_shortest_profile_reaches_what_is_required(planned: dict[str, Any]) -> None:
    found = planned["shortest"]
    assert found["reached"]["hysteresis"] <= 1.5e-4
    assert found["hours"] == pytest.approx(4.0 * len(found["runs"]))
    assert set(found["runs"]) <= {"loops", "slow", "steps"}


def test_what_no_number_of_runs_reaches_is_reported(sensitivity: Sensitivity) -> None:
    assert shortest(sensitivity, {"hysteresis": 1e-9}).runs is None


def test_accuracy_comes_near_the_noise_floor(planned: dict[str, Any]) -> None:
    ratios = [a["rms_over_floor"] for a in planned["accuracy"]]
    assert ratios == sorted(ratios, reverse=True) and 1.0 < ratios[-1] < 1.1


def test_two_ways_of_saying_the_same_cannot_be_reported_apart(planned: dict[str, Any]) -> None:
    d = {r["id"]: r["d"] for r in planned["separability"]}
    assert d["ageing"]["turn_on_offset"] > 30.0, "offsets of their own hold every trend between runs"
    assert d["path_length_periodicity"]["warm_up"] < 4.0
    hard = {frozenset(h["pair"]) for h in planned["hard_to_separate"]}
    assert frozenset({"ageing", "turn_on_offset"}) in hard


def test_the_command_prints_and_writes(folder: Path, tmp_path: Path, gyrotc: Command) -> None:
    done = gyrotc("plan", scenario(folder), "--out", tmp_path, "--require", "warm_up=3e-3", "--json", tmp_path / "p")
    assert done.returncode == 0, done.stderr
    for text in ("What these runs will find", "thermal_gradient", "shortest profile", "Predicted accuracy"):
        assert text in done.stdout
    result = json.loads((tmp_path / "p").read_text())
    assert result["schema"] == "gyrotc.plan/1"
    page = (tmp_path / "report.html").read_text("utf-8")
    assert page.count("<svg") == 3
    (tmp_path / "report.html").unlink()
    assert gyrotc("report", tmp_path).returncode == 0
    assert (tmp_path / "report.html").read_text("utf-8") == page
    assert "warm up 3.00·10⁻³ deg/h" in page


@pytest.mark.parametrize(
    ("options", "reported"),
    [
        (("--require", "hysteresis"), "cause=limit"),
        (("--require", "hysteresis=-1"), "above 0"),
        (("--require", "sensor_lag=1"), "thermal_gradient"),
        (("--separate", "hysteresis"), "two causes"),
        (("--separate", "hysteresis,sensor_lag"), "thermal_gradient"),
    ],
)
def test_bad_options_are_reported(folder: Path, options: tuple[str, str], reported: str) -> None:
    """In this process: what is refused costs less than a start of the program."""
    done = invoked("plan", scenario(folder), *options)
    assert isinstance(done.exception, InputError) and reported in str(done.exception)


def test_options_are_read() -> None:
    assert limits_of(["hysteresis=5e-5", " warm_up = 1e-3"]) == {"hysteresis": 5e-5, "warm_up": 1e-3}
    assert pair_of("hysteresis, ageing") == ("hysteresis", "ageing") and pair_of(None) is None
    with pytest.raises(InputError):
        pair_of("ageing,ageing")


ROOMY = """
title = "A far node, a near one, and one with a thermometer"
[gyro.node.case]
heat_capacity_j_per_k = 1500.0
power_w = 14.0
to_air_w_per_k = 2.5
to = {block = 1.0}
[gyro.node.block]
heat_capacity_j_per_k = 800.0
to = {cavity = 3.0}
[gyro.node.cavity]
heat_capacity_j_per_k = 5.0
[gyro.node.mount]
heat_capacity_j_per_k = 400.0
power_w = 1.0
to_air_w_per_k = 0.3
to = {block = 0.2}
[profile.cycle]
start_c = 20.0
record_min = 240
steps = [{hold_min = 30}, {ramp_to_c = 50.0, c_per_min = 3.0}, {hold_min = 40}, {ramp_to_c = 0.0, c_per_min = 1.5},
  {hold_min = 40}, {ramp_to_c = 30.0, c_per_min = 5.0}, {hold_min = 90}]
[[set]]
started = 2026-01-01T00:00:00Z
profiles = ["cycle", "cycle"]
"""


def test_a_further_thermometer_is_proposed_where_the_others_say_least(tmp_path: Path) -> None:
    path = tmp_path / "roomy.toml"
    path.write_text(ROOMY, "utf-8")
    found = plan(path, add_thermometer=True).thermometers
    assert found is not None
    # slow and far, far, tight to the sensor
    assert [place.node for place in found] == ["mount", "case", "cavity"]
    limits = [place.limit_dph_per_c or math.inf for place in found]
    assert limits == sorted(limits)
    assert limits[0] < 0.1 * limits[-1]
    path.write_text(ROOMY + '[[thermometer]]\nname = "mount_c"\nnode = "mount"\n', "utf-8")
    beside = plan(path, add_thermometer=True).thermometers
    assert beside is not None
    assert (beside[-1].node, beside[-1].there) == ("mount", True)
    before = {place.node: place.unseen_c for place in found}
    assert all(place.unseen_c <= before[place.node] * (1.0 + 1e-9) for place in beside)
    assert "thermometers" not in plan(path).content()
