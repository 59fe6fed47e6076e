"""What the front end makes of a recording; that it is the target's to the bit stands in test_reference."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gyrotc.mirror import F32, Guarded, Settings, expand_missed, missed_before, samples_per_block
from gyrotc.train import Blocks, run_blocks


def recording(temperature: np.ndarray, time_s: np.ndarray | None = None, *, from_s: float = 0.0) -> Any:
    """Rows and run of a recording with a row a second; the rate is 10 times the temperature."""
    time_s = np.arange(len(temperature), dtype=float) if time_s is None else time_s
    rows = SimpleNamespace(time_s=time_s, temperature_c=temperature, rate_dph=10.0 * temperature)
    return rows, SimpleNamespace(file="a.csv", row_period_s=1.0, in_span=lambda t: t >= from_s)


def blocks_of(temperature: np.ndarray, time_s: np.ndarray | None = None, **changes: Any) -> Blocks:
    from_s = changes.pop("from_s", 0.0)
    rows, run = recording(np.asarray(temperature, dtype=float), time_s, from_s=from_s)
    options = {"block_s": 4.0, "slope_blocks": 3, "max_step_c": 1.0, "max_rate_c_per_min": 60.0}
    usable = run.in_span(rows.time_s) & np.isfinite(rows.rate_dph)
    return run_blocks(rows, run, usable, **(options | changes))


def test_the_input_in_force_comes_from_the_blocks_before() -> None:
    blocks = blocks_of(20.0 + 0.25 * np.arange(20))
    np.testing.assert_array_equal(blocks.mean_c, 20.375 + np.arange(5.0))
    np.testing.assert_array_equal(blocks.temperature_c, [20.0, 20.375, 21.375, 22.375, 23.375])
    np.testing.assert_array_equal(blocks.slope_c, [0.0, 0.0, 0.0, 1.0, 1.0])
    np.testing.assert_array_equal(blocks.status, [1, 1, 1, 0, 0])
    np.testing.assert_array_equal(blocks.start_s, [0.0, 4.0, 8.0, 12.0, 16.0])
    np.testing.assert_allclose(blocks.rate_dph, 10.0 * blocks.mean_c)
    assert blocks.valid.all()


def test_rows_outside_the_span_feed_the_front_end_and_are_not_averaged() -> None:
    blocks = blocks_of(20.0 + 0.25 * np.arange(20), from_s=6.0)
    assert blocks.rows.tolist() == [0, 2, 4, 4, 4]
    assert np.isnan(blocks.rate_dph[0])
    assert blocks.rate_dph[1] == pytest.approx(10.0 * (20.0 + 0.25 * 6.5))
    assert blocks.temperature_c[0] == 20.0


def test_before_the_first_believed_sample_there_is_no_input() -> None:
    blocks = blocks_of([np.nan] * 6 + [20.0] * 10)
    assert np.isnan(blocks.temperature_c[0])
    assert blocks.status.tolist() == [8, 1, 1, 1]
    assert blocks.valid.tolist() == [False, True, True, True]


def test_a_missing_block_is_held_and_after_too_many_the_front_end_falls_back_and_restarts() -> None:
    temperature = np.full(60, 20.0)
    temperature[20:44] = np.nan
    blocks = blocks_of(temperature, hold_blocks=2)
    assert blocks.status.tolist() == [1, 1, 1, 0, 0, 0, 8, 8, 24, 24, 24, 1, 1, 1, 0]
    assert blocks.temperature_c[8] == 20.0
    assert not blocks.valid[5:11].any()


def test_a_gap_in_time_is_missing_samples() -> None:
    time_s = np.array([0.0, 1.0, 2.0, 3.4, 7.0, 8.2, 11.0, 12.0])
    assert missed_before(time_s, 1.0).tolist() == [0, 0, 0, 0, 3, 0, 2, 0]
    blocks = blocks_of(np.full(8, 20.0), time_s)
    assert blocks.valid.tolist() == [True, False, True, False]
    assert blocks.rows.tolist() == [4, 1, 2, 1]


def test_uneven_stamps_are_no_missing_samples() -> None:
    """The slope of a ramp stays what it is if the logger stamps the rows late, by up to most of a period."""
    temperature = 20.0 + np.arange(4000) / 1000.0
    even = blocks_of(temperature)
    uneven = blocks_of(temperature, np.arange(4000) + np.random.default_rng(1).uniform(0.0, 0.8, 4000))
    np.testing.assert_array_equal(uneven.slope_c, even.slope_c)
    np.testing.assert_array_equal(uneven.rows, even.rows)


def test_a_long_gap_is_shortened_by_whole_blocks() -> None:
    guard = Guarded(-90.0, 200.0, np.float32(1.0), np.float32(1.0), 0, 0, 5)
    settings = Settings(4, 1, 4, 3, guard, 5)
    assert expand_missed(np.array([0, 3, 31, 32, 35, 10**9 + 3]), settings).tolist() == [0, 3, 31, 28, 31, 31]


def test_a_year_without_rows_costs_no_memory() -> None:
    blocks = blocks_of([20.0, 20.0, 20.0, 20.0, 20.0], np.array([0.0, 1.0, 2.0, 3.0, 3e7]), hold_blocks=2)
    assert len(blocks.valid) < 12


def test_rows_per_block_are_rounded_and_at_least_one() -> None:
    assert [samples_per_block(10.0, p) for p in (1.0, 0.3, 10.0, 60.0)] == [10, 33, 1, 1]


def test_an_empty_recording_has_no_blocks() -> None:
    blocks = blocks_of([])
    assert blocks.valid.size == blocks.rows.size == blocks.start_s.size == blocks.temperature_c.size == 0


@pytest.mark.parametrize("n", [1, 7, 1000])
def test_sums_are_added_from_left_to_right(n: int) -> None:
    d = np.random.default_rng(n).normal(0.0, 1.0, (5, n)).astype(np.float32)
    want = np.zeros(5, dtype=np.float32)
    for column in d.T:
        want = want + column
    np.testing.assert_array_equal(F32.running_sum(d), want)
