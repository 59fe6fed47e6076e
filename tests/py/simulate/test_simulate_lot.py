"""Lots of simulated gyros: what units share, clusters, strangers, and that seed and order fix every byte."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conftest import invoked
from gyrotc.common.errors import InputError
from gyrotc.recordings.load import load
from gyrotc.simulate.lot import SCORES, LotOrder, draw_lot, simulate_lot
from gyrotc.simulate.scenario import read
from gyrotc.simulate.truth import read_truth
from numpy.typing import NDArray

Array = NDArray[np.float64]

SEED = 20
SHORT = """
title = "A short run"

[profile.ramp]
start_c = 0.0
record_min = 20
steps = [{ramp_to_c = 20.0, c_per_min = 5.0}]

[[set]]
started = 2026-01-01T00:00:00Z
profiles = ["ramp"]
"""


@pytest.fixture
def short(tmp_path: Path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(SHORT, "utf-8")
    return path


def maps(order: LotOrder, seed: int) -> Array:
    """Maps of the units over the operating range, deg/h, shape (units, points)."""
    t, r = np.meshgrid(np.linspace(-32.0, 68.0, 21), np.linspace(-2.4, 2.4, 7), indexing="ij")
    return np.array([unit.bias_map(t, r).ravel() for unit in draw_lot(read("paper")[1], order, seed)])


def spread(found: Array) -> float:
    """What units differ by, over what they share: RMS about the mean map, constants taken off."""
    shapes = found - found.mean(axis=1, keepdims=True)
    return float(np.std(shapes - shapes.mean(axis=0)) / np.std(shapes.mean(axis=0)))


def test_family_is_the_correlation_of_a_parameter_between_two_units() -> None:
    print("seed", SEED)
    pairs = [
        [list(u.lot.scores.values()) for u in draw_lot(read("paper")[1], LotOrder(2, 0.7), SEED + k) if u.lot]
        for k in range(40)
    ]
    one, other = np.array(pairs)[:, 0], np.array(pairs)[:, 1]
    found = np.mean(one * other) / np.mean(one**2)
    assert found == pytest.approx(0.7, abs=0.08)  # 40 lots of 30 scores, some of them correlated
    assert np.mean(one**2) == pytest.approx(1.0, abs=0.2)  # over 60 seeds it scatters by 0.042


def test_units_of_a_stronger_family_differ_less() -> None:
    print("seed", SEED)
    strengths = (0.0, 0.5, 0.8, 0.94, 0.99)
    found = [np.median([spread(maps(LotOrder(16, f), SEED + k)) for k in range(3)]) for f in strengths]
    assert found == sorted(found, reverse=True)
    assert 0.1 < found[3] < 0.5 < found[0]  # medians of many lots: docs/simulation.md, section 6
    assert np.ptp(maps(LotOrder(3, 1.0), SEED), axis=0).max() < 1e-15


def test_a_stranger_is_no_unit_of_its_lot() -> None:
    order = LotOrder(20, 0.96, strangers=3)
    units = draw_lot(read("paper")[1], order, 8)
    strange = np.array([bool(u.lot and u.lot.stranger) for u in units])
    assert strange.sum() == 3
    found = maps(order, 8)
    away = np.std(found - found[~strange].mean(axis=0), axis=1)
    assert away[strange].min() > 2.0 * np.median(away[~strange])


def test_clusters_have_centers_of_their_own() -> None:
    order = LotOrder(30, 0.97, clusters=2)
    cluster = np.array([u.lot.cluster for u in draw_lot(read("paper")[1], order, 5) if u.lot])
    assert set(cluster) == {0, 1}
    found = maps(order, 5)
    apart = np.std(found[cluster == 0].mean(axis=0) - found[cluster == 1].mean(axis=0))
    within = np.std(found[cluster == 0] - found[cluster == 0].mean(axis=0))
    assert apart > 2.0 * within


def test_a_unit_keeps_its_parameters_where_the_lot_grows() -> None:
    small, large = (draw_lot(read("paper")[1], LotOrder(n, 0.9), 3) for n in (2, 6))
    for one, other in zip(small, large, strict=False):
        assert one.bias_map.described() == other.bias_map.described()
        assert one.plan.sensor == other.plan.sensor
    assert small[0].plan.sensor.offset_c != small[1].plan.sensor.offset_c
    assert small[0].plan.gyro.node["case"].to != small[1].plan.gyro.node["case"].to


def test_a_lot_is_a_folder_of_data_sets_that_seed_and_order_fix(short: Path, tmp_path: Path) -> None:
    order = LotOrder(3, 0.9, strangers=1)
    first, again = ([*simulate_lot(order, seed=4, out=tmp_path / n, scenario=short)] for n in "ab")
    assert first == again == ["LOT-0004-001", "LOT-0004-002", "LOT-0004-003"]
    for serial in first:
        for file in ("run-01.csv", "truth.json", "dataset.toml"):
            assert (tmp_path / "a" / serial / file).read_bytes() == (
                tmp_path / "b" / serial / file
            ).read_bytes()
        dataset = load(tmp_path / "a" / serial)
        assert dataset.serial == serial
        truth = read_truth(tmp_path / "a" / serial)
        assert truth is not None and truth.content.lot is not None
        assert set(truth.content.lot.scores) == set(SCORES)
    told = [json.loads((tmp_path / "a" / s / "truth.json").read_text())["lot"]["stranger"] for s in first]
    assert sum(told) == 1


@pytest.mark.parametrize(
    "wrong",
    [{"units": 0}, {"units": 3, "family": 1.5}, {"units": 3, "clusters": 4}, {"units": 3, "strangers": 3}],
)
def test_a_lot_that_cannot_be_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match=f"--{[*wrong][-1]}"):
        LotOrder(**wrong)  # type: ignore[arg-type]


def test_the_command_asks_for_the_number_of_units(short: Path, tmp_path: Path) -> None:
    done = invoked("simulate", "lot", "--units", "2", "--base", short, "--out", tmp_path / "lot")
    assert done.exit_code == 0, done.output
    assert sorted(p.name for p in (tmp_path / "lot").iterdir()) == ["LOT-0001-001", "LOT-0001-002"]
    missing = invoked("simulate", "lot", "--out", tmp_path / "none")
    assert isinstance(missing.exception, InputError) and "--units" in str(missing.exception)
    other = invoked("simulate", "paper", "--family", "0.5", "--out", tmp_path / "none")
    assert isinstance(other.exception, InputError) and "--family" in str(other.exception)
    assert not (tmp_path / "none").exists()
