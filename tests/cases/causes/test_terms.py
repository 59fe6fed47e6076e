"""The catalogue of causes: operators against independent code, features against references, registration."""

from __future__ import annotations

import math
import secrets
from pathlib import Path

import numpy as np
import pytest
from gyrotc.causes import CATALOGUE, History, Scene
from gyrotc.common import InputError
from gyrotc.mirror import Course, CourseChannel, TermOutcome, delayed, first_order, play
from gyrotc.simulate import draw_map
from numpy.typing import NDArray

Array = NDArray[np.float64]
TIMES = np.arange(0.0, 20000.0, 10.0)
INTERFACE = {
    "cavity_lag": ("thermal_memory", ["tau_s"]),
    "thermal_gradient": ("thermal_memory", ["tau_s", "amplitude_dph_per_c"]),
    "time_misalignment": ("thermal_memory", ["shift_s"]),
    "hysteresis": ("hysteresis", ["width_c", "amplitude_dph_per_c"]),
    "warm_up": ("power_on", ["tau_s", "amplitude_dph"]),
    "turn_on_offset": ("between_runs", ["std_dph"]),
    "ageing": ("between_runs", ["slope_dph_per_day"]),
    "power_on_temperature": ("between_runs", ["slope_dph_per_c"]),
    "map_too_coarse": ("static_map", []),
    "path_length_periodicity": ("static_map", ["period_c", "amplitude_dph"]),
    "auxiliary": ("auxiliary", ["slope_dph_per_unit"]),
    "auxiliary_curve": ("auxiliary", ["slope_dph_per_unit", "reference", "width"]),
    "auxiliary_product": ("auxiliary", ["slope_dph_per_unit", "slope_dph_per_unit_per_c", "reference_c"]),
}


@pytest.fixture
def wandering() -> Array:
    """A temperature that ramps, holds and turns back, C."""
    seed = secrets.randbits(32)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    corners = np.concatenate(([0.0], np.sort(rng.uniform(0.0, TIMES[-1], 12)), TIMES[-1:]))
    return np.interp(TIMES, corners, rng.uniform(-40.0, 60.0, 14))


def scene(temperature_c: Array, day: float = 0.0, channel: Array | None = None) -> Scene:
    same = temperature_c
    return Scene(TIMES, TIMES - 1000.0, same, same, same, channel, day)


@pytest.mark.parametrize("cause", INTERFACE)
def test_ids_families_and_parameters_are_those_of_the_interface(cause: str) -> None:
    term = CATALOGUE[cause]
    family, parameters = INTERFACE[cause]
    assert (term.id, term.family) == (cause, family)
    assert set(parameters) <= {parameter.name for parameter in term.parameters}


@pytest.mark.parametrize("cause", CATALOGUE)
def test_every_cause_has_its_module_and_something_to_simulate(cause: str) -> None:
    term = CATALOGUE[cause]
    assert (Path(__file__).parents[3] / "gen" / "gyrotc" / "causes" / f"{cause}.py").exists()
    assert term.cavity or term.bias or term.record
    assert term.equation and term.source
    assert all(p.low < p.high for p in term.parameters)


def test_first_order_is_the_exact_answer_to_a_ramp() -> None:
    z = first_order(300.0, TIMES, 0.02 * TIMES)
    assert np.allclose(z, 0.02 * (TIMES - 300.0 * (1.0 - np.exp(-TIMES / 300.0))), atol=1e-10)


def test_first_order_does_not_mind_uneven_rows(wandering: Array) -> None:
    """Dropping rows in the middle of straight stretches changes nothing at the rows that stay."""
    corners = np.interp(TIMES, TIMES[::50], wandering[::50])
    keep = (np.arange(len(TIMES)) % 50 == 0) | (np.random.default_rng(1).random(len(TIMES)) < 0.5)
    keep[[0, -1]] = True
    inside = TIMES[::50][-1] >= TIMES
    whole = first_order(777.0, TIMES[inside], corners[inside])
    some = first_order(777.0, TIMES[inside & keep], corners[inside & keep])
    assert np.allclose(whole[keep[inside]], some, atol=1e-8)


def test_play_is_the_clamp_done_step_by_step(wandering: Array) -> None:
    for width in (0.0, 3.0, 25.0, 500.0):
        z, expected = wandering[0], []
        for temperature in wandering:
            z = max(temperature - width, min(temperature + width, z))
            expected.append(z)
        assert np.array_equal(play(width, wandering), expected)


def test_play_does_not_mind_the_rate_and_forgets_inner_loops() -> None:
    up_down = np.interp(np.arange(401.0), [0, 200, 400], [0.0, 50.0, 10.0])
    slowly = np.interp(np.arange(4001.0), [0, 2000, 4000], [0.0, 50.0, 10.0])
    assert np.allclose(play(6.0, up_down), play(6.0, slowly)[::10])
    loop = np.concatenate((up_down, np.linspace(10.0, 40.0, 100), np.linspace(40.0, 10.0, 100)))
    assert play(6.0, loop)[-1] == pytest.approx(play(6.0, up_down)[-1])


def test_a_delay_shifts_and_holds_the_ends() -> None:
    values = np.sin(TIMES / 500.0)
    assert np.allclose(delayed(200.0, TIMES, values)[20:], values[:-20])
    assert np.allclose(delayed(-200.0, TIMES, values)[:-20], values[20:])
    assert np.all(delayed(200.0, TIMES, values)[:20] == values[0])


def history(temperature_c: Array, **more: object) -> History:
    return History(TIMES, temperature_c, on_s=TIMES - 1000.0, **more)  # type: ignore[arg-type]


LINEAR = {
    "thermal_gradient": {"tau_s": 900.0, "amplitude_dph_per_c": 3e-5},
    "hysteresis": {"width_c": 5.0, "amplitude_dph_per_c": -4e-5},
    "warm_up": {"tau_s": 1500.0, "amplitude_dph": 2e-3},
    "path_length_periodicity": {"period_c": 11.0, "amplitude_dph": 3e-4, "phase_rad": 0.7},
}


@pytest.mark.parametrize("cause", LINEAR)
def test_columns_hold_what_the_simulation_adds_and_give_its_amplitudes_back(cause: str, wandering: Array) -> None:
    """Where the cavity is the sensor, the columns of a fit span the simulated effect exactly."""
    term, values = CATALOGUE[cause], LINEAR[cause]
    assert term.bias and term.features and term.amplitudes
    effect = term.bias(scene(wandering), values, np.random.default_rng(0))
    columns = term.features(history(wandering), values)
    weights, _, _, _ = np.linalg.lstsq(columns, effect, rcond=None)
    assert np.allclose(columns @ weights, effect, atol=1e-12)
    for name, value in term.amplitudes(weights).items():
        assert value == pytest.approx(values[name], rel=1e-6)


CURVE = {"slope_dph_per_unit": 0.01, "first_dph": 2e-3, "second_dph": -1e-3}
PRODUCT = {"slope_dph_per_unit": 0.01, "slope_dph_per_unit_per_c": -3e-4}
REFERENCES = {
    **LINEAR,
    "auxiliary": {"slope_dph_per_unit": 0.01, "reference": 28.0},
    "auxiliary_curve": CURVE | {"reference": 28.0, "second_center": 28.3, "width": 0.2},
    "auxiliary_product": PRODUCT | {"reference": 28.0, "reference_c": 15.0},
}


def course_of(temperature_c: Array) -> Course:
    """One correction for every row: the first starts, every other one closes a block of one sample."""
    number = np.arange(len(temperature_c))
    return Course(temperature_c, number > 0, number)


def outcome_of(cause: str, values: dict[str, float], temperature_c: Array, channel: Array) -> TermOutcome:
    table = CATALOGUE[cause].table
    assert table
    nothing = np.zeros_like(temperature_c)
    outcome = TermOutcome(temperature_c, nothing, nothing, np.zeros(len(nothing), dtype=np.int32))
    seen = CourseChannel(channel, np.zeros(len(nothing), dtype=np.int32), np.zeros(len(nothing), dtype=np.bool_))
    table.recursion(values, 10.0).apply(course_of(temperature_c), seen, outcome)
    return outcome


@pytest.mark.parametrize("cause", REFERENCES)
def test_the_recursion_of_the_target_follows_the_columns(cause: str, wandering: Array) -> None:
    """Short blocks: the recursion and the exact operator differ by what T moves in a block."""
    term, values = CATALOGUE[cause], REFERENCES[cause]
    channel = 28.0 + 0.01 * wandering
    assert term.bias
    effect = term.bias(scene(wandering, channel=channel), values, np.random.default_rng(0))
    added = outcome_of(cause, values, wandering, channel).added
    if term.needs.power_on:  # its clock starts at power-on, 1000 s after the first row
        late = 100
        assert np.allclose(added[: len(TIMES) - late], effect[late:], rtol=0.01)
        return
    fastest = float(np.abs(np.diff(wandering)).max())
    scale = abs(values.get("amplitude_dph_per_c", 0.0))
    assert np.allclose(added, effect, atol=scale * fastest + 1e-12)


def test_a_cavity_lag_gives_the_map_the_filtered_temperature(wandering: Array) -> None:
    term = CATALOGUE["cavity_lag"]
    assert term.cavity and term.features
    values = {"tau_s": 600.0}
    cavity = term.cavity(scene(wandering), values)
    columns = term.features(history(wandering), values)
    assert np.allclose(columns[:, 0], cavity)
    inner = slice(5, -5)
    slope = 60.0 * np.gradient(cavity, TIMES)
    in_a_row = 60.0 * np.abs(np.diff(wandering)).max() / 600.0  # how much the slope can change from row to row
    assert np.abs(columns[inner, 1] - slope[inner]).max() < in_a_row
    outcome = outcome_of("cavity_lag", values, wandering, wandering)
    fastest = float(np.abs(np.diff(wandering)).max())
    assert np.abs(outcome.temperature - cavity).max() < fastest
    assert not outcome.added.any(), "it changes what the map sees and adds nothing"


def test_a_sensor_lag_is_absorbed_by_a_static_map() -> None:
    """f(T) = f(T_s + tau dT_s/dt): nothing is left to find. The control must stay one."""
    bias_map = draw_map(np.random.default_rng(4), (5.8e-3, 8.5e-3))
    fine = np.arange(0.0, 20000.0)
    true_c = first_order(900.0, fine, np.interp(fine, [0, 3000, 4200, 9000, 11000], [0.0, 0.0, 60.0, 60.0, -40.0]))
    tau = 300.0
    sensed = first_order(tau, fine, true_c)
    recovered = sensed + tau * np.gradient(sensed, fine)
    level = np.zeros_like(fine)
    assert np.abs(bias_map(recovered, level) - bias_map(true_c, level))[2:-2].max() < 1e-6


def test_misalignment_with_a_positive_shift_is_a_record_that_comes_late(wandering: Array) -> None:
    term = CATALOGUE["time_misalignment"]
    assert term.record and term.features and term.mended
    late = term.record(scene(wandering), {"shift_s": 200.0})
    assert np.allclose(late[20:], wandering[:-20])
    columns = term.features(history(late), {"shift_s": 200.0})
    assert np.allclose(columns[:-20, 0], wandering[:-20])
    mended, _ = term.mended(TIMES, late, columns[:, 1], {"shift_s": 200.0})
    assert np.isfinite(mended).sum() == len(TIMES) - 20


def test_turn_on_draws_once_for_each_run_with_the_declared_spread(wandering: Array) -> None:
    bias = CATALOGUE["turn_on_offset"].bias
    assert bias
    drawn = [bias(scene(wandering), {"std_dph": 1e-3}, np.random.default_rng(s)) for s in range(400)]
    assert all(np.ptp(values) == 0.0 for values in drawn)
    assert np.std([values[0] for values in drawn]) == pytest.approx(1e-3, rel=0.2)


def test_ageing_is_a_line_or_the_same_for_every_log_unit(wandering: Array) -> None:
    bias = CATALOGUE["ageing"].bias
    assert bias
    rng = np.random.default_rng(0)
    straight = {"slope_dph_per_day": 1e-5, "d0_day": math.inf}
    assert bias(scene(wandering, day=30.0), straight, rng)[0] == pytest.approx(3e-4)
    fading = {"slope_dph_per_day": 1e-4, "d0_day": 0.1}
    at = [bias(scene(wandering, day=day), fading, rng)[0] for day in (10.0, 100.0, 1000.0)]
    assert at[2] - at[1] == pytest.approx(at[1] - at[0], rel=0.01)


def test_earth_rate_is_five_hundred_thousandths_for_each_arcsec_at_45_degrees(wandering: Array) -> None:
    bias = CATALOGUE["earth_rate_tilt"].bias
    assert bias
    values = {"latitude_deg": 45.0, "twist_arcsec_per_c": 1.0, "tilt_arcsec_per_c": 0.0, "tau_s": 0.0}
    warm = bias(scene(np.full_like(wandering, 21.0)), values, np.random.default_rng(0))
    assert warm[0] == pytest.approx(5.16e-5, rel=0.01)


def test_what_cannot_be_known_is_zero(wandering: Array) -> None:
    """Warm-up without the time of power-on, ageing without a date, play before it was driven through."""
    warm_up, ageing, hysteresis = (CATALOGUE[c].features for c in ("warm_up", "ageing", "hysteresis"))
    assert warm_up and ageing and hysteresis
    unknown = History(TIMES, wandering)
    assert not warm_up(unknown, {"tau_s": 500.0}).any()
    assert not ageing(unknown, {}).any()
    assert not hysteresis(History(TIMES, np.full_like(TIMES, 20.0)), {"width_c": 1.0}).any()


def test_an_auxiliary_term_without_its_channel_is_refused(wandering: Array) -> None:
    bias = CATALOGUE["auxiliary"].bias
    assert bias
    with pytest.raises(InputError, match="channel"):
        bias(scene(wandering), {"slope_dph_per_unit": 1.0, "reference": 0.0}, np.random.default_rng(0))
