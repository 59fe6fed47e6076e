"""Stage 4 of diagnosis against dense algebra: likelihood of a colour, projections, p-values, detection limits."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.diagnose.candidates import Candidate, columns_of
from gyrotc.diagnose.detection import detect, detection_limits, limit_of, project
from gyrotc.diagnose.joined import (
    JoinedLayout,
    Projection,
    ScoredColumns,
    draw_null,
    ratio_of,
    score,
    variance_ratio_of,
)
from gyrotc.diagnose.noise import COLOURS, Whitener
from gyrotc.diagnose.search import Search, residual_log_likelihood
from numpy.typing import NDArray
from scipy import stats
from scipy.linalg import block_diag, null_space
from scipy.optimize import minimize_scalar
from small_campaign import BLOCK_S, LEVEL_DPH, Campaign, small_campaign

Array = NDArray[np.float64]
SEED = 20260402
TRUE_COLOUR = 8  # of COLOURS, in which the noise is drawn
PLANTED = {"tau_s": 900.0}


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return small_campaign()


def noise(campaign: Campaign, seed: int) -> Array:
    print("seed", seed)
    whiten = Whitener(COLOURS[TRUE_COLOUR], campaign.records.kept, BLOCK_S)
    white = np.random.default_rng(seed).standard_normal((campaign.records.size, 1))
    return np.asarray(LEVEL_DPH * whiten.colour(white)[:, 0])


@pytest.fixture(scope="module")
def quiet(campaign: Campaign) -> Search:
    """A static map and noise, no cause; one block is left out."""
    y = 1e-4 * campaign.temperature + noise(campaign, SEED)
    return campaign.search(y, beside=np.eye(y.size)[:, [17]])


@pytest.fixture(scope="module")
def planted(campaign: Campaign) -> Search:
    """The same with a thermal gradient."""
    column = columns_of(campaign.records, "thermal_gradient", PLANTED)[:, 0]
    return campaign.search(1e-4 * campaign.temperature + noise(campaign, SEED) + 4e-4 * column)


def all_columns(search: Search) -> Array:
    bank = search.bank
    return np.column_stack([bank.map, bank.signatures, search.joined.outside])


def dense(search: Search, number: int) -> Array:
    return np.asarray(block_diag(*(COLOURS[number].matrix(k, BLOCK_S) for k in search.records.kept)))


def test_a_layout_counts_every_column_once() -> None:
    layout = JoinedLayout.of(3, 5, 2, 0, 4)
    parts = (layout.static, layout.signatures, layout.channels, layout.inputs, layout.beside)
    assert [i for part in parts for i in range(14)[part]] == list(range(14)) and layout.total == 14
    assert layout.held("map and beside").tolist() == [0, 1, 2, 10, 11, 12, 13]
    assert layout.held("beside").tolist() == [10, 11, 12, 13]


def test_the_likelihood_of_a_colour_is_that_of_a_dense_normal_distribution(quiet: Search) -> None:
    """Of the part of the data that no effect reaches, with the noise's scale at its best."""
    free = null_space((all_columns(quiet) @ quiet.question.effects).T, rcond=1e-9)
    assert free.shape[1] == quiet.freedom
    numbers = [0, 3, TRUE_COLOUR, 14, 20]
    own, expected = [], []
    for number in numbers:
        view, inner = quiet.views[number], free.T @ dense(quiet, number) @ free
        normal = stats.multivariate_normal(np.zeros(len(inner)), view.scale**2 * inner)
        best = np.sqrt(free.T @ quiet.y @ np.linalg.solve(inner, free.T @ quiet.y) / quiet.freedom)
        assert view.scale == pytest.approx(best, rel=1e-6)
        own.append(view.log_likelihood)
        expected.append(float(normal.logpdf(free.T @ quiet.y)))
    assert np.diff(own) == pytest.approx(np.diff(expected), abs=1e-3)


def test_the_true_colour_and_level_are_among_those_allowed(quiet: Search, planted: Search) -> None:
    for search in (quiet, planted):
        assert TRUE_COLOUR in search.allowed and search.best in search.allowed
        assert search.views[TRUE_COLOUR].scale == pytest.approx(
            LEVEL_DPH, rel=4.0 / np.sqrt(2.0 * search.freedom)
        )
    assert residual_log_likelihood(2.0, 10, 3.0) == pytest.approx(-5.0 * np.log(0.2) - 1.5)


def test_a_projection_is_that_of_whitened_columns(quiet: Search) -> None:
    view = quiet.likeliest
    white = Whitener(view.colour, quiet.records.kept, BLOCK_S)
    columns, y = white(all_columns(quiet)), white(quiet.y)
    for held in ("map", "map and beside"):
        q = np.linalg.qr(columns[:, quiet.joined.layout.held(held)])[0]
        rest, left = columns - q @ (q.T @ columns), y - q @ (q.T @ y)
        found = project(quiet, view, held)
        assert np.allclose(found.gram, rest.T @ rest, atol=1e-7 * np.abs(columns.T @ columns).max())
        assert np.allclose(found.a, rest.T @ left / view.scale, atol=1e-6 * np.abs(found.a).max())
        assert found.rest == pytest.approx(left @ left) and found.rank == q.shape[1]


def test_without_the_map_a_candidate_is_its_whole_column_again(planted: Search) -> None:
    """The plain map stands beside as if a cause had brought it: then nothing may change but inputs, which go."""
    moved = planted.extended(planted.bank.map)
    views = [s.views[planted.best] for s in (planted, moved)]
    was, now = project(planted, views[0], "map"), project(moved, views[1], "beside")
    at = planted.joined.layout.signatures
    a, b = (p.a[at] * v.scale for p, v in zip((was, now), views, strict=True))
    assert np.abs(a - b).max() < 1e-4 * np.abs(a).max()
    assert not now.a[planted.joined.layout.inputs].any()


def _projection(gram: Array, a: Array) -> Projection:
    none = np.zeros((len(gram), 1))
    none[0, 0] = 1.0
    return Projection(a, gram, np.diag(gram).copy(), none, 1.0, 0.0, 0)


def test_scores_are_log_p_values_of_normal_and_chi_square() -> None:
    gram = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.6], [0.0, 0.6, 1.0]])
    a = np.array([2.5, 1.0, -2.0])
    columns = ScoredColumns(np.array([0, 1]), np.array([[1, 2]]), ())
    found = score(_projection(gram, a), columns, a)
    assert np.exp(-found.single) == pytest.approx(2.0 * stats.norm.sf([2.5, 1.0]))
    energy = a[1:] @ np.linalg.solve(gram[1:, 1:], a[1:])
    assert np.exp(-found.pairs) == pytest.approx(stats.chi2.sf([energy], 2))


def test_the_ratio_of_a_common_variance_is_the_maximum_of_its_likelihood() -> None:
    rng = np.random.default_rng(5)
    basis = rng.standard_normal((30, 6))
    data = basis @ rng.standard_normal(6) + rng.standard_normal(30)

    def deviance(log_variance: float) -> float:
        cov = np.eye(30) + np.exp(log_variance) * basis @ basis.T
        return -2.0 * float(stats.multivariate_normal(np.zeros(30), cov).logpdf(data))

    best = minimize_scalar(deviance, bounds=(-10.0, 10.0), method="bounded").fun
    none = -2.0 * float(stats.multivariate_normal(np.zeros(30), np.eye(30)).logpdf(data))
    ratio, variance = variance_ratio_of(basis.T @ basis, basis.T @ data, 100.0)
    assert float(ratio) == pytest.approx(none - best, abs=0.1), "the grid of variances costs little"
    assert 0.1 < float(variance) < 10.0
    assert float(ratio_of(np.full(6, 0.5), np.ones(6))[0]) == 0.0, "less than noise is no variance"


def test_the_largest_of_independent_scores_is_distributed_as_it_must_be() -> None:
    """The omnibus direction is the first column, so of k columns there are k + 1 scores and k are independent."""
    k = 25
    columns = ScoredColumns(np.arange(1, k), np.zeros((0, 2), dtype=np.int64), ())
    null = np.sort(draw_null(_projection(np.eye(k), np.zeros(k)), columns, 3, draws=4000))
    for share in (0.5, 0.9, 0.99):
        alone = 1.0 - np.exp(-null[int(share * null.size)])
        spread = 4.0 * np.sqrt(share * (1.0 - share) / null.size)
        omnibus = stats.norm.cdf(stats.norm.isf(np.exp(-null[int(share * null.size)])))
        assert alone ** (k - 1) * omnibus == pytest.approx(share, abs=spread + 0.01)


def test_a_planted_cause_is_found_and_noise_alone_is_not(quiet: Search, planted: Search) -> None:
    first = detect(planted, "map and beside")
    assert first[0].p_value < 1e-3 and first[0].candidate.id in (
        "thermal_gradient",
        "cavity_lag",
        "structure",
    )
    near = next(f for f in first if f.candidate.id == "thermal_gradient")
    assert near.p_value < 1e-3 and 600.0 < near.candidate.values["tau_s"] < 1400.0
    assert detect(quiet, "map and beside")[0].p_value > 0.01
    column = columns_of(planted.records, "thermal_gradient", PLANTED)
    assert detect(planted.extended(column), "map and beside")[0].p_value > 0.01, "nothing beside it"


@pytest.mark.slow
def test_p_values_of_noise_are_not_too_small_in_many_campaigns(campaign: Campaign) -> None:
    smallest = []
    for seed in range(SEED, SEED + 12):
        smallest.append(detect(campaign.search(noise(campaign, seed)), "map and beside")[0].p_value)
    assert np.mean(np.array(smallest) < 0.1) <= 0.5, "12 draws of a tenth: six have a chance of 1 in 20000"


def test_a_detection_limit_is_the_amplitude_at_the_needed_signal_to_noise_ratio(quiet: Search) -> None:
    view = quiet.likeliest
    white = Whitener(view.colour, quiet.records.kept, BLOCK_S)
    held = white(np.column_stack([quiet.bank.map, quiet.joined.beside]))
    q = np.linalg.qr(held)[0]
    limit = detection_limits(quiet)["thermal_gradient"]
    for tau, value in limit.at[::5]:
        column = white(columns_of(quiet.records, "thermal_gradient", {"tau_s": tau})[:, 0])
        d = np.linalg.norm(column - q @ (q.T @ column)) / view.scale
        assert value * d == pytest.approx(6.3, rel=1e-3)
    assert limit.value == pytest.approx(np.exp(np.median(np.log([v for _, v in limit.at]))))


def test_what_leaves_no_signature_has_no_limit() -> None:
    nothing = limit_of(
        "thermal_gradient", [(Candidate("thermal_gradient", {"tau_s": 100.0}, "columns"), 0.0)]
    )
    assert nothing.value is None and nothing.at == ()
    shown = limit_of(
        "cavity_lag", [(Candidate("cavity_lag", {"tau_s": t}, "input"), t) for t in (10.0, 90.0)]
    )
    assert shown.value == 90.0 and shown.unit == "s", "d is 3.2 and 9.5"
