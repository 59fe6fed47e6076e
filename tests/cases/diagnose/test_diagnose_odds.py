"""Odds between causes by marginal likelihood and by simulation, and residuals against simulated campaigns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from gyrotc.causes import History
from gyrotc.common import orthonormal
from gyrotc.diagnose import (
    LOOKED_AT,
    NOISE_WORDS,
    Candidate,
    Declared,
    Gains,
    MarginalLikelihood,
    Point,
    Posterior,
    Records,
    Rival,
    RivalPlace,
    SimulatedRivals,
    best_of,
    best_points,
    calibrated,
    columns_of,
    compared_statistic,
    ensemble_of,
    largest_evidence,
    needs_finer,
    noise_findings,
    odds_of,
    p_value_of_energy,
    ranked_rivals,
    rival_key,
    search_of,
)
from gyrotc.mirror import delayed, first_order
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import chi2, multivariate_normal
from small_campaign import BLOCK_S, LEVEL_DPH, Campaign, small_campaign

Array = NDArray[np.float64]
Map = Callable[[Array], Array]
SEED = 20261123
MEMORIES = ("thermal_gradient", "cavity_lag", "time_misalignment")


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return small_campaign()


@pytest.fixture(scope="module")
def quiet(campaign: Campaign) -> Gains:
    """Of white noise alone."""
    y = LEVEL_DPH * np.random.default_rng(SEED).standard_normal(campaign.records.size)
    return Gains(campaign.search(y))


def _drawn_map(rng: np.random.Generator) -> Map:
    """Smooth over T: saturating parts, none of them narrower than 25 C."""
    weights, places, widths = rng.normal(0.0, 1.0, 4), rng.uniform(-40.0, 70.0, 4), rng.uniform(25.0, 60.0, 4)
    return lambda t: np.asarray(np.arctan((t[:, None] - places) / widths) @ weights)


def _effect(name: str, static: Map, rng: np.random.Generator) -> Callable[[History], Array]:
    """What a cause adds to the map in one run, by two nodes where the catalogue has one; a clock as it has it."""
    tau, near = float(np.exp(rng.uniform(np.log(250.0), np.log(1200.0)))), float(rng.uniform(10.0, 50.0))

    def of(h: History) -> Array:
        late = first_order(tau, h.time_s, h.temperature_c)
        second = first_order(near, h.time_s, h.temperature_c)
        if name == "thermal_gradient":
            return late - second
        if name == "cavity_lag":
            seen = first_order(near, h.time_s, late)
        else:
            late_s = min(tau, 550.0) if name == "time_misalignment" else 700.0 + 0.4 * tau
            seen = delayed(late_s, h.time_s, h.temperature_c)
        return static(seen) - static(h.temperature_c)

    return of


def _with(quiet: Gains, campaign: Campaign, name: str, rng: np.random.Generator) -> Gains:
    """A drawn map, one cause of 12 to 25 standard deviations beside it, and other noise."""
    static = _drawn_map(rng)
    of_run = _effect(name, static, rng)
    columns = campaign.records.columns(lambda h: np.column_stack([of_run(h), static(h.temperature_c)]))
    white = quiet.whiten(columns) / quiet.scale
    held = orthonormal(quiet.map, quiet.beside)
    seen = np.linalg.norm(white[:, 0] - held @ (held.T @ white[:, 0]))
    of_map = name != "thermal_gradient"  # its size is that of the map itself
    size = rng.uniform(12.0, 25.0) / seen
    signal = size * white[:, 0] + (size if of_map else 3.0 / white[:, 1].std()) * white[:, 1]
    return quiet.with_target(signal + rng.standard_normal(quiet.size), limited=False)  # the noise alone limits all


def _reported(gains: Gains, *, weighed: bool = True) -> tuple[str, dict[str, float]]:
    """The named one of the memories, and the probability of each; by the evidence, or by likelihoods alone."""
    singles = [p for p in gains.single() if p.members[0].id in MEMORIES]
    evidence = MarginalLikelihood(gains)
    chosen = (evidence.preferred(singles) if weighed else best_of(singles, gains.size)).members
    ranked = ranked_rivals(singles, chosen, 0, gains.size)
    near = evidence.judged(singles, chosen, 0, ranked) if weighed else ranked
    likely = calibrated(gains, singles, chosen, 0, near)
    return chosen[0].id, Posterior(chosen[0].id, likely).probabilities


@pytest.mark.parametrize("clock", ["time_misalignment", "a queue of 13 to 20 minutes"])
def test_a_late_clock_is_held_against_memories_on_the_blocks_that_it_knows(
    quiet: Gains, campaign: Campaign, clock: str
) -> None:
    """Where the true temperature was not recorded a clock gains nothing, and a memory that stands for it does."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 1)
    found = [_reported(_with(quiet, campaign, clock, rng)) for _ in range(6)]
    assert [name for name, _ in found].count("time_misalignment") >= 5, found


def test_the_likelihood_of_groups_is_that_of_the_normal_distribution() -> None:
    rng = np.random.default_rng(SEED)
    group = rng.standard_normal((30, 4))
    y = group @ rng.normal(0.0, 3.0, 4) + rng.standard_normal(30)
    sizes = np.exp(np.linspace(-6.0, 6.0, 241))
    direct = [multivariate_normal(np.zeros(30), np.eye(30) + v * group @ group.T).logpdf(y) for v in sizes]
    none = multivariate_normal(np.zeros(30), np.eye(30)).logpdf(y)
    assert largest_evidence(y, [group]) == pytest.approx(2.0 * (max(direct) - none), abs=0.01)


def test_functions_that_nothing_asks_for_cost_nothing_and_take_no_noise() -> None:
    rng = np.random.default_rng(SEED)
    taken = [largest_evidence(rng.standard_normal(200), [rng.standard_normal((200, 20))]) for _ in range(40)]
    assert min(taken) > -0.2
    assert np.mean(taken) < 2.0, "20 free functions take 20, give or take 6"


def test_a_model_is_over_the_map_alone_and_its_order_is_nothing(quiet: Gains, campaign: Campaign) -> None:
    gains = _with(quiet, campaign, "thermal_gradient", np.random.default_rng(SEED))
    evidence = MarginalLikelihood(gains)
    pair = next(p.members for p in gains.pairs() if p.members[0].id != p.members[1].id)
    none = np.zeros(gains.size, dtype=bool)
    other = MarginalLikelihood(gains).criterion(pair[::-1], none)
    assert evidence.criterion(pair, none) == pytest.approx(other, abs=1e-6)
    assert evidence.criterion((), none) == pytest.approx(0.0)


def test_without_a_changed_input_nearby_the_likelihood_decides(campaign: Campaign) -> None:
    y = LEVEL_DPH * np.random.default_rng(SEED).standard_normal(campaign.records.size)
    column = columns_of(campaign.records, "hysteresis", {"width_c": 6.0})[:, 0]
    gains = Gains(campaign.search(y + 60.0 * LEVEL_DPH * column / np.linalg.norm(column)))
    singles = list(gains.single())
    evidence = MarginalLikelihood(gains)
    best = best_of(singles, gains.size)
    assert evidence.preferred(singles) is best and best.members[0].id == "hysteresis"
    ranked = ranked_rivals(singles, best.members, 0, gains.size)
    assert evidence.judged(singles, best.members, 0, ranked) == ranked


def test_rivals_keep_their_order_and_who_is_far_behind_stays_there(quiet: Gains, campaign: Campaign) -> None:
    gains = _with(quiet, campaign, "thermal_gradient", np.random.default_rng(SEED + 2))
    singles = list(gains.single())
    evidence = MarginalLikelihood(gains)
    chosen = evidence.preferred(singles).members
    ranked = ranked_rivals(singles, chosen, 0, gains.size)
    reported = evidence.judged(singles, chosen, 0, ranked)
    assert {r.id for r in reported} == {r.id for r in ranked}
    assert [r.distance for r in reported] == sorted(r.distance for r in reported) and reported[0].distance >= 0.0
    asked = [r for r in reported if r.odds is not None]
    assert asked and all(r.odds == odds_of(Rival(r.id, r.distance)) for r in asked)
    assert all(r.distance > LOOKED_AT for r in reported if r.odds is None)


SEED_OF_ODDS = 20261122
HYSTERESIS, GRADIENT = ("hysteresis", {"width_c": 6.0}), ("thermal_gradient", {"tau_s": 600.0})


def _gains(campaign: Campaign, size: float, *causes: tuple[str, dict[str, float]]) -> Gains:
    """Of causes with a signal of `size` noise levels each, in white noise."""
    y = LEVEL_DPH * np.random.default_rng(SEED_OF_ODDS).standard_normal(campaign.records.size)
    for cause in causes:
        column = columns_of(campaign.records, *cause)[:, 0]
        y += size * LEVEL_DPH * column / np.linalg.norm(column)
    return Gains(campaign.search(y))


def test_the_criterion_of_a_place_is_that_of_the_search(campaign: Campaign) -> None:
    gains = _gains(campaign, 40.0, HYSTERESIS)
    singles = list(gains.single())
    place = RivalPlace(gains, ())
    kinds = {rival_key(p.members[0]) for p in singles}
    best = {k: max(p.criterion(gains.size) for p in singles if rival_key(p.members[0]) == k) for k in kinds}
    models = {k: [place.model(c) for c in best_points(singles, (), k)] for k in kinds}
    found = SimulatedRivals(place, models).measured
    assert {"cavity_lag", "turn_on_offset", "map_too_coarse", "hysteresis"} <= {id for id, _ in kinds}
    for kind in kinds:
        assert found[kind][0] == pytest.approx(best[kind], abs=0.5), kind


def test_beside_another_cause_it_is_that_of_the_pairs(campaign: Campaign) -> None:
    gains = _gains(campaign, 60.0, HYSTERESIS, ("warm_up", {"tau_s": 1200.0}))
    pairs = [p for p in gains.pairs() if {m.id for m in p.members} & {"warm_up"}]
    best = best_of(pairs, gains.size)
    other = next(m for m in best.members if m.id == "warm_up")
    place = RivalPlace(gains, (other,))
    lags = ("cavity_lag", "")
    kinds = [("hysteresis", ""), ("thermal_gradient", ""), lags]
    models = {k: [place.model(c) for c in best_points(pairs, (other,), k)] for k in kinds}
    found = SimulatedRivals(place, models).measured
    top = {
        k: max(
            p.criterion(gains.size)
            for p in pairs
            if other in p.members and k in [rival_key(m) for m in p.members if m != other]
        )
        for k in kinds
    }
    for kind in kinds[1:]:
        lead = found[kinds[0]][0] - found[kind][0]
        # The blocks where a lag is not known are left out of both sides there, and beside the map of the pair alone.
        assert lead == pytest.approx(top[kinds[0]] - top[kind], abs=1.0 if kind == lags else 0.05), kind


def test_two_causes_with_one_signature_have_even_odds_at_any_price(campaign: Campaign) -> None:
    gains = _gains(campaign, 40.0, HYSTERESIS)
    best = best_of([p for p in gains.single() if p.members[0].id == "hysteresis"], gains.size)
    at = next(s for c, s in gains.plain if c == best.members[0])
    twin = Candidate("ageing", {}, "columns")
    gains.plain = [*gains.plain, (twin, at)]
    pool = [Point((twin,), best.gain), best]
    ranked = ranked_rivals(pool, (twin,), 0, gains.size)
    assert ranked[0].distance > 5.0, "a straight line costs one parameter less than a play"
    assert Posterior("ageing", ranked).probability > 0.8
    found = calibrated(gains, pool, (twin,), 0, ranked)
    assert Posterior("ageing", found).probabilities == pytest.approx({"ageing": 0.5, "hysteresis": 0.5}, abs=0.01)


@pytest.mark.parametrize("size", [8.0, 15.0, 40.0])
def test_it_only_takes_away_from_the_named_cause(campaign: Campaign, size: float) -> None:
    gains = _gains(campaign, size, HYSTERESIS)
    singles = list(gains.single())
    chosen = best_of(singles, gains.size).members
    ranked = ranked_rivals(singles, chosen, 0, gains.size)
    found = calibrated(gains, singles, chosen, 0, ranked)
    assert found == calibrated(gains, singles, chosen, 0, ranked), "the same each time"
    assert {replace(r, odds=None) for r in found} == set(ranked), "nobody is added or lost"
    before = {(r.id, r.channel): odds_of(r) for r in ranked}
    for rival in found:
        assert before[rival.id, rival.channel] <= odds_of(rival) <= 1.0
    assert [odds_of(r) for r in found] == sorted(map(odds_of, found), reverse=True)
    if size == 40.0:
        assert chosen[0].id == "hysteresis" and Posterior("hysteresis", found).remaining == (), (
            "a clear cause stays clear"
        )


def _said(gains: Gains, pool: Sequence[Point], simulated: bool) -> tuple[str, float]:
    """The named cause and its probability."""
    chosen = best_of(list(pool), gains.size).members
    ranked = ranked_rivals(list(pool), chosen, 0, gains.size)
    reported = calibrated(gains, pool, chosen, 0, ranked) if simulated else ranked
    return chosen[0].id, Posterior(chosen[0].id, tuple(reported)).probability


def test_what_is_said_is_true_at_least_as_often(campaign: Campaign) -> None:
    """Hysteresis or a gradient, sizes from hidden to plain: the sum of the probabilities is no more than came true."""
    print("seed", SEED_OF_ODDS)
    rng = np.random.default_rng(SEED_OF_ODDS)
    gains = _gains(campaign, 0.0)
    columns = {c[0]: gains.whiten(columns_of(campaign.records, *c)[:, 0]) for c in (HYSTERESIS, GRADIENT)}
    said, true = [], []
    for _ in range(120):
        name = str(rng.choice(list(columns)))
        signal = columns[name] / np.linalg.norm(columns[name]) * rng.uniform(6.0, 20.0)
        one = gains.with_target(signal + rng.standard_normal(gains.size))
        pool = [p for p in one.added() if p.members[0].id in columns]
        found, p = _said(one, pool, simulated=True)
        said.append(p)
        true.append(found == name)
    spread = float(np.sqrt(np.sum(np.array(said) * (1.0 - np.array(said)))))
    assert sum(said) - sum(true) < 2.5 * spread
    assert 0.05 < np.mean(np.array(said) < 0.9) < 0.95, "some are reported as ambiguous, some are not"


SEED_OF_DISCREPANCY = 20260404
DECLARED = Declared(LEVEL_DPH * np.sqrt(BLOCK_S) / 60.0)  # white, as the block means below


def noise(campaign: Campaign, seed: int = SEED_OF_DISCREPANCY) -> Array:
    print("seed", seed)
    return LEVEL_DPH * np.random.default_rng(seed).standard_normal(campaign.records.size)


def test_noise_as_declared_has_no_finding_and_no_discrepancy(campaign: Campaign) -> None:
    search = campaign.search(noise(campaign), declared=DECLARED.colour(BLOCK_S))
    assert noise_findings(search, DECLARED, causes=False) == []
    found = ensemble_of(search, DECLARED)
    assert min(d.p_value for d in found.discrepancies) > 0.01
    assert found.residual == pytest.approx(search.y - search.bank.map @ (search.bank.map.T @ search.y))


@pytest.mark.parametrize("ratio", [0.7, 1.4])
def test_another_level_is_reported_with_its_ratio(campaign: Campaign, ratio: float) -> None:
    found = noise_findings(campaign.search(ratio * noise(campaign)), DECLARED, causes=True)
    level = next(f for f in found if f.id == "noise_level")
    assert level.parameters["ratio"] == pytest.approx(ratio, rel=0.12) and level.id in NOISE_WORDS


def test_a_level_is_reported_from_one_in_a_thousand_on(campaign: Campaign) -> None:
    """The energy of residuals follows chi-square; its degrees of freedom are those that a reported level implies."""
    (loud,) = (f for f in noise_findings(campaign.search(1.4 * noise(campaign)), DECLARED, causes=True))
    ratio, p = loud.parameters["ratio"], loud.p_value
    freedom = brentq(lambda f: np.log(2.0 * chi2.sf(ratio**2 * f, f) / p), 5.0, 2000.0)
    for wanted, reported in ((3e-3, []), (4e-4, ["noise_level"])):
        scale = 1.4 * np.sqrt(chi2.isf(0.5 * wanted, freedom) / freedom) / ratio
        found = noise_findings(campaign.search(scale * noise(campaign)), DECLARED, causes=True)
        assert [f.id for f in found] == reported, wanted


def test_a_level_is_as_rare_as_monte_carlo_says() -> None:
    print("seed", SEED_OF_DISCREPANCY)
    freedom = 40
    energy = (np.random.default_rng(SEED_OF_DISCREPANCY).standard_normal((20000, freedom)) ** 2).sum(axis=1)
    for value in (22.0, 60.0):
        share = min(np.mean(energy <= value), np.mean(energy >= value))
        assert p_value_of_energy(value, freedom) == pytest.approx(2.0 * share, abs=8.0 * np.sqrt(share / 20000))


def test_slow_noise_has_another_colour_than_declared(campaign: Campaign) -> None:
    rng = np.random.default_rng(SEED_OF_DISCREPANCY)
    walk = np.concatenate([np.cumsum(rng.standard_normal(k.size)) for k in campaign.records.kept])
    search = campaign.search(noise(campaign) + 6e-4 * walk)
    assert "noise_colour" in [f.id for f in noise_findings(search, DECLARED, causes=True)]


def test_a_p_value_is_the_rank_among_the_simulated_ones() -> None:
    simulated = np.arange(499.0)
    assert compared_statistic("a", 1e3, simulated, 0.0).p_value == pytest.approx(2.0 / 500.0)
    assert compared_statistic("a", 249.0, simulated, 0.0).p_value == 1.0
    middle = compared_statistic("a", 0.0, simulated, 0.0)
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


def test_a_ripple_over_temperature_needs_a_finer_map_and_a_memory_does_not(campaign: Campaign) -> None:
    finer = campaign.bank.finer @ np.random.default_rng(SEED_OF_DISCREPANCY).standard_normal(
        campaign.bank.finer.shape[1]
    )
    assert needs_finer(campaign.search(noise(campaign) + 2e-2 * finer))
    column = columns_of(campaign.records, "hysteresis", {"width_c": 6.0})[:, 0]
    assert not needs_finer(campaign.search(noise(campaign) + 1e-3 * column))
    runs = [
        replace(r, rate_dph=noise(campaign)[span][campaign.records.index[k]])
        for k, (r, span) in enumerate(zip(campaign.records.runs, campaign.records.spans(), strict=True))
    ]
    search = search_of(Records(tuple(runs), BLOCK_S), DECLARED)
    assert search.bank.map.shape[1] == campaign.bank.map.shape[1] and search.declared is not None
