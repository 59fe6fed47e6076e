"""What simulated gyros hold: further thermometers and signals, lots, the chamber's programme, the thermal network."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import invoked
from gyrotc.common import InputError
from gyrotc.recordings import load
from gyrotc.simulate import (
    SCORES,
    Chamber,
    Gyro,
    Laser,
    LotOrder,
    Scenario,
    ThermalNetwork,
    Thermometer,
    chamber_air,
    draw_lot,
    laser_bias,
    laser_readings,
    laser_states,
    profile,
    read,
    read_truth,
    simulate,
    simulate_campaign,
    simulate_lot,
    thermal_network,
    thermometer_readings,
)
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
_N = 4000


def planned(**changes: object) -> Scenario:
    """The first two runs of the packaged scenario, with changes."""
    _, plan = read("signals")
    one = plan.set[0].model_copy(update={"profiles": ["cold start -40 C"]})
    return plan.model_copy(update={"set": [one], **changes})


def test_thermometers_show_their_own_nodes_with_their_own_faults() -> None:
    """Offset, lag and steps follow from the true temperature of the node alone."""
    made = next(simulate_campaign(planned(), 3))
    for name, node, lag_s, offset_c, step_c in (
        ("mirror_c", "mirror", 15.0, 0.3, 0.02),
        ("case_c", "case", 40.0, -0.4, 0.0625),
    ):
        reading, true = made.channels[name], made.states[f"{node}_c"]
        assert np.allclose(np.round(reading / step_c) * step_c, reading, atol=1e-9)
        # An independent lag: explicit Euler at a hundredth of the time constant's step.
        z, shown = true[0], []
        for value in true.tolist():
            z += (value - z) / lag_s
            shown.append(z)
        assert np.abs(reading - np.array(shown) - offset_c)[200:].max() < 0.1 + step_c


def test_a_loose_thermometer_follows_the_air_from_its_day_on() -> None:
    one = Thermometer(name="case_c", node="case", loose_from_day=10.0, noise_c=0.0, resolution_c=0.0)
    time_s = np.arange(float(_N))
    node, air = np.full(_N, 30.0), np.full(_N, 10.0)
    before = thermometer_readings(one, node, air, time_s, 9.9, np.random.default_rng(0))
    after = thermometer_readings(one, node, air, time_s, 10.0, np.random.default_rng(0))
    assert before == pytest.approx(30.0)
    assert after[-1] == pytest.approx(20.0)


def test_the_mirror_jumps_by_half_a_wavelength_and_not_on_the_same_way_back() -> None:
    """The perimeter's expansion is the sum of stroke and whole half wavelengths; which one hangs on the way."""
    laser = Laser(expansion_ppm_per_c=0.05, expansion_ppm_per_c2=0.0)
    way = np.concatenate([np.linspace(20.0, 60.0, _N), np.linspace(60.0, 20.0, _N)])
    stroke = laser_states(laser, way, way + 30.0, way, 0.0, np.zeros(2 * _N)).stroke
    fringes = 280e6 * 0.05e-6 * (way - 20.0) / (0.5 * 632.8)
    orders = fringes - stroke
    assert np.allclose(orders, np.round(orders), atol=1e-9)
    assert np.abs(stroke).max() <= laser.reset_share
    up, down = stroke[:_N], stroke[_N:][::-1]
    assert np.abs(up - down).max() == pytest.approx(1.0, abs=1e-9)
    assert (np.abs(up - down) < 0.5).mean() > 0.5


def test_intensity_falls_with_losses_with_a_hotter_gas_and_with_the_years() -> None:
    laser = Laser(intensity_noise_v=0.0, stroke_noise_v=0.0)
    flat = np.full(4, 20.0)
    plain = laser_states(laser, flat, flat + 30.0, flat, 0.0, np.zeros(4))

    def intensity(changed: object) -> float:
        return float(laser_readings(laser, changed, np.random.default_rng(0))["intensity_v"][0])  # type: ignore[arg-type]

    assert intensity(plain) == pytest.approx(laser.intensity_level_v)
    assert intensity(replace(plain, loss_ppm=plain.loss_ppm + 10.0)) < laser.intensity_level_v
    hotter = laser_states(laser, flat, flat + 60.0, flat, 0.0, np.zeros(4))
    later = laser_states(laser, flat, flat + 30.0, flat, 365.0, np.zeros(4))
    assert max(intensity(hotter), intensity(later)) < laser.intensity_level_v
    assert laser_bias(laser, plain) == pytest.approx(0.0, abs=1e-12)


def test_the_bias_is_the_map_with_what_differences_and_laser_add() -> None:
    whole, bare = (
        next(simulate_campaign(planned(**changes), 3)) for changes in ({}, {"difference": [], "laser": None})
    )
    added = (whole.bias_dph - bare.bias_dph)[:-1]
    s = whole.states
    x = s["mirror_c"] - s["block_c"]
    cavity = whole.cavity_c[:-1]
    expected = 5e-4 * x / np.sqrt(1.0 + (x / 8.0) ** 2) * (1.0 + 0.004 * (cavity - 20.0))
    expected += -1e-4 * (s["case_c"] - s["block_c"])
    expected += 1e-4 * (s["loss_ppm"] - 300.0) + 5e-4 * np.sin(np.pi * s["stroke"])
    assert added == pytest.approx(expected, abs=1e-12)
    assert bare.reading_c == pytest.approx(whole.reading_c)  # nothing else is drawn anew


def test_further_thermometers_change_nothing_else_of_a_recording() -> None:
    _, plan = read("paper-20C")
    more = plan.model_copy(update={"thermometer": [Thermometer(name="case_c", node="case")]})
    a, b = next(simulate_campaign(plan, 5)), next(simulate_campaign(more, 5))
    assert np.array_equal(a.angle_arcsec, b.angle_arcsec)
    assert np.array_equal(a.reading_c, b.reading_c)
    assert not a.states
    assert set(b.channels) == {"case_c"}


def test_recordings_have_the_columns_and_truth_has_the_states(tmp_path: Path) -> None:
    scenario = tmp_path / "short.toml"
    scenario.write_text(
        'extends = "signals"\n[profile."cold start 20 C"]\nrecord_min = 20\n[[set]]\n'
        'started = 2026-01-01T00:00:00Z\nprofiles = ["cold start 20 C"]\n',
        "utf-8",
    )
    simulate(scenario, seed=1, out=tmp_path / "made")
    dataset = load(tmp_path / "made")
    assert dataset.channels == ("mirror_c", "case_c", "electronics_c", "intensity_v", "path_length_v")
    truth = read_truth(tmp_path / "made")
    assert truth is not None
    named = truth.content.runs[0].states
    assert named is not None
    loss = np.load(tmp_path / "made" / named["loss_ppm"])
    assert loss.shape == (120,)
    assert set(truth.content.plan) >= {"thermometer", "laser", "difference"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[[thermometer]]\nname = "a_c"\nnode = "lid"\n', "node of thermometer a_c 'lid' is no node"),
        ('[[thermometer]]\nname = "temperature_c"\nnode = "case"\n', "names of channels"),
        ('[laser]\nintensity = "path_length_v"\n', "repeat"),
        ("[laser]\nreset_share = 0.3\n", "reset_share"),
        ('[[difference]]\nnode = "case"\nagainst = "lid"\ndph_per_c = 1.0\n', "node of a difference 'lid'"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "odd.toml"
    path.write_text('extends = "separating"\n' + text, "utf-8")
    with pytest.raises(InputError, match=said) as refused:
        read(path)
    assert "odd.toml" in str(refused.value)


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
    assert 0.1 < found[3] < 0.5 < found[0]  # medians of a few lots
    assert np.ptp(maps(LotOrder(3, 1.0), SEED), axis=0).max() < 1e-15


def test_a_stranger_is_no_unit_of_its_lot() -> None:
    order = LotOrder(20, 0.96, unrelated=3)
    units = draw_lot(read("paper")[1], order, 8)
    strange = np.array([bool(u.lot and u.lot.unrelated) for u in units])
    assert strange.sum() == 3
    found = maps(order, 8)
    away = np.std(found - found[~strange].mean(axis=0), axis=1)
    assert away[strange].min() > 2.0 * np.median(away[~strange])


def test_clusters_have_centers_of_their_own() -> None:
    order = LotOrder(30, 0.97, clusters=2)
    cluster = np.array([u.lot.cluster for u in draw_lot(read("paper")[1], order, 5) if u.lot])
    assert set(cluster) == {0, 1}
    found = maps(order, 5)
    between = np.std(found[cluster == 0].mean(axis=0) - found[cluster == 1].mean(axis=0))
    within = np.std(found[cluster == 0] - found[cluster == 0].mean(axis=0))
    assert between > 2.0 * within


def test_a_unit_keeps_its_parameters_where_the_lot_grows() -> None:
    small, large = (draw_lot(read("paper")[1], LotOrder(n, 0.9), 3) for n in (2, 6))
    for one, other in zip(small, large, strict=False):
        assert one.bias_map.described() == other.bias_map.described()
        assert one.plan.sensor == other.plan.sensor
    assert small[0].plan.sensor.offset_c != small[1].plan.sensor.offset_c
    assert small[0].plan.gyro.node["case"].to != small[1].plan.gyro.node["case"].to


def test_a_lot_is_a_folder_of_data_sets_that_seed_and_order_fix(short: Path, tmp_path: Path) -> None:
    order = LotOrder(3, 0.9, unrelated=1)
    first, again = ([*simulate_lot(order, seed=4, out=tmp_path / n, scenario=short)] for n in "ab")
    assert first == again == ["LOT-0004-001", "LOT-0004-002", "LOT-0004-003"]
    for serial in first:
        for file in ("run-01.csv", "truth.json", "dataset.toml"):
            assert (tmp_path / "a" / serial / file).read_bytes() == (tmp_path / "b" / serial / file).read_bytes()
        dataset = load(tmp_path / "a" / serial)
        assert dataset.serial == serial
        truth = read_truth(tmp_path / "a" / serial)
        assert truth is not None and truth.content.lot is not None
        assert set(truth.content.lot.scores) == set(SCORES)
    reported = [json.loads((tmp_path / "a" / s / "truth.json").read_text())["lot"]["unrelated"] for s in first]
    assert sum(reported) == 1


@pytest.mark.parametrize(
    "wrong", [{"units": 0}, {"units": 3, "family": 1.5}, {"units": 3, "clusters": 4}, {"units": 3, "unrelated": 3}]
)
def test_a_lot_that_cannot_be_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match=[*wrong][-1]):
        LotOrder(**wrong)  # type: ignore[arg-type]


def test_the_command_makes_one_unit_or_a_lot(short: Path, tmp_path: Path) -> None:
    done = invoked("simulate", short, "--units", "2", "--out", tmp_path / "lot")
    assert done.exit_code == 0, done.output
    assert sorted(p.name for p in (tmp_path / "lot").iterdir()) == ["LOT-0001-001", "LOT-0001-002"]


FASTEST = 10.0


def programme(*steps: dict[str, object], start_c: float = 0.0, until_s: float = 1e5) -> tuple[Array, Array]:
    checked = TypeAdapter(list[profile.Step]).validate_python(list(steps))
    return profile.corners(checked, start_c, until_s, FASTEST)


def visited(*steps: dict[str, object], start_c: float = 0.0) -> list[float]:
    return [round(float(c), 9) for c in programme(*steps, start_c=start_c)[1]]


def test_a_hold_and_a_ramp_have_their_length_and_rate() -> None:
    times, temperatures = programme({"hold_min": 60}, {"ramp_to_c": 60, "c_per_min": 5}, until_s=7200.0)
    assert times.tolist() == [0.0, 3600.0, 3600.0 + 720.0, 7200.0]
    assert temperatures.tolist() == [0.0, 0.0, 60.0, 60.0]


def test_a_jump_goes_as_fast_as_the_chamber_can_and_no_ramp_goes_faster() -> None:
    assert programme({"step_to_c": 50})[0][1] == pytest.approx(300.0)
    assert programme({"ramp_to_c": 50, "c_per_min": 40})[0][1] == pytest.approx(300.0)


def test_a_staircase_holds_on_every_tread_in_both_directions() -> None:
    up = {"staircase_to_c": 50, "tread_c": 25, "hold_min": 10, "c_per_min": 5}
    down = {"staircase_to_c": 0, "tread_c": 20, "hold_min": 10, "c_per_min": 5}
    assert visited(up, down)[:-1] == [0, 25, 25, 50, 50, 25, 25, 0, 0]
    assert programme(up)[0][1:5].tolist() == [300.0, 900.0, 1200.0, 1800.0]


def test_a_triangle_and_nested_loops_turn_where_they_should() -> None:
    assert visited({"triangle_c": [10, 40], "c_per_min": 2, "cycles": 2})[1:-1] == [10, 40, 10, 40, 10]
    loops = {"nested_c": 10, "half_ranges_c": [30, 10], "c_per_min": 2}
    assert visited(loops)[1:-1] == [40, -20, 20, 0, 10]


def test_a_repeat_without_a_number_fills_the_record_and_never_hangs() -> None:
    inner = [{"ramp_to_c": 10, "c_per_min": 1}, {"ramp_to_c": 0, "c_per_min": 1}]
    times, temperatures = programme({"repeat": inner}, until_s=6000.0)
    assert times[-1] == 6000.0 and temperatures.tolist() == [0, *[10, 0] * 5]
    assert visited({"repeat": inner, "times": 2})[:-1] == [0, 10, 0, 10, 0]
    assert visited({"repeat": [{"ramp_to_c": 0, "c_per_min": 1}]})[-1] == 0.0


def test_an_unknown_step_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValidationError, match="ramp_to_c"):
        programme({"wait_min": 5})
    with pytest.raises(ValidationError, match="c_per_min"):
        programme({"ramp_to_c": 5})


def follow(settings: Chamber, programmed: Array, seed: int = 0) -> Array:
    return chamber_air(settings, programmed, 1.0, np.random.default_rng(seed))


QUIET = Chamber(ripple_c=0.0, setpoint_sigma_c=0.0)


def test_the_air_lags_a_ramp_by_the_lag_and_overshoots_a_step_by_the_damping() -> None:
    time_s = np.arange(20000.0)
    lagging = time_s / 60.0 - follow(QUIET, time_s / 60.0)
    assert lagging[-1] == pytest.approx(QUIET.lag_s / 60.0, rel=1e-6)
    step = np.where(time_s > 0.0, 10.0, 0.0)
    for damping in (0.4, 0.7):
        air = follow(QUIET.model_copy(update={"damping": damping}), step)
        expected = 10.0 * (1.0 + np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2)))
        assert air.max() == pytest.approx(expected, abs=0.01)
        assert air[-1] == pytest.approx(10.0, abs=1e-6)


def test_ripple_and_setpoint_error_are_as_large_as_declared() -> None:
    flat = np.zeros(36000)
    ripple = follow(QUIET.model_copy(update={"ripple_c": 0.3}), flat)
    assert np.ptp(ripple) == pytest.approx(0.6, rel=1e-3)
    offsets = [follow(QUIET.model_copy(update={"setpoint_sigma_c": 0.5}), flat[:2], s)[0] for s in range(400)]
    assert np.std(offsets) == pytest.approx(0.5, rel=0.2)


def network() -> ThermalNetwork:
    return thermal_network(Gyro())


def test_the_steady_state_is_the_chain_of_resistances() -> None:
    """All power leaves by the case; what the gas gives off passes cavity and block."""
    case, block, cavity, gas = network().steady(20.0, on=True)
    assert case == pytest.approx(20.0 + (14.75 + 1.5) / 2.5)
    assert block - case == pytest.approx(1.5 / 1.0)
    assert cavity - block == pytest.approx(1.5 / 3.0)
    assert gas - cavity == pytest.approx(1.5 / 0.05)
    assert np.allclose(network().steady(-40.0, on=False), -40.0)


def history(points: int, dt_s: float) -> tuple[Array, Array]:
    time_s = dt_s * np.arange(points)
    air = np.interp(time_s, [0.0, 1000.0, 2200.0, 4000.0, 5000.0], [0.0, 0.0, 60.0, 60.0, -20.0])
    return air, (time_s >= 600.0).astype(np.float64)


def test_energy_is_conserved() -> None:
    """Heat stored in the nodes = electrical energy + what came in from the air."""
    net = network()
    air, on = history(8001, 1.0)
    nodes = net.respond(air, on, 1.0)
    stored = net.capacity @ (nodes[:, -1] - nodes[:, 0])
    electrical = float(net.power.sum() * on[:-1].sum())
    inflow = net.to_air @ (air - nodes)
    assert stored == pytest.approx(electrical + np.trapezoid(inflow), rel=1e-6)


def test_the_response_is_that_of_an_independent_integration() -> None:
    net = network()
    air, on = history(6001, 1.0)
    time_s = np.arange(6001.0)
    laplacian = net.laplacian()

    def slope(t: float, nodes: Array) -> Array:
        heat = net.to_air * np.interp(t, time_s, air) + net.power * (t >= 600.0)
        return np.asarray((heat - laplacian @ nodes) / net.capacity)

    parts = []
    start = net.steady(0.0, on=False)
    for low, high in ((0.0, 600.0), (600.0, 1000.0), (1000.0, 2200.0), (2200.0, 4000.0), (4000.0, 6000.0)):
        at = np.arange(low, high + 0.5, 100.0)
        solved = solve_ivp(slope, (low, high), start, t_eval=at, method="LSODA", rtol=1e-10, atol=1e-10)
        parts.append((at, solved.y))
        start = solved.y[:, -1]
    nodes = net.respond(air, on, 1.0)
    for at, expected in parts:
        assert np.allclose(nodes[:, at.astype(int)], expected, atol=1e-5)


def test_a_single_node_answers_a_ramp_as_the_formula_says() -> None:
    one = np.ones(1)
    net = ThermalNetwork(("node",), 700.0 * one, 1.4 * one, np.zeros((1, 1)), 7.0 * one)
    tau = 700.0 / 1.4
    time_s = np.arange(4001.0)
    rate = 3.0 / 60.0
    nodes = net.respond(rate * time_s, np.ones(4001), 1.0)[0]
    heated = 7.0 / 1.4 * (1.0 - np.exp(-time_s / tau))
    assert np.allclose(nodes, rate * (time_s - tau * (1.0 - np.exp(-time_s / tau))) + heated, atol=1e-9)


def test_the_grid_does_not_matter() -> None:
    fine = network().respond(*history(8001, 1.0), 1.0)
    coarse = network().respond(*history(801, 10.0), 10.0)
    assert np.allclose(fine[:, ::10], coarse, atol=1e-9)
