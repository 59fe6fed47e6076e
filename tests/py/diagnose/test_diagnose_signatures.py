"""Stage 3 of diagnosis: the static map, signatures, changed inputs, alternatives and the bank that holds them."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from gyrotc.causes.base import History
from gyrotc.diagnose.blocks import Records, centred_slope
from gyrotc.diagnose.candidates import (
    Candidate,
    _switch,
    _two_sided_lag,
    columns_of,
    diagnosed,
    reach_of,
    searched,
    shapes_of,
)
from gyrotc.diagnose.candidates import testable as reason_against
from gyrotc.diagnose.noise import COLOURS, Whitener
from gyrotc.diagnose.signature_bank import direction_of
from gyrotc.diagnose.static_map import LEVELS, fine_columns, make_basis, proportional_map, replaced_map
from gyrotc.target.recursions import first_order
from small_campaign import Campaign, small_campaign


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return small_campaign()


def test_the_map_is_orthonormal_over_blocks_and_holds_what_a_finer_one_starts_from(
    campaign: Campaign,
) -> None:
    for level in range(2):
        basis, means = make_basis(campaign.records, level)
        assert np.abs(means.T @ means - np.eye(means.shape[1])).max() < 1e-9
        rows = [basis(r.history.temperature_c, centred_slope(r.history)) for r in campaign.records.runs]
        assert np.abs(campaign.records.average(rows) - means).max() < 1e-7
        line = campaign.temperature - campaign.temperature.mean()
        rest = line - means @ (means.T @ line)
        assert np.linalg.norm(rest) < 1e-2 * np.linalg.norm(line)
    assert len(LEVELS) == 4


def test_local_functions_over_the_temperature_add_up_to_one(campaign: Campaign) -> None:
    assert fine_columns(campaign.records).sum(axis=1) == pytest.approx(np.ones(campaign.records.size))


def test_a_cause_is_testable_only_where_the_recordings_say_enough(campaign: Campaign) -> None:
    records = campaign.records
    assert not any(reason_against(records, cause) for cause in diagnosed())
    off = replace(records.runs[0], history=replace(records.runs[0].history, on_s=None))
    assert "power-on" in reason_against(Records((off, *records.runs[1:]), 100.0), "warm_up")
    assert "runs" in reason_against(Records(records.runs[:1], 100.0), "turn_on_offset")
    reach = reach_of(records)
    assert reach.span_c == pytest.approx(75.0) and reach.longest_s == pytest.approx(4 * 3600.0 - 20.0)


def test_signatures_are_columns_less_what_the_map_explains(campaign: Campaign) -> None:
    bank = campaign.bank
    for signature in bank.groups:
        candidate = signature.candidate
        if candidate.role != "columns":
            continue
        raw = columns_of(campaign.records, candidate.id, candidate.values)
        again = (bank.signatures + bank.map @ bank.on_map)[:, signature.columns] * bank.scale[
            signature.columns
        ]
        assert again == pytest.approx(raw, abs=1e-9 * np.abs(raw).max())
    assert np.abs(bank.map.T @ bank.signatures).max() < 1e-6


def test_the_direction_is_that_of_the_last_change(campaign: Campaign) -> None:
    """A play of 3 C stands 3 C behind: below T after warming, above it after cooling."""
    direction = direction_of(campaign.records, 3.0)[:, 0]
    slope = campaign.records.average([centred_slope(r.history) for r in campaign.records.runs])
    start = campaign.records.spans()[0].start
    for k in range(start + 12, start + 140):
        steady = slope[k - 10 : k + 2]
        if steady.min() > 0.5:
            assert direction[k] == pytest.approx(-3.0, abs=1e-9)
        elif steady.max() < -0.5:
            assert direction[k] == pytest.approx(3.0, abs=1e-9)


def test_the_banks_inner_products_are_those_of_whitened_columns(campaign: Campaign) -> None:
    bank, records = campaign.bank, campaign.records
    number = 7
    whiten = Whitener(COLOURS[number], records.kept, records.block_s)
    white = whiten(np.column_stack([bank.map, bank.signatures]))
    assert np.allclose(bank.grams[number], white.T @ white, rtol=1e-9, atol=1e-12)
    sigma = np.linspace(0.5, 2.0, records.size)
    uneven = bank.weighted(records, sigma)
    even = uneven.log_dets[number] - 2.0 * np.log(sigma).sum()
    assert even == pytest.approx(bank.log_dets[number])


def test_a_grid_leaves_less_than_a_hundredth_of_a_signature_between_its_points(campaign: Campaign) -> None:
    grid = searched("thermal_gradient").grid(reach_of(campaign.records))
    for here, there in itertools.pairwise(grid):
        middle = float(np.sqrt(here["tau_s"] * there["tau_s"]))
        column = columns_of(campaign.records, "thermal_gradient", {"tau_s": middle})[:, 0]
        near = np.column_stack(
            [columns_of(campaign.records, "thermal_gradient", v)[:, 0] for v in (here, there)]
        )
        cosine = near.T @ column / np.linalg.norm(near, axis=0) / np.linalg.norm(column)
        assert 1.0 - cosine.max() ** 2 < 0.01


def test_a_map_of_hardly_changed_inputs_is_the_map(campaign: Campaign) -> None:
    basis, means = make_basis(campaign.records, 0)
    quick = Candidate("cavity_lag", {"tau_s": 1e-3}, "input")
    block, known = replaced_map(campaign.records, basis, quick)
    assert known.all()
    assert np.median(np.abs(block - means)) < 1e-6, "they part at corners only, where a slope has a window"
    slow = Candidate("cavity_lag", {"tau_s": 1500.0}, "input")
    assert np.abs(replaced_map(campaign.records, basis, slow)[0] - means).max() > 0.3 * np.abs(means).max()
    plain = proportional_map(campaign.records, basis, None)
    late = [first_order(1500.0, r.history.time_s, r.history.temperature_c) for r in campaign.records.runs]
    moved = proportional_map(campaign.records, basis, slow)
    assert plain.shape == moved.shape and np.ptp(moved[:, 1]) == pytest.approx(
        np.ptp(np.concatenate(late)) / basis.half[0], rel=0.05
    )


def test_a_one_sided_lag_with_equal_times_is_a_first_order_one(campaign: Campaign) -> None:
    history = campaign.records.runs[0].history
    both = _two_sided_lag(history, 500.0, 500.0)[:, 0]
    plain = first_order(500.0, history.time_s, history.temperature_c) - history.temperature_c
    assert np.abs(both - plain).max() < 0.02 * np.abs(plain).max(), "the two hold T over a row or draw a line"


def test_a_switch_remembers_the_last_threshold() -> None:
    t = np.array([0.0, 6.0, 11.0, 7.0, 3.0, 7.0, 12.0])
    assert _switch(t, 10.0, 5.0).tolist() == [0, 0, 1, 1, 0, 0, 1]


def test_alternatives_are_finite_and_zero_where_the_temperature_stands(campaign: Campaign) -> None:
    names = set()
    for shape in shapes_of(campaign.records):
        assert np.isfinite(shape.columns).all() and len(shape.columns) == campaign.records.size
        names.add(shape.name)
    assert len(names) == 6
    time = np.arange(0.0, 7200.0, 20.0)
    still = replace(
        campaign.records.runs[0], history=History(time_s=time, temperature_c=np.full(time.size, 20.0))
    )
    assert not _two_sided_lag(still.history, 100.0, 900.0).any()
