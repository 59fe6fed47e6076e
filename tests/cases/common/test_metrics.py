"""Figures of merit against their definitions, orthonormal columns, quantiles."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.common import (
    CHI2_95_ONE,
    CHI2_95_TWO,
    MAD_TO_SIGMA,
    NORMAL_95,
    TOLERANCE,
    average_rows,
    main_directions,
    median,
    metrics,
    middle_of_five,
    orthonormal,
    statistics_of,
    time_statistics,
)
from gyrotc.results import Pooled
from scipy import stats
from scipy.linalg import subspace_angles


def _averages(values: np.ndarray, period: float = 10.0, average_s: float = 100.0, **scored: np.ndarray):
    time = period * np.arange(values.size) + 5.0
    mask = scored.get("scored", np.ones(values.size, dtype=bool))
    return average_rows(time, np.zeros_like(time), values, values, scored=mask, average_s=average_s)


def test_eight_hours_of_10_s_rows_are_288_means_of_100_s() -> None:
    values = np.arange(2880.0)
    a = _averages(values)
    assert a.after_dph.size == 288
    np.testing.assert_allclose(a.after_dph, values.reshape(288, 10).mean(axis=1))


def test_rounded_time_stamps_do_not_move_rows_between_bins() -> None:
    time = np.round(0.505 * np.arange(4000), 3)
    ones = np.ones_like(time)
    a = average_rows(time, ones, ones, ones, scored=ones.astype(bool), average_s=10.1)
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
    assert result.improvement_about_zero == pytest.approx(1.0)
    assert result.improvement == pytest.approx(np.sqrt(0.75 / 7.0)), "RMS about the mean of 2.5 over RMS"
    assert Pooled.of(runs, 2.0).improvement == pytest.approx(np.sqrt(1.0 / 7.0))


def test_statistics_of_nothing_are_null() -> None:
    assert set(statistics_of(np.zeros(0)).values()) == {None}


def test_constant_residual_turns_by_its_rate_times_one_hour() -> None:
    a = _averages(np.full(2880, 2.0))
    figures = time_statistics(a, 100.0)
    assert figures["angle_1h_arcsec"] == pytest.approx(7200.0)
    assert figures["rms_30min_dph"] == pytest.approx(2.0)
    assert figures["first_10min_rms_dph"] == pytest.approx(2.0)
    assert time_statistics(_averages(np.ones(50)), 100.0)["angle_1h_arcsec"] is None


@pytest.mark.parametrize("row_s", [10.0, 60.0, 70.0, 95.0, 150.0])
def test_a_half_hour_counts_if_nine_tenths_of_its_rows_do(row_s: float) -> None:
    """A third of the rows of the second half-hour is missing, and the rate of the others is another."""
    row = np.arange(round(4 * 1800 / row_s))
    second = (row * row_s >= 1800.0) & (row * row_s < 3600.0)
    third = (row * row_s >= 2400.0) & (row * row_s < 3000.0)
    a = _averages(np.where(second, 100.0, 2.0), row_s, scored=~third)
    assert time_statistics(a, 100.0)["rms_30min_dph"] == pytest.approx(2.0)


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


RNG = np.random.default_rng(11)


def test_independent_columns_are_made_orthogonal_in_their_order() -> None:
    x = RNG.standard_normal((40, 6)) * np.geomspace(1e-6, 1e6, 6)
    q = orthonormal(x[:, :2], x[:, 2:])
    expected = np.linalg.qr(x)[0]
    assert np.abs(q - expected).max() < 1e-12, "the size of a column says nothing about its direction"
    for count in range(1, 7):
        assert subspace_angles(q[:, :count], x[:, :count]).max() < 1e-7


def test_a_dependent_column_takes_nothing_away_from_those_after_it() -> None:
    """Of a plain factorisation the second direction is e2 by chance; dropped, the third column would be lost."""
    e1, e2 = np.eye(5)[:, 0], np.eye(5)[:, 1]
    q = orthonormal(np.column_stack([e1, e1, e2]))
    assert q.shape == (5, 2)
    assert np.abs(q @ (q.T @ e2) - e2).max() < 1e-15


@pytest.mark.parametrize("own", [0.1, 10.0])
def test_the_tolerance_is_what_a_column_has_of_its_own(own: float) -> None:
    e1, e2 = np.eye(5)[:, 0], np.eye(5)[:, 1]
    for size in (1e-9, 1.0, 1e9):
        q = orthonormal(np.column_stack([e1, size * (e1 + own * TOLERANCE * e2)]))
        assert q.shape[1] == (2 if own > 1.0 else 1)


def test_more_columns_than_rows_zeros_and_nothing() -> None:
    x = RNG.standard_normal((4, 9))
    assert np.abs(orthonormal(x) @ orthonormal(x).T - np.eye(4)).max() < 1e-12
    assert orthonormal(np.zeros((4, 2))).shape == (4, 0)
    assert orthonormal(np.zeros((4, 0))).shape == (4, 0)
    assert orthonormal(np.zeros((4, 1)), np.eye(4)[:, :1]).shape == (4, 1)


def test_main_directions_are_those_of_the_strongest_mixtures() -> None:
    left = np.linalg.qr(RNG.standard_normal((30, 3)))[0]
    right = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    columns = left @ np.diag([1.0, 0.2, 0.01]) @ right
    assert subspace_angles(main_directions(columns, 0.05), left[:, :2]).max() < 1e-7
    assert main_directions(columns, 0.5).shape[1] == 1
    assert main_directions(np.zeros((30, 0)), 0.05).shape == (30, 0)


def test_quantiles_are_those_of_their_distributions() -> None:
    assert stats.chi2.cdf([CHI2_95_ONE], 1) == pytest.approx(0.95)
    assert stats.chi2.cdf([CHI2_95_TWO], 2) == pytest.approx(0.95)
    assert stats.norm.cdf(NORMAL_95) - stats.norm.cdf(-NORMAL_95) == pytest.approx(0.95)
    assert pytest.approx(NORMAL_95**2) == CHI2_95_ONE
    normal = 3.0 * stats.norm.ppf((np.arange(100001) + 0.5) / 100001)
    assert MAD_TO_SIGMA * np.median(np.abs(normal)) == pytest.approx(3.0, rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("together", [10, 2**18])
def test_the_median_of_parts_is_that_of_the_whole(seed: int, together: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of numbers that hardly differ, of coarse and negative ones, of an even number, and by digits of their bits."""
    rng = np.random.default_rng(seed)
    size = 3001 + seed
    kinds = (
        rng.exponential(size=size),
        np.abs(np.round(rng.normal(size=size))),
        np.abs(np.diff(np.arange(size + 1) / 290.0)),
        rng.normal(size=size),
        np.round(rng.normal(-40.0, 3.0, size)),
        -5.0 - 1e-9 * rng.random(size),
        np.full(size, -2.5),
    )
    monkeypatch.setattr(metrics, "_TOGETHER", together)
    for values in kinds:

        def parts(values: np.ndarray = values) -> list[np.ndarray]:
            return np.array_split(values, 7)

        assert metrics.median_of_parts(parts) == np.median(values)
        assert metrics.quantile_of_parts(parts, 0.9) == np.quantile(values, 0.9)


def test_means_of_rows_that_come_in_parts_are_those_of_the_whole() -> None:
    rng = np.random.default_rng(5)
    time = np.cumsum(rng.uniform(0.9, 1.1, 5000))
    columns = [time, rng.normal(size=5000), np.where(rng.random(5000) < 0.01, np.nan, rng.normal(size=5000))]
    scored = rng.random(5000) < 0.9
    whole = average_rows(*columns, columns[2], scored=scored, average_s=37.0)
    made = metrics.Averager(time, 37.0)
    for part in np.array_split(np.arange(5000), 13):
        made.add(*(c[part] for c in columns), columns[2][part], scored[part])
    for name in ("time_s", "temperature_c", "before_dph", "after_dph"):
        assert np.array_equal(getattr(made.averages(), name), getattr(whole, name)), name
