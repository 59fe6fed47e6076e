"""Stage 5 of diagnosis: gains against dense least squares, refinement, rivals, lack of fit, other shapes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from gyrotc.diagnose.attribution import Attribution, attribute, choose, overlap
from gyrotc.diagnose.candidates import Candidate, columns_of
from gyrotc.diagnose.gains import Gains, Point, SizeLimit, best_of, clear_pair, makes_sense
from gyrotc.diagnose.misfit import contest, misfit
from gyrotc.diagnose.refine import Refined, model_columns, parabola_top, profile_interval, random_size, refine
from gyrotc.diagnose.rivals import EQUIVALENT, Rival, near_of, probabilities_of, ranked_rivals
from gyrotc.diagnose.search import Search
from gyrotc.diagnose.single_cycle import CycleFits
from numpy.typing import NDArray
from scipy import stats
from small_campaign import LEVEL_DPH, Campaign, small_campaign

Array = NDArray[np.float64]
SEED = 20260403
WIDTH_C, SIZE = 6.0, 4e-4


@dataclass(frozen=True)
class Case:
    """Hysteresis in white noise, and what diagnosis makes of it."""

    campaign: Campaign
    search: Search
    gains: Gains
    found: Attribution


@pytest.fixture(scope="module")
def case() -> Case:
    print("seed", SEED)
    campaign = small_campaign()
    column = columns_of(campaign.records, "hysteresis", {"width_c": WIDTH_C})[:, 0]
    noise = LEVEL_DPH * np.random.default_rng(SEED).standard_normal(campaign.records.size)
    search = campaign.search(1e-4 * campaign.temperature + SIZE * column + noise)
    return Case(campaign, search, Gains(search), attribute(search))


def key(candidate: Candidate) -> tuple[str, tuple[float, ...]]:
    return candidate.id, tuple(candidate.values.values())


def left(columns: Array, y: Array) -> float:
    """Energy that least squares leave."""
    return float(np.sum((y - columns @ np.linalg.lstsq(columns, y, rcond=1e-10)[0]) ** 2))


def too_large(search: Search, candidate: Candidate) -> bool:
    """Whether white least squares give a cause more than twice the spread of the rate."""
    columns = columns_of(search.records, candidate.id, candidate.values)
    design = np.column_stack([search.bank.map, columns])
    weights = np.linalg.lstsq(design, search.y, rcond=None)[0]
    return float(np.std(columns @ weights[search.bank.map.shape[1] :])) > 2.0 * float(search.y.std())


def test_gains_are_differences_of_dense_least_squares(case: Case) -> None:
    gains, bank = case.gains, case.search.bank
    static = left(gains.map, gains.target)
    singles = {key(p.members[0]): p.gain for p in gains.single()}
    for candidate, at in gains.plain[::9]:
        expected = static - left(np.column_stack([gains.map, gains.whole[:, at]]), gains.target)
        if too_large(case.search, candidate):
            assert singles[key(candidate)] == 0.0
        else:
            assert singles[key(candidate)] == pytest.approx(expected, rel=1e-5, abs=1e-5)
    for i in (0, 9, 20):
        candidate, known = bank.inputs[i], bank.known[i]
        edges = gains.whiten(np.eye(known.size)[:, ~known])
        maps = (gains.map, gains.whiten(bank.replaced[i]))
        before, after = (left(np.column_stack([edges, m]), gains.target) for m in maps)
        assert singles[key(candidate)] == pytest.approx(before - after, abs=1e-4)
        assert gains.rest_after(candidate, gains.target) == pytest.approx(after, rel=1e-6)


def test_gains_of_pairs_are_those_of_both_together(case: Case) -> None:
    gains = case.gains
    static = left(gains.map, gains.target)
    pairs = [p for p in gains.pairs() if all(m.role == "columns" for m in p.members)]
    where = {id(c): at for c, at in gains.plain}
    checked = 0
    for pair in pairs[:: max(len(pairs) // 15, 1)]:
        columns = [gains.whole[:, where[id(m)]] for m in pair.members]
        expected = static - left(np.column_stack([gains.map, *columns]), gains.target)
        if pair.members[0].id != pair.members[1].id:
            assert pair.gain == pytest.approx(expected, rel=1e-3, abs=0.05)
            checked += 1
    assert checked >= 5


def test_what_the_map_imitates_gets_neither_credit_nor_a_size_beyond_that_of_the_rate(case: Case) -> None:
    """A long wave is in the map's span but for a trace: of the texture beside it the trace made a wave of any size."""
    t = case.campaign.temperature
    noise = 0.3 * LEVEL_DPH * np.random.default_rng(SEED + 3).standard_normal(t.size)
    search = case.campaign.search(1e-4 * t + 1e-3 * np.cos(2.0 * np.pi * t / 13.0) + noise)
    gains = Gains(search)
    large = [p for p in gains.added() if p.members[0].role == "columns" and too_large(search, p.members[0])]
    assert any(p.members[0].values["period_c"] > 40.0 for p in large)
    assert all(p.gain == 0.0 for p in large)
    longest = next(c for c, _ in gains.plain if c.id == "path_length_periodicity")
    for chosen in ((longest,), (Candidate("hysteresis", {"width_c": 5.0}, "columns"), longest)):
        for cause in refine(search, gains, chosen):
            assert cause.contribution.std() <= 2.0 * search.y.std(), cause.parameters
    [right] = choose(search, 1)
    assert right.candidate.values["period_c"] == pytest.approx(13.0, rel=0.02)
    assert right.parameters["amplitude_dph"].value == pytest.approx(1e-3, rel=0.15)


def test_the_largest_size_does_not_hang_on_a_constant_nor_on_blocks_without_a_rate(case: Case) -> None:
    y = case.search.y
    limit = SizeLimit(case.search)
    assert limit.spread_dph == pytest.approx(2.0 * y.std())
    assert limit.allows(1.9 * y) and not limit.allows(2.1 * y)
    empty = np.arange(y.size) % 50 == 0  # such blocks have a rate of 0, and a column each
    moved = case.campaign.search(np.where(empty, 0.0, y + 10.0), beside=np.eye(y.size)[:, empty])
    assert SizeLimit(moved).spread_dph == pytest.approx(limit.spread_dph, rel=0.05)


def test_the_planted_cause_is_named_with_its_parameters(case: Case) -> None:
    [cause] = case.found.causes
    assert cause.candidate.id == "hysteresis" and case.found.detected
    width, size = cause.parameters["width_c"], cause.parameters["amplitude_dph_per_c"]
    assert width.low < WIDTH_C < width.high and width.high - width.low < 0.5 * WIDTH_C
    assert size.low < SIZE < size.high
    assert case.found.left.share > 0.9 and case.found.left.p_value > 0.01
    assert case.found.other.lead < -2.0, "no shape without a name does better"


def test_refinement_ends_at_the_maximum_of_the_likelihood(case: Case) -> None:
    records = case.campaign.records

    def column(tau: float) -> Array:
        return columns_of(records, "warm_up", {"tau_s": tau})

    noise = LEVEL_DPH * np.random.default_rng(SEED + 2).standard_normal(records.size)
    gains = Gains(case.campaign.search(4e-3 * column(1700.0)[:, 0] + noise))
    grid = next(c for c, _ in gains.plain if c.id == "warm_up" and c.values["tau_s"] > 1400.0)
    [cause] = refine(gains.search, gains, (grid,))

    def rest(tau: float) -> float:
        return left(np.column_stack([gains.map, gains.whiten(column(tau))]), gains.target)

    fine = np.geomspace(900.0, 6000.0, 400)
    best = float(fine[np.argmin([rest(t) for t in fine])])
    assert cause.candidate.values["tau_s"] == pytest.approx(best, rel=0.02)
    inside = fine[np.array([rest(t) for t in fine]) <= rest(best) + stats.chi2.ppf(0.95, 1)]
    interval = cause.parameters["tau_s"]
    assert (interval.low, interval.high) == pytest.approx((inside[0], inside[-1]), rel=0.05)
    assert model_columns([cause]).shape[1] == 2, "the column and its derivative to the time constant"
    tau = cause.candidate.values["tau_s"]
    slope = (column(tau + 1.0) - column(tau - 1.0)) / 2.0
    assert cause.tangent is not None
    assert np.allclose(cause.tangent, slope, atol=0.01 * np.abs(slope).max())


def test_a_choice_without_asking_takes_the_same_cause(case: Case) -> None:
    assert [c.candidate.id for c in choose(case.search, 1)] == ["hysteresis"]


def test_what_is_left_after_a_wrong_cause_is_not_noise(case: Case) -> None:
    wrong = Candidate("warm_up", {"tau_s": 1800.0}, "columns")
    refined = refine(case.search, case.gains, (wrong,))
    found = misfit(case.search.extended(model_columns(refined)), "map and beside", refined)
    assert found.p_value < 1e-6 and found.share < 0.1


def test_a_shape_without_a_name_beats_causes_where_it_was_planted(case: Case) -> None:
    bank = case.search.bank
    group = next(g for g in bank.alternative_groups if g.name == "a switch with hysteresis")
    shape = bank.alternatives[:, group.columns][:, 0]
    noise = LEVEL_DPH * np.random.default_rng(SEED + 1).standard_normal(shape.size)
    search = case.campaign.search(0.05 * shape + noise)
    gains = Gains(search)
    causes = choose(search, 1)
    assert contest(gains, causes, [[] for _ in causes]).lead > 0.0


def test_what_a_cause_mimics_itself_cannot_be_told_apart(case: Case) -> None:
    [cause] = case.found.causes
    d = overlap(case.gains, cause, ["thermal_gradient", "ageing", "hysteresis"])
    assert d["hysteresis"] > 15.0
    assert np.sqrt(10.0) <= d["ageing"] < 4.5, "an offset of each run holds next to nothing of it"
    assert d["ageing"] < d["thermal_gradient"] < d["hysteresis"]


def _point(gain: float, *members: tuple[str, float]) -> Point:
    return Point(tuple(Candidate(id, {"x": x}, "columns") for id, x in members), gain)


def test_pairs_are_of_two_causes_or_of_two_states_far_apart() -> None:
    assert makes_sense(_point(0.0, ("hysteresis", 1.0), ("warm_up", 1.0)))
    assert not makes_sense(_point(0.0, ("map_too_coarse", 1.0), ("path_length_periodicity", 1.0)))
    assert makes_sense(_point(0.0, ("thermal_gradient", 100.0), ("thermal_gradient", 300.0)))
    assert not makes_sense(_point(0.0, ("thermal_gradient", 100.0), ("thermal_gradient", 150.0)))
    assert not makes_sense(_point(0.0, ("warm_up", 100.0), ("warm_up", 900.0))), "there is one power-on"


def test_a_pair_must_gain_and_need_both() -> None:
    singles = [_point(500.0, ("hysteresis", 1.0)), _point(300.0, ("warm_up", 1.0))]
    both = (("hysteresis", 1.0), ("warm_up", 1.0))
    size = 400
    assert best_of(singles, size) is singles[0]
    assert clear_pair(singles, _point(800.0, *both), size) is not None
    assert clear_pair(singles, _point(510.0, *both), size) is None, "the second adds next to nothing"
    weak = [_point(100.0, ("hysteresis", 1.0)), _point(90.0, ("warm_up", 1.0))]
    assert clear_pair(weak, _point(800.0, *both), size) is None, "neither says anything alone"


def test_rivals_are_near_in_the_criterion() -> None:
    singles = [
        _point(g, (id, 1.0))
        for g, id in ((100.0, "hysteresis"), (97.0, "thermal_gradient"), (60.0, "warm_up"))
    ]
    [near] = map(near_of, ranked_rivals(singles, [], singles[0].members, 400))
    assert [r.id for r in near] == ["thermal_gradient"]
    prices = [p.criterion(400) for p in singles]
    assert near[0].distance == pytest.approx(prices[0] - prices[1])
    pairs = [
        _point(200.0, ("hysteresis", 1.0), ("warm_up", 1.0)),
        _point(198.0, ("hysteresis", 1.0), ("ageing", 1.0)),
        _point(199.0, ("thermal_gradient", 1.0), ("ageing", 1.0)),
    ]
    first, second = map(near_of, ranked_rivals(singles, pairs, pairs[0].members, 400))
    assert [r.id for r in first] == [] and [r.id for r in second] == ["ageing"]


def test_what_is_called_equal_and_the_probabilities_agree() -> None:
    """A rival at the edge of what counts as equal has 1 in 10; several farther ones together make a case, too."""
    at_edge = probabilities_of("hysteresis", [Rival("ageing", EQUIVALENT)])
    assert at_edge == pytest.approx({"hysteresis": 0.9, "ageing": 0.1})
    assert probabilities_of("hysteresis", [Rival("ageing", 0.0)])["ageing"] == pytest.approx(0.5)
    assert list(probabilities_of("hysteresis", [Rival("ageing", 60.0)])) == ["hysteresis"], (
        "too unlikely to tell"
    )
    same = [Rival("auxiliary", 1.0, "supply_v"), Rival("auxiliary", 2.0, "pressure_hpa")]
    assert probabilities_of("auxiliary", same) == {"auxiliary": 1.0}, "another channel is no other cause"
    size, far = 400, EQUIVALENT + 1.0
    singles = [_point(100.0, ("hysteresis", 1.0))]
    price = singles[0].criterion(size)
    for id in ("thermal_gradient", "warm_up", "ageing"):
        one = _point(0.0, (id, 1.0))
        singles.append(_point(price - far - one.criterion(size), (id, 1.0)))
    [near] = map(near_of, ranked_rivals(singles[:2], [], singles[0].members, size))
    assert near == (), "one alone is ruled out"
    [near] = map(near_of, ranked_rivals(singles, [], singles[0].members, size))
    assert near, "three together are not"


def test_a_parabola_is_read_exactly() -> None:
    def energy(x: float) -> float:
        return 7.0 - 0.5 * (x - 3.0) ** 2

    top, curve = parabola_top(energy, 2.5, 1.0, -np.inf)
    assert (top, curve) == pytest.approx((3.0, 0.5))
    x = np.linspace(-5.0, 11.0, 4001)
    low, high = profile_interval(np.array([x, energy(x)]))
    half = np.sqrt(stats.chi2.ppf(0.95, 1) / 0.5)
    assert (low, high) == pytest.approx((3.0 - half, 3.0 + half), abs=1e-5)
    flat = profile_interval(np.array([x, np.zeros(x.size)]))
    assert flat == (-5.0, 11.0), "what does not fall has no end"


def test_an_interval_holds_every_top_that_reaches_as_far_as_its_likelihood() -> None:
    x = np.linspace(0.0, 10.0, 1001)
    energy = np.maximum(20.0 - 40.0 * (x - 2.0) ** 2, 18.0 - 40.0 * (x - 7.0) ** 2)
    drop = float(stats.chi2.ppf(0.95, 1))
    low, high = profile_interval(np.array([x, energy]))
    assert low == pytest.approx(2.0 - np.sqrt(drop / 40.0), abs=0.01)
    assert high == pytest.approx(7.0 + np.sqrt((drop - 2.0) / 40.0), abs=0.01)


@pytest.mark.slow
def test_the_interval_of_a_weak_waves_period_is_taken_over_the_whole_grid(case: Case) -> None:
    """Of a weak wave another period may do as well: about the best one alone the interval missed it."""
    print("seed", SEED + 5)
    rng, records = np.random.default_rng(SEED + 5), case.campaign.records
    grid = [c for c, _ in case.gains.plain if c.id == "path_length_periodicity"]
    period = float(grid[len(grid) // 3].values["period_c"])
    wave = columns_of(records, "path_length_periodicity", {"period_c": period})[:, 0]
    several = inside = 0
    for _ in range(12):
        noise = LEVEL_DPH * rng.standard_normal(records.size)
        search = case.campaign.search(1e-4 * case.campaign.temperature + 0.25 * LEVEL_DPH * wave + noise)
        gains = Gains(search)
        best = best_of([p for p in gains.single() if p.members[0] in grid], gains.size)
        [cause] = refine(search, gains, best.members)
        assert cause.profile is not None
        found = cause.parameters["period_c"]
        values, energy = cause.profile
        near = values[energy >= energy.max() - stats.chi2.ppf(0.95, 1)]
        assert {c.values["period_c"] for c in grid} <= set(values.tolist()), "every period is asked"
        assert found.low <= near.min() <= found.value <= near.max() <= found.high
        gaps = energy[(values > near.min()) & (values < near.max())] < energy.max() - 3.9
        several += bool(gaps.any())
        inside += found.low <= period <= found.high
    print(f"{several} of 12 with another top, {inside} hold the period")
    assert inside >= 8, "0.95 of 12 but for one in a thousand series"


def test_the_size_of_random_draws_covers_the_truth_as_often_as_it_says() -> None:
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    noise = 0.04 * np.eye(8)
    inside = []
    for _ in range(400):
        weights = rng.standard_normal(8) + 0.2 * rng.standard_normal(8)
        found = random_size(weights, noise)
        inside.append(found.low <= 1.0 <= found.high)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.045), "four standard deviations of 400 draws"


def test_all_combinations_of_states_explain_what_least_squares_say(case: Case) -> None:
    records = case.campaign.with_rate(
        [1e-4 * r.history.temperature_c for r in case.campaign.records.runs], case.search.y
    )
    fits = CycleFits(records)
    total = left(fits.static, fits.y)
    kinds = tuple(fits.grid)[:2]
    energy = fits.energies(kinds)
    for i, j in ((3, 5), (10, 2)):
        members = (fits.grid[kinds[0]][i], fits.grid[kinds[1]][j])
        raw = np.column_stack([columns_of(records, m.id, m.values) for m in members])
        rest = left(np.column_stack([fits.static, raw]), fits.y)
        assert energy[i, j] == pytest.approx(total - rest, rel=1e-5)
        assert float(np.sum(fits.left(members) ** 2)) == pytest.approx(rest, rel=1e-6)
    same = fits.energies((kinds[0], kinds[0]))
    assert not same[np.tril_indices(len(same))].any(), "a state is not its own partner"


def test_nothing_is_taken_from_an_empty_model() -> None:
    none = Refined(Candidate("x", {}, "columns"), np.ones((3, 1)), None, {}, np.ones(3), None, None)
    assert model_columns([none, none]).shape == (3, 2)
