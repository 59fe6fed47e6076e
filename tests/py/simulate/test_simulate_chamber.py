"""The chamber's programme and air, the thermal network: against formulas and an independent integration."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.simulate import chamber, profile
from gyrotc.simulate.chamber import ThermalNetwork
from gyrotc.simulate.instrument import thermal_network
from gyrotc.simulate.scenario import Chamber, Gyro
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]
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
    return chamber.air(settings, programmed, 1.0, np.random.default_rng(seed))


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
