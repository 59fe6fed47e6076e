"""Stage 1 of diagnosis: blocks, slopes, and what the screens find where something was planted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gyrotc.causes.base import History
from gyrotc.diagnose.blocks import (
    Record,
    Records,
    _bridged,
    _thinned,
    block_length,
    centred_slope,
    singled_out,
)
from gyrotc.diagnose.screens import cleaned, screen
from gyrotc.recordings.records import Rows
from small_campaign import small_records

SEED = 20260401


def with_noise(records: Records, seed: int = SEED) -> Records:
    print("seed", seed)
    rng = np.random.default_rng(seed)
    return Records(
        tuple(replace(r, rate_dph=1e-3 * rng.standard_normal(r.rate_dph.size)) for r in records.runs),
        records.block_s,
    )


@pytest.fixture(scope="module")
def records() -> Records:
    return with_noise(small_records())


def test_a_block_mean_is_the_mean_of_its_usable_rows(records: Records) -> None:
    rng = np.random.default_rng(1)
    masks = [rng.random(r.usable.size) > 0.2 for r in records.runs]
    left = Records(tuple(replace(r, usable=m) for r, m in zip(records.runs, masks, strict=True)), 100.0)
    expected = []
    for run, mask in zip(left.runs, masks, strict=True):
        number = (run.history.time_s // 100.0).astype(int)
        for k in np.unique(number):
            mine = mask & (number == k)
            if 2 * mine.sum() >= 5:
                expected.append(run.rate_dph[mine].mean())
    assert np.allclose(left.target(), expected, rtol=0, atol=1e-15)
    assert left.size == len(expected) == left.spans()[-1].stop


def test_the_slope_is_exact_on_a_line_and_without_delay_on_a_parabola() -> None:
    time = np.arange(0.0, 2000.0, 10.0)
    line = History(time_s=time, temperature_c=3.0 + time / 30.0)
    assert centred_slope(line) == pytest.approx(np.full(time.size, 2.0))
    bent = History(time_s=time, temperature_c=1e-4 * time**2)
    inside = (time > 150.0) & (time < 1850.0)
    assert centred_slope(bent)[inside] == pytest.approx(60.0 * 2e-4 * time[inside], rel=1e-9)


def test_single_blocks_are_columns_of_the_unit_matrix() -> None:
    where = np.array([False, True, False, True])
    assert np.array_equal(singled_out(where), np.eye(4)[:, where])


def test_planted_outliers_are_found_and_left_out(records: Records) -> None:
    rng = np.random.default_rng(2)
    planted = [rng.choice(r.rate_dph.size, 12, replace=False) for r in records.runs]
    runs = []
    for run, at in zip(records.runs, planted, strict=True):
        rate = run.rate_dph.copy()
        rate[at] += 0.05
        runs.append(replace(run, rate_dph=rate))
    dirty = Records(tuple(runs), records.block_s)
    found = screen(dirty)
    assert found.n_outliers >= 36 and found.findings[0][0] == "outliers"
    for mask, at in zip(found.masks, planted, strict=True):
        assert not mask[at].any()
    y, empty = cleaned(dirty, found)
    assert empty.size == 0
    assert np.abs(y - records.target()).max() < 3e-3, "5e-2 in one row of five would be 1e-2"


def test_normal_noise_has_no_finding(records: Records) -> None:
    found = screen(records)
    assert found.findings == () and found.sigma is None
    assert found.n_outliers <= 4.0 * found.expected_outliers + 4.0


@pytest.mark.parametrize("share", [0.2, 0.4, 0.55, 0.7, 0.8, 1.0, 1.3, 2.0])
def test_steps_of_a_converter_are_no_outliers_and_hide_none(records: Records, share: float) -> None:
    """A lattice's median is short of the noise by up to half a step: 40 rows of 10,000 were told as outliers."""
    step = share * 1e-3
    runs = []
    for run in records.runs:
        rate = np.round(np.round(run.rate_dph / step) * step, 8)  # as it is printed
        rate += 1e-9 * np.sin(np.arange(rate.size))  # and averaged
        rate[100:1000:100] += round(0.02 / step) * step
        runs.append(replace(run, rate_dph=rate))
    found = screen(Records(tuple(runs), records.block_s))
    for run, mask in zip(records.runs, found.masks, strict=True):
        assert not mask[100:1000:100].any()
        assert (~mask[run.usable]).sum() <= 9 + 2, "of 720 rows of normal noise hardly one is beyond"


def test_noise_that_grows_with_the_rate_becomes_weights(records: Records) -> None:
    runs = []
    for run in records.runs:
        factor = 1.0 + np.abs(centred_slope(run.history))
        runs.append(replace(run, rate_dph=run.rate_dph * factor))
    found = screen(Records(tuple(runs), records.block_s))
    assert "noise_variance" in [f[0] for f in found.findings]
    assert found.sigma is not None
    slope = np.abs(records.average([centred_slope(r.history) for r in records.runs]))
    ratio = np.median(found.sigma[slope > 1.5]) / np.median(found.sigma[slope < 0.1])
    assert ratio == pytest.approx(np.median(1.0 + slope[slope > 1.5]), rel=0.25)


def test_a_coarse_thermometer_is_told_with_its_step(records: Records) -> None:
    runs = [
        replace(r, history=replace(r.history, temperature_c=np.round(2.0 * r.history.temperature_c) / 2.0))
        for r in records.runs
    ]
    findings = {id: values for id, _, values in screen(Records(tuple(runs), records.block_s)).findings}
    assert findings["temperature_quantisation"]["step_c"] == pytest.approx(0.5)


def _record(hours: float) -> Record:
    time = np.arange(0.0, 3600.0 * hours, 10.0)
    usable = np.ones(time.size, dtype=bool)
    return Record("a", History(time_s=time, temperature_c=0.0 * time), 0.0 * time, usable)


@pytest.mark.parametrize(
    ("hours", "expected"),
    [
        (50.0, 100.0),  # as asked for
        (10.0, 40.0),  # 36000 s in 1000 blocks, to a whole number of rows
        (1.0, 10.0),  # not shorter than the model's own block
        (200.0, 140.0),  # 720000 s in 5000 blocks
    ],
)
def test_blocks_are_as_long_as_asked_unless_there_would_be_few_or_very_many(
    hours: float, expected: float
) -> None:
    assert block_length([_record(hours)], 10.0, 100.0) == expected


def test_gaps_are_bridged_by_lines_and_fine_rows_are_averaged() -> None:
    time = np.arange(6.0)
    assert _bridged(time, np.array([np.nan, 1.0, np.nan, 3.0, np.nan, 5.0])).tolist() == [1, 1, 2, 3, 4, 5]
    assert not _bridged(time, np.full(6, np.nan)).any()
    rows = Rows(time, np.arange(6.0), np.array([1.0, 3.0, 5.0, 100.0, 100.0, 7.0]), {})
    thin, usable = _thinned(rows, np.array([True, True, True, False, False, True]), 2)
    assert thin.rate_dph.tolist() == [2.0, 5.0, 7.0] and usable.tolist() == [True, True, True]
    assert not _thinned(rows, np.zeros(6, dtype=bool), 2)[1].any()
