"""Figures of merit against their definitions."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.common.metrics import average, median, middle_of_five, statistics, time_statistics
from gyrotc.results.evaluation import Pooled


def _averages(values: np.ndarray, period: float = 10.0, average_s: float = 100.0, **scored: np.ndarray):
    time = period * np.arange(values.size) + 5.0
    mask = scored.get("scored", np.ones(values.size, dtype=bool))
    return average(time, np.zeros_like(time), values, values, scored=mask, average_s=average_s)


def test_eight_hours_of_10_s_rows_are_288_means_of_100_s() -> None:
    values = np.arange(2880.0)
    a = _averages(values)
    assert a.after_dph.size == 288
    np.testing.assert_allclose(a.after_dph, values.reshape(288, 10).mean(axis=1))


def test_rounded_time_stamps_do_not_move_rows_between_bins() -> None:
    time = np.round(0.505 * np.arange(4000), 3)
    ones = np.ones_like(time)
    a = average(time, ones, ones, ones, scored=ones.astype(bool), average_s=10.1)
    assert a.after_dph.size == 200


def test_bins_less_than_half_full_are_left_out() -> None:
    scored = np.ones(100, dtype=bool)
    scored[20:26] = False  # bin 2 keeps 4 of 10
    scored[50:55] = False  # bin 5 keeps 5 of 10
    values = np.repeat(np.arange(10.0), 10)
    a = _averages(values, scored=scored)
    assert 2.0 not in a.after_dph
    assert 5.0 in a.after_dph


def test_pooled_figures_weigh_every_sample_alike() -> None:
    runs = [_averages(np.full(1000, 1.0)), _averages(np.full(3000, 3.0))]
    result = Pooled.of(runs)
    assert result.samples == 400
    assert result.after.rms_dph == pytest.approx(np.sqrt((100 * 1 + 300 * 9) / 400))
    assert result.improvement == pytest.approx(1.0)


def test_statistics_of_nothing_are_null() -> None:
    assert set(statistics(np.zeros(0)).values()) == {None}


def test_constant_residual_turns_by_its_rate_times_one_hour() -> None:
    a = _averages(np.full(2880, 2.0))
    figures = time_statistics(a, 100.0)
    assert figures["angle_1h_arcsec"] == pytest.approx(7200.0)
    assert figures["rms_30min_dph"] == pytest.approx(2.0)
    assert figures["first_10min_rms_dph"] == pytest.approx(2.0)
    assert time_statistics(_averages(np.ones(50)), 100.0)["angle_1h_arcsec"] is None


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 9, 10, 2880, 2881])
def test_medians_are_those_of_numpy_to_the_bit(n: int) -> None:
    rng = np.random.default_rng(n)
    for values in (rng.normal(size=n), np.round(rng.normal(size=n), 1), np.zeros(n)):
        before = values.copy()
        assert median(values) == np.median(before)
        np.testing.assert_array_equal(values, before)
        assert median(values, overwrite_input=True) == np.median(before)
    five = np.round(rng.normal(size=(5, n)), 1)
    np.testing.assert_array_equal(middle_of_five(*five), np.median(five, axis=0))
