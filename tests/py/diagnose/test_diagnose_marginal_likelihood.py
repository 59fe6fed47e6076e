"""Near explanations by marginal likelihood: a gradient is no lag, although a free map of a lagged input holds it."""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np
import pytest
from gyrotc.causes.base import History
from gyrotc.common.statistics import orthonormal
from gyrotc.diagnose.candidates import columns_of
from gyrotc.diagnose.gains import Gains, best_of
from gyrotc.diagnose.marginal_likelihood import MarginalLikelihood, _largest
from gyrotc.diagnose.rivals import LOOKED_AT, Rival, calibrated, odds_of, probabilities_of, ranked_rivals
from gyrotc.target.recursions import delayed, first_order
from numpy.typing import NDArray
from scipy.stats import multivariate_normal
from small_campaign import LEVEL_DPH, Campaign, small_campaign

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
    other = copy.copy(quiet)
    other.target, other._bases = signal + rng.standard_normal(quiet.size), None
    other.base = other._project(None, other.map, None)
    other._shares = np.zeros_like(quiet._shares)  # of what is believed of noise alone: nothing here
    return other


def _told(gains: Gains, *, weighed: bool = True) -> tuple[str, dict[str, float]]:
    """The named one of the memories, and the probability of each; by the evidence, or by likelihoods alone."""
    singles = [p for p in gains.single() if p.members[0].id in MEMORIES]
    evidence = MarginalLikelihood(gains)
    chosen = (evidence.preferred(singles) if weighed else best_of(singles, gains.size)).members
    [ranked] = ranked_rivals(singles, [], chosen, gains.size)
    near = evidence.judged(singles, chosen, 0, ranked) if weighed else ranked
    likely = calibrated(gains, singles, chosen, 0, near)
    return chosen[0].id, probabilities_of(chosen[0].id, likely)


@pytest.mark.slow
def test_gradients_and_lags_that_the_catalogue_does_not_have_are_told_apart(
    quiet: Gains, campaign: Campaign
) -> None:
    """By the evidence, and surer of what is true than likelihoods of equally many functions are."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    hidden = ["thermal_gradient", "cavity_lag"] * 8
    drawn = [_with(quiet, campaign, name, rng) for name in hidden]
    found = [_told(one) for one in drawn]
    wrong = [told for name, told in zip(hidden, found, strict=True) if told[0] != name]
    assert len(wrong) <= 2, wrong
    of_truth = [told[1].get(name, 0.0) for name, told in zip(hidden, found, strict=True)]
    before = [_told(one, weighed=False)[1].get(name, 0.0) for name, one in zip(hidden, drawn, strict=True)]
    assert np.mean(of_truth) > 0.85 and np.mean(of_truth) > np.mean(before) + 0.1, (of_truth, before)


@pytest.mark.parametrize("clock", ["time_misalignment", "a queue of 13 to 20 minutes"])
def test_a_late_clock_is_held_against_memories_on_the_blocks_that_it_knows(
    quiet: Gains, campaign: Campaign, clock: str
) -> None:
    """Where the true temperature was not recorded a clock gains nothing, and a memory that stands for it does."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 1)
    found = [_told(_with(quiet, campaign, clock, rng)) for _ in range(6)]
    assert [name for name, _ in found].count("time_misalignment") >= 5, found


def test_the_likelihood_of_groups_is_that_of_the_normal_distribution() -> None:
    rng = np.random.default_rng(SEED)
    group = rng.standard_normal((30, 4))
    y = group @ rng.normal(0.0, 3.0, 4) + rng.standard_normal(30)
    sizes = np.exp(np.linspace(-6.0, 6.0, 241))
    direct = [multivariate_normal(np.zeros(30), np.eye(30) + v * group @ group.T).logpdf(y) for v in sizes]
    none = multivariate_normal(np.zeros(30), np.eye(30)).logpdf(y)
    assert _largest(y, [group]) == pytest.approx(2.0 * (max(direct) - none), abs=0.01)


def test_functions_that_nothing_asks_for_cost_nothing_and_take_no_noise() -> None:
    rng = np.random.default_rng(SEED)
    taken = [_largest(rng.standard_normal(200), [rng.standard_normal((200, 20))]) for _ in range(40)]
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
    [ranked] = ranked_rivals(singles, [], best.members, gains.size)
    assert evidence.judged(singles, best.members, 0, ranked) == ranked


def test_rivals_keep_their_order_and_who_is_far_behind_stays_there(quiet: Gains, campaign: Campaign) -> None:
    gains = _with(quiet, campaign, "thermal_gradient", np.random.default_rng(SEED + 2))
    singles = list(gains.single())
    evidence = MarginalLikelihood(gains)
    chosen = evidence.preferred(singles).members
    [ranked] = ranked_rivals(singles, [], chosen, gains.size)
    told = evidence.judged(singles, chosen, 0, ranked)
    assert {r.id for r in told} == {r.id for r in ranked}
    assert [r.distance for r in told] == sorted(r.distance for r in told) and told[0].distance >= 0.0
    asked = [r for r in told if r.odds is not None]
    assert asked and all(r.odds == odds_of(Rival(r.id, r.distance)) for r in asked)
    assert all(r.distance > LOOKED_AT for r in told if r.odds is None)
