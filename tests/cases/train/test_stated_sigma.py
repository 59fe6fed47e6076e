"""The sigma that a table states, against the errors of simulated gyros whose true bias is known.

Neither half nor double is accepted, for every training method, with offsets between runs, with a lot, and for what is
added when a channel or the state of a term is lost. The truth is the simulated bias; numpy does the rest.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from gyrotc.jobs import lot_from
from gyrotc.model import Model
from gyrotc.recordings import METHODS, load
from gyrotc.simulate import simulate
from gyrotc.tables import quantise
from gyrotc.train import (
    Fit,
    FitOptions,
    TrainingData,
    fallback_model_of,
    fit,
    fit_dataset,
    predict,
    rezero_dph,
    start_sigma,
    uncertainty_of,
)
from gyrotc.train.prior import Learned, LotPrior, UnitMeans, learn_prior, prior_of
from libc_build import runtime
from numpy.typing import NDArray
from scipy import stats
from training_data import samples, true_bias

Floats = NDArray[np.float64]
CELLS = (6, 4)
GYROS = 5
FACTOR = 2.0
"""A stated sigma may be smaller or larger than the error by less than this."""


def gyro(seed: int, between_dph: float) -> TrainingData:
    """Six runs of four hours; each has an offset of its own."""
    rng = np.random.default_rng(seed)
    halves = [samples(10 * seed + k) for k in range(2)]
    offset = rng.normal(0.0, between_dph, (2, 3))
    halves = [
        replace(half, run=half.run + 3 * k, bias_dph=half.bias_dph + offset[k][half.run])
        for k, half in enumerate(halves)
    ]
    names = TrainingData.__dataclass_fields__
    return TrainingData(*(np.concatenate([getattr(half, name) for half in halves]) for name in names))


def stated_at(data: TrainingData, known: dict[str, Any], found: Fit) -> Floats:
    """The table's sigma at every sample: that of its cell of the envelope, by the formula of docs/numerics.md."""
    columns, rows = known["cells"]
    at = []
    for x, (low, high), n in (
        (data.temperature_c, found.scaling.temperature_c, columns),
        (data.slope_c_per_min, found.scaling.slope_c_per_min, rows),
    ):
        at.append(np.clip(np.floor((x - low) / (high - low) * n), 0, n - 1).astype(int))
    return np.asarray(np.array(known["rows"])[at[1], at[0]])


def error_over_sigma(data: TrainingData, found: Fit, between_dph: float) -> float:
    """Mean square error in the next run over the mean variance that is stated for it."""
    sigma = stated_at(data, uncertainty_of(data, found, CELLS), found)
    error = predict(found, data.temperature_c, data.slope_c_per_min)
    error -= true_bias(data.temperature_c, data.slope_c_per_min)
    return float((np.mean(error**2) + between_dph**2) / np.mean(sigma**2))


@pytest.mark.parametrize("method", METHODS)
def test_each_method_states_the_error_that_it_makes(method: str) -> None:
    """A map that cannot follow the bias, such as a constant, has an error far above its noise and must say so."""
    gyros = [gyro(seed, 0.0) for seed in range(GYROS)]
    ratios = [error_over_sigma(data, fit(data, method=method), 0.0) for data in gyros]
    assert 1.0 / FACTOR < np.sqrt(np.mean(ratios)) < FACTOR, ratios


def shares_of_the_map(data: TrainingData, found: Fit) -> tuple[float, float]:
    """Shares of samples of moving runs whose error about the mean of their run is within one and two sigma."""
    known = uncertainty_of(data, found, (8, 5))
    sigma = np.sqrt(stated_at(data, known, found) ** 2 - known["rules"]["between_dph"] ** 2)
    error = predict(found, data.temperature_c, data.slope_c_per_min)
    error -= true_bias(data.temperature_c, data.slope_c_per_min)
    within = []
    for run in np.unique(data.run):
        own = data.run == run
        if np.ptp(data.temperature_c[own]) > 1.0:
            within.append(np.abs(error[own] - error[own].mean()) / sigma[own])
    ratio = np.concatenate(within)
    return float(np.mean(ratio < 1.0)), float(np.mean(ratio < 2.0))


@pytest.mark.parametrize("between_dph", [0.0, 6e-4])
@pytest.mark.parametrize("method", METHODS)
def test_the_part_of_the_map_holds_its_error_about_the_mean_of_a_run(method: str, between_dph: float) -> None:
    """Two in three within one sigma, nineteen in twenty within two; five gyros tell that to a tenth."""
    gyros = [gyro(seed, between_dph) for seed in range(GYROS)]
    one, two = np.mean([shares_of_the_map(data, fit(data, method=method)) for data in gyros], axis=0)
    assert 0.5 < one < 0.9 and two > 0.88, (one, two)


def test_the_repeatability_of_a_single_power_on_is_not_known_and_adds_nothing() -> None:
    data = gyro(3, 6e-4)
    one = data.select(data.run == 1)
    rules = uncertainty_of(one, fit(one), CELLS)["rules"]
    assert rules["turn_on_dph"] is None and rules["turn_on_freedom"] == 0
    assert rezero_dph(rules) == 0.0


@pytest.mark.parametrize(("power_on", "freedom"), [(None, 5), (np.array([0, 0, 1, 1, 2, 2]), 2)])
def test_repeatability_has_one_degree_of_freedom_less_than_there_are_power_ons(
    power_on: NDArray[np.int64] | None, freedom: int
) -> None:
    data = gyro(3, 6e-4)
    rules = uncertainty_of(data, fit(data, method="auto", power_on=power_on), CELLS)["rules"]
    assert rules["turn_on_freedom"] == freedom


@pytest.mark.parametrize(
    ("power_on", "freedom"), [(None, 5), (np.array([0, 0, 1, 1, 2, 3]), 3), (np.array([0, 0, 0, 1, 1, 1]), 3)]
)
def test_the_constant_of_the_next_power_on_has_the_quantile_of_student_s_t(
    power_on: NDArray[np.int64] | None, freedom: int
) -> None:
    """68 % of power-ons; with fewer than three degrees of freedom, which are of no use in the field, as with three."""
    data = gyro(3, 6e-4)
    rules = uncertainty_of(data, fit(data, method="linear", power_on=power_on), CELLS)["rules"]
    quantile = stats.t.ppf(stats.norm.cdf(1.0), freedom)
    assert rules["between_dph"] == pytest.approx(quantile * rules["turn_on_dph"], rel=1e-3)


def test_beyond_the_envelope_sigma_grows_with_the_gradient_of_the_map() -> None:
    """That of a plane is the same everywhere."""
    data = gyro(3, 0.0)
    found = fit(data, method="linear")
    known = uncertainty_of(data, found, CELLS)["rules"]
    at, step = (np.array([20.0]), np.array([0.5])), (10.0, 0.5)
    by_t, by_r = (
        predict(found, at[0] + dt, at[1] + dr) - predict(found, *at) for dt, dr in ((step[0], 0.0), (0.0, step[1]))
    )
    assert known["beyond_dph_per_c"] == pytest.approx(abs(by_t[0]) / step[0], rel=1e-3)
    assert known["beyond_dph_per_c_per_min"] == pytest.approx(abs(by_r[0]) / step[1], rel=1e-3)


@pytest.mark.parametrize("method", ["constant", "cubic_slope", "mrbf"])
def test_an_offset_of_each_run_is_in_what_is_stated_for_the_next_one(method: str) -> None:
    between = 6e-4
    gyros = [gyro(50 + seed, between) for seed in range(2 * GYROS)]
    ratios = [error_over_sigma(data, fit(data, method=method), between) for data in gyros]
    assert 1.0 / FACTOR < np.sqrt(np.mean(ratios)) < FACTOR, ratios


@pytest.mark.parametrize("offset_dph", [0.0, 6e-4])
def test_the_rule_of_the_scatter_between_runs_is_its_true_size(offset_dph: float) -> None:
    """What a field re-zero and a budget take from the table; six runs tell it to a third."""
    found = [
        uncertainty_of(data, fit(data), CELLS)["rules"]["turn_on_dph"]
        for data in (gyro(80 + seed, offset_dph) for seed in range(2 * GYROS))
    ]
    low, high = (offset_dph / FACTOR, FACTOR * offset_dph) if offset_dph else (0.0, 2e-4)
    assert low <= np.sqrt(np.mean(np.square(found))) <= high, found


@pytest.mark.parametrize("method", ["constant", "cubic", "mrbf"])
def test_without_a_map_the_sigma_is_what_the_bias_itself_does(method: str) -> None:
    """With the mean alone the error is the bias about it; with no correction at all it is the bias."""
    data = gyro(120, 0.0)
    truth = true_bias(data.temperature_c, data.slope_c_per_min)
    rules = uncertainty_of(data, fit(data, method=method), CELLS)["rules"]
    assert rules["none_dph"] == pytest.approx(np.sqrt(np.mean(truth**2)), rel=0.1)
    assert rules["fallback_dph"] == pytest.approx(np.std(truth), rel=0.1)


ENVELOPE = ((-40.0, 60.0), (-4.2, 4.2))


@cache
def learnt_units() -> tuple[list[UnitMeans], Learned]:
    """Sixteen units with the bias of `true_bias` and an offset of their own, calibrated all over the envelope."""
    rng = np.random.default_rng(4)
    units = []
    for _ in range(16):
        t, r = rng.uniform(*ENVELOPE[0], 300), rng.uniform(*ENVELOPE[1], 300)
        bias = true_bias(t, r) + 2e-4 * rng.normal() + 7e-4 * rng.normal(size=300)
        units.append(UnitMeans(t, r, bias, np.ones(300), 7e-4))
    return units, learn_prior(units, ENVELOPE, lambda *_: None)


def lot(between_dph: float) -> LotPrior:
    units, learnt = learnt_units()
    names = [(f"U{k}", "0" * 64) for k in range(len(units))]
    return prior_of(lot_from(names, units, learnt, ENVELOPE, between_dph=between_dph))


@pytest.mark.parametrize("between_dph", [0.0, 5e-4])
def test_with_a_lot_the_scatter_between_runs_of_its_units_is_stated(between_dph: float) -> None:
    """One run of a unit does not show how much the next one differs; its lot knows."""
    prior = lot(between_dph)
    ratios = []
    for seed in range(GYROS):
        rng = np.random.default_rng(seed)
        own, runs = 2e-4 * rng.normal(), samples(seed)
        one = runs.select(runs.run == 1)
        one = replace(one, bias_dph=one.bias_dph + own)
        found = fit(one, prior=prior)
        assert found.lot is not None and found.lot.accepted
        sigma = stated_at(one, uncertainty_of(one, found, CELLS), found)
        error = predict(found, one.temperature_c, one.slope_c_per_min)
        error -= true_bias(one.temperature_c, one.slope_c_per_min) + own
        ratios.append((np.mean(error**2) + between_dph**2) / np.mean(sigma**2))
    assert 1.0 / FACTOR < np.sqrt(np.mean(ratios)) < FACTOR, ratios


def test_a_lost_channel_may_be_off_by_what_it_differed_in_training() -> None:
    rng = np.random.default_rng(6)
    volts = 12.0 + rng.normal(0.3, 0.5, 5000)
    parameters = {"slope_dph_per_unit": -2e-3, "reference": 12.0}
    stated = start_sigma("auxiliary", parameters, {}, samples(0), channel=[volts[:900], volts[900:]])
    assert stated == pytest.approx(2e-3 * np.sqrt(np.mean((volts - 12.0) ** 2)))


def test_rules_have_the_unit_of_the_rate_and_no_other_size() -> None:
    """A rate a thousand times larger has rules a thousand times larger; times and counts stay."""
    data = gyro(3, 6e-4)
    small, large = (
        uncertainty_of(one, fit(one, method="linear"), CELLS)["rules"]
        for one in (data, replace(data, bias_dph=1e3 * data.bias_dph))
    )
    for name, value in small.items():
        if name != "terms" and value is not None:
            factor = 1e3 if "dph" in name or "deg" in name else 1.0
            assert large[name] == pytest.approx(factor * value, rel=0.02), name
    assert small["correlation_s"] > 10.0


def test_where_the_temperature_stands_still_nothing_is_held_and_every_rule_is_a_number() -> None:
    """Though terms make the correction change."""
    data = gyro(3, 6e-4)
    still = replace(data, slope_c_per_min=np.zeros(len(data)))
    rules = uncertainty_of(still, fit(still, method="linear"), CELLS, added=1e-3 * np.sin(still.time_s / 600.0))[
        "rules"
    ]
    assert rules["hold_dph_per_c"] == rules["slope_dph_per_c_per_min"] == 0.0
    assert all(np.isfinite(value) for name, value in rules.items() if name != "terms" and value is not None)


def test_an_error_that_lasts_from_power_on_to_power_on_is_correlated_longer() -> None:
    """The error of the map is forgotten with the way over temperature; that of the constant is not."""
    even, scattered = (
        uncertainty_of(data, fit(data, method="linear"), CELLS)["rules"]["correlation_s"]
        for data in (gyro(3, 0.0), gyro(3, 6e-4))
    )
    assert scattered > 2.0 * even > 0.0


@pytest.mark.parametrize("runs", [4, 6])
def test_what_stands_for_a_lost_channel_states_the_error_of_the_next_run(runs: int, model_dict: dict[str, Any]) -> None:
    """Spread within runs, and of the mean of a run more: Student's t about the mean of few, by pandas and scipy."""
    model, data, rng = Model.from_dict(model_dict), gyro(7, 0.0), np.random.default_rng(7)
    data = data.select(data.run < runs)
    data = replace(data, bias_dph=model.map_dph(data.temperature_c, data.slope_c_per_min))
    effect = rng.normal(0.0, 2e-3, runs)[data.run] + rng.normal(0.0, 1e-3, len(data))
    found = fallback_model_of(model, data, effect)
    assert found is not None
    left = pd.DataFrame({"run": data.run, "left": effect - found.added}).groupby("run")["left"]
    between = left.mean().var(ddof=1) * (1.0 + 1.0 / runs) * stats.t(runs - 1).var()
    within = np.average(left.var(ddof=0), weights=left.count())
    assert found.sigma_dph == pytest.approx(np.sqrt(within + between))


def lagged(x: Floats, step_s: float, tau_s: float, start: float) -> Floats:
    """First-order lag of a temperature, from a state on."""
    state, followed = start, []
    for value in x:
        state += (1.0 - np.exp(-step_s / tau_s)) * (value - state)
        followed.append(state)
    return np.array(followed)


def test_a_memory_may_begin_as_far_from_the_temperature_as_it_was_in_training() -> None:
    data, tau_s, amplitude = samples(2), 1200.0, 3e-3
    away = []
    for run in range(3):
        t = data.temperature_c[data.run == run]
        away.append(lagged(t, 10.0, tau_s, t[0]) - t)
    expected = amplitude * np.sqrt(np.mean(np.concatenate(away) ** 2))
    parameters = {"tau_s": tau_s, "amplitude_dph_per_c": amplitude}
    stated = start_sigma("thermal_gradient", parameters, {}, data)
    assert stated == pytest.approx(expected, rel=1e-6)


def test_sigma_of_a_held_correction_covers_a_turn_to_any_trained_slope(tmp_path: Path) -> None:
    """The sensor is lost at rest, then the temperature moves at -2 to 2 C/min: RMS of the error over sigma is near 1.

    Truth is the map at the temperature that is not read; to its change the error of before is added as stated.
    """
    build, squares = runtime(), []
    for seed in (1, 2, 3):
        data = tmp_path / f"gyro-{seed}"
        simulate("paper", seed=seed, out=data)
        model = fit_dataset(load(data), FitOptions()).model
        table = quantise(model, "f32")
        low, high = model.envelope.temperature_c
        rng = np.random.default_rng(seed)
        for rate in (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0):
            for start in rng.uniform(low + 15.0, high - 15.0, 6):
                rest = start + 0.01 * rng.normal(size=400)
                readings = np.concatenate([rest, np.full(290, np.nan)])[:, None]
                lost = build.snapshots(table, table.encode_inputs(readings), np.zeros(690, dtype=np.uint32), 10)[1]
                sigma = table.decode_bias(lost[:, 1])
                for second in (15, 100, 200, 289):
                    change = model.map_dph(start + rate * second / 60.0, rate) - model.map_dph(start, 0.0)
                    squares.append((float(change) ** 2 + sigma[399] ** 2) / sigma[400 + second] ** 2)
    assert 0.8 < np.sqrt(np.mean(squares)) < 1.2


def test_terms_count_for_the_uncertainty_though_samples_are_there_twice_and_in_any_order() -> None:
    """What terms add was taken as 0 for all samples if one of them was a duplicate."""
    data = samples(3, hours=2.0)
    added = 0.05 * np.sin(data.time_s / 600.0)
    twice = np.random.default_rng(3).permutation(np.concatenate([np.arange(len(data)), np.arange(5, 9)]))
    model = fit(data, method="linear")
    once = uncertainty_of(data, model, added=added)
    assert uncertainty_of(data.select(twice), model, added=added[twice]) == once
    assert once["rules"]["none_dph"] > uncertainty_of(data, model)["rules"]["none_dph"]
