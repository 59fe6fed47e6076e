"""Stage 6 of diagnosis: measured residuals and noise against simulated campaigns and the declaration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gyrotc.diagnose.blocks import Records
from gyrotc.diagnose.candidates import columns_of
from gyrotc.diagnose.discrepancy import _discrepancy, _two_sided, ensemble_of, noise_findings
from gyrotc.diagnose.noise import NOISE_WORDS, Declared
from gyrotc.diagnose.pipeline import needs_finer, search_of
from numpy.typing import NDArray
from small_campaign import BLOCK_S, LEVEL_DPH, Campaign, small_campaign

Array = NDArray[np.float64]
SEED = 20260404
DECLARED = Declared(LEVEL_DPH * np.sqrt(BLOCK_S) / 60.0)  # white, as the block means below


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return small_campaign()


def noise(campaign: Campaign, seed: int = SEED) -> Array:
    print("seed", seed)
    return LEVEL_DPH * np.random.default_rng(seed).standard_normal(campaign.records.size)


def test_noise_as_declared_has_no_finding_and_no_discrepancy(campaign: Campaign) -> None:
    search = campaign.search(noise(campaign), declared=DECLARED.colour(BLOCK_S))
    assert noise_findings(search, DECLARED, causes=False) == []
    found = ensemble_of(search, DECLARED)
    assert min(d.p_value for d in found.discrepancies) > 0.01
    assert found.residual == pytest.approx(search.y - search.bank.map @ search.map_weights())


@pytest.mark.parametrize("ratio", [0.7, 1.4])
def test_another_level_is_told_with_its_ratio(campaign: Campaign, ratio: float) -> None:
    found = noise_findings(campaign.search(ratio * noise(campaign)), DECLARED, causes=True)
    level = next(f for f in found if f.id == "noise_level")
    assert level.parameters["ratio"] == pytest.approx(ratio, rel=0.12) and level.id in NOISE_WORDS


def test_a_level_is_as_rare_as_monte_carlo_says() -> None:
    print("seed", SEED)
    freedom = 40
    energy = (np.random.default_rng(SEED).standard_normal((20000, freedom)) ** 2).sum(axis=1)
    for value in (22.0, 60.0):
        share = min(np.mean(energy <= value), np.mean(energy >= value))
        assert _two_sided(value, freedom) == pytest.approx(2.0 * share, abs=8.0 * np.sqrt(share / 20000))


def test_slow_noise_has_another_colour_than_declared(campaign: Campaign) -> None:
    rng = np.random.default_rng(SEED)
    walk = np.concatenate([np.cumsum(rng.standard_normal(k.size)) for k in campaign.records.kept])
    search = campaign.search(noise(campaign) + 6e-4 * walk)
    assert "noise_colour" in [f.id for f in noise_findings(search, DECLARED, causes=True)]


def test_a_p_value_is_the_rank_among_the_simulated_ones() -> None:
    simulated = np.arange(499.0)
    assert _discrepancy("a", 1e3, simulated, 0.0).p_value == pytest.approx(2.0 / 500.0)
    assert _discrepancy("a", 249.0, simulated, 0.0).p_value == 1.0
    middle = _discrepancy("a", 0.0, simulated, 0.0)
    assert (middle.simulated_mean, middle.simulated_low) == pytest.approx((249.0, 0.025 * 498.0))


def test_what_the_model_takes_away_wholly_is_not_rare(campaign: Campaign) -> None:
    """Means of runs beside offsets of every run are rounding errors: no rank among them means anything."""
    offsets = np.repeat(np.eye(3), [k.size for k in campaign.records.kept], axis=0)
    found = ensemble_of(campaign.search(noise(campaign)), DECLARED, beside=offsets)
    means = next(d for d in found.discrepancies if d.statistic == "run_means_rms_dph")
    assert means.measured < 1e-12 and means.p_value == 1.0


def test_a_memory_shows_in_half_hours_and_goes_when_the_simulation_has_it(campaign: Campaign) -> None:
    column = columns_of(campaign.records, "thermal_gradient", {"tau_s": 900.0})
    search = campaign.search(noise(campaign) + 5e-4 * column[:, 0])
    plain = {d.statistic: d.p_value for d in ensemble_of(search, DECLARED).discrepancies}
    extended = {d.statistic: d.p_value for d in ensemble_of(search, DECLARED, beside=column).discrepancies}
    assert plain["half_hour_means_rms_dph"] == pytest.approx(0.004)
    assert extended["half_hour_means_rms_dph"] > 0.01


def test_a_ripple_over_temperature_needs_a_finer_map_and_a_memory_does_not(
    campaign: Campaign, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("banks")))
    finer = campaign.bank.finer @ np.random.default_rng(SEED).standard_normal(campaign.bank.finer.shape[1])
    assert needs_finer(campaign.search(noise(campaign) + 2e-2 * finer))
    column = columns_of(campaign.records, "hysteresis", {"width_c": 6.0})[:, 0]
    assert not needs_finer(campaign.search(noise(campaign) + 1e-3 * column))
    runs = [
        replace(r, rate_dph=noise(campaign)[span][campaign.records.index[k]])
        for k, (r, span) in enumerate(zip(campaign.records.runs, campaign.records.spans(), strict=True))
    ]
    search = search_of(Records(tuple(runs), BLOCK_S), DECLARED)
    assert search.bank.map.shape[1] == campaign.bank.map.shape[1] and search.declared is not None
