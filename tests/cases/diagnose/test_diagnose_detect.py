"""Stages 1, 2 and 4 of diagnosis: screens, colour of the noise, detection, and the gain of an extension."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gyrotc.causes import History
from gyrotc.common import Averages
from gyrotc.diagnose import (
    NOISE_COLOURS,
    Candidate,
    Colour,
    Declared,
    JoinedLayout,
    Projection,
    Records,
    RunRecord,
    ScoredColumns,
    Search,
    Whitener,
    block_length,
    centred_slope,
    columns_of,
    detect,
    detection_limits,
    draw_null,
    flicker_row,
    floor_of,
    gain_of,
    grouped_rows,
    limit_of,
    markov_row,
    project,
    ratio_of,
    records_of,
    residual_log_likelihood,
    score,
    screen,
    singled_out,
    variance_ratio_of,
    view_of_bank,
    without_gaps,
)
from gyrotc.recordings import Rows, load
from numpy.typing import NDArray
from recordings import toml, write_csv
from scipy import stats
from scipy.integrate import dblquad
from scipy.linalg import block_diag, null_space
from scipy.optimize import minimize_scalar
from small_campaign import BLOCK_S, LEVEL_DPH, Campaign, small_campaign, small_records

Array = NDArray[np.float64]
SEED = 20260402
TRUE_COLOUR = 8  # of COLOURS, in which the noise is drawn
PLANTED = {"tau_s": 900.0}


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return small_campaign()


def noise(campaign: Campaign, seed: int) -> Array:
    print("seed", seed)
    whiten = Whitener(NOISE_COLOURS[TRUE_COLOUR], campaign.records.kept, BLOCK_S)
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
    return np.asarray(block_diag(*(NOISE_COLOURS[number].matrix(k, BLOCK_S) for k in search.records.kept)))


def test_a_layout_counts_every_column_once() -> None:
    layout = JoinedLayout.of(3, 5, 2, 0, 4)
    parts = (layout.static, layout.signatures, layout.channels, layout.inputs, layout.beside)
    assert [i for part in parts for i in range(14)[part]] == list(range(14)) and layout.total == 14
    assert layout.held("map and beside").tolist() == [0, 1, 2, 10, 11, 12, 13]
    assert layout.held("beside").tolist() == [10, 11, 12, 13]


def test_the_likelihood_of_a_colour_is_that_of_a_dense_normal_distribution(quiet: Search) -> None:
    """Of the part of the data that no effect reaches, with the noise's scale at its best."""
    free = null_space((all_columns(quiet) @ quiet.effects).T, rcond=1e-9)
    assert free.shape[1] == quiet.freedom
    numbers = [0, 3, TRUE_COLOUR, 14, 20]
    own, expected = [], []
    for number in numbers:
        view, inner = view_of_bank(quiet, number), free.T @ dense(quiet, number) @ free
        normal = stats.multivariate_normal(np.zeros(len(inner)), view.scale**2 * inner)
        best = np.sqrt(free.T @ quiet.y @ np.linalg.solve(inner, free.T @ quiet.y) / quiet.freedom)
        assert view.scale == pytest.approx(best, rel=1e-6)
        own.append(view.log_likelihood)
        expected.append(float(normal.logpdf(free.T @ quiet.y)))
    assert np.diff(own) == pytest.approx(np.diff(expected), abs=1e-3)


def test_the_true_colour_and_level_are_among_those_allowed(quiet: Search, planted: Search) -> None:
    for search in (quiet, planted):
        assert TRUE_COLOUR in search.allowed and search.best in search.allowed
        assert search.views[TRUE_COLOUR].scale == pytest.approx(LEVEL_DPH, rel=4.0 / np.sqrt(2.0 * search.freedom))
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
    views = [view_of_bank(s, planted.best) for s in (planted, moved)]
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
    nothing = limit_of("thermal_gradient", [(Candidate("thermal_gradient", {"tau_s": 100.0}, "columns"), 0.0)])
    assert nothing.value is None and nothing.at == ()
    shown = limit_of("cavity_lag", [(Candidate("cavity_lag", {"tau_s": t}, "input"), t) for t in (10.0, 90.0)])
    assert shown.value == 90.0 and shown.unit == "s", "d is 3.2 and 9.5"


SEED_OF_SCREENS = 20260401


def with_noise(records: Records, seed: int = SEED_OF_SCREENS) -> Records:
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


def test_rows_that_were_left_out_as_outliers_are_a_finding_where_they_are_many(records: Records) -> None:
    """One stretch of motion is one event, however many rows it has."""
    few = Records(tuple(replace(run, read=4000, outliers=(25, 40)) for run in records.runs), records.block_s)
    many = Records(tuple(replace(run, read=4000, outliers=(1,) * 12) for run in records.runs), records.block_s)
    assert screen(few).findings == ()
    [found] = screen(many).findings
    assert found.id == "outliers"
    assert found.parameters == {"count": 12 * len(records.runs), "share": 12 / 4000}


def test_the_share_of_outliers_is_that_of_the_rows_of_the_file(tmp_path: Path) -> None:
    """Rows of 1 s are averaged by ten before the search."""
    rng = np.random.default_rng(20261130)
    time = np.arange(14400.0)
    rate = 0.01 * rng.standard_normal(time.size)
    spikes = np.arange(500, 14000, 900)
    rate[spikes] += 1.0
    write_csv(
        tmp_path / "a.csv", {"time_s": time, "temperature_c": 20.0 + 15.0 * np.sin(time / 2000.0), "rate_dph": rate}
    )
    (tmp_path / "dataset.toml").write_text(toml('file = "a.csv"'), "utf-8")
    found = {f.id: f for f in screen(records_of(load(tmp_path), "train", block_s=10.0, average_s=100.0)).findings}
    assert found["outliers"].parameters == {"count": spikes.size, "share": spikes.size / time.size}


def test_normal_noise_has_no_finding(records: Records) -> None:
    found = screen(records)
    assert found.findings == () and found.sigma is None


def test_noise_that_grows_with_the_rate_becomes_weights(records: Records) -> None:
    runs = []
    for run in records.runs:
        factor = 1.0 + np.abs(centred_slope(run.history))
        runs.append(replace(run, rate_dph=run.rate_dph * factor))
    found = screen(Records(tuple(runs), records.block_s))
    assert "noise_variance" in [f.id for f in found.findings]
    assert found.sigma is not None
    slope = np.abs(records.average([centred_slope(r.history) for r in records.runs]))
    ratio = np.median(found.sigma[slope > 1.5]) / np.median(found.sigma[slope < 0.1])
    assert ratio == pytest.approx(np.median(1.0 + slope[slope > 1.5]), rel=0.25)


def test_a_coarse_thermometer_is_reported_with_its_step(records: Records) -> None:
    runs = [
        replace(r, history=replace(r.history, temperature_c=np.round(2.0 * r.history.temperature_c) / 2.0))
        for r in records.runs
    ]
    findings = {f.id: f.parameters for f in screen(Records(tuple(runs), records.block_s)).findings}
    assert findings["temperature_quantisation"]["step_c"] == pytest.approx(0.5)


def _record(hours: float) -> RunRecord:
    time = np.arange(0.0, 3600.0 * hours, 10.0)
    usable = np.ones(time.size, dtype=bool)
    return RunRecord("a", History(time_s=time, temperature_c=0.0 * time), 0.0 * time, usable)


@pytest.mark.parametrize(
    ("hours", "expected"),
    [
        (50.0, 100.0),  # as asked for
        (10.0, 40.0),  # 36000 s in 1000 blocks, to a whole number of rows
        (1.0, 10.0),  # not shorter than the model's own block
        (200.0, 140.0),  # 720000 s in 5000 blocks
    ],
)
def test_blocks_are_as_long_as_asked_unless_there_would_be_few_or_very_many(hours: float, expected: float) -> None:
    assert block_length([_record(hours)], 10.0, 100.0) == expected


def test_gaps_are_bridged_by_lines_and_fine_rows_are_averaged() -> None:
    time = np.arange(6.0)
    assert without_gaps(time, np.array([np.nan, 1.0, np.nan, 3.0, np.nan, 5.0])).tolist() == [1, 1, 2, 3, 4, 5]
    assert not without_gaps(time, np.full(6, np.nan)).any()
    rows = Rows(time, np.arange(6.0), np.array([1.0, 3.0, 5.0, 100.0, 100.0, 7.0]), {})
    thin, usable = grouped_rows(rows, np.array([True, True, True, False, False, True]), 2)
    assert thin.rate_dph.tolist() == [2.0, 5.0, 7.0] and usable.tolist() == [True, True, True]
    assert not grouped_rows(rows, np.zeros(6, dtype=bool), 2)[1].any()


BLOCK_OF_COLOURS_S = 100.0
BLOCKS = [np.array([0, 1, 2, 3, 5, 6, 9]), np.arange(2, 12)]


@pytest.mark.parametrize("tau_s", [40.0, 400.0, 20000.0])
@pytest.mark.parametrize("lag", [0, 1, 3])
def test_the_covariance_of_markov_block_means_is_the_double_integral(tau_s: float, lag: int) -> None:
    if lag == 0:  # twice the triangle: the kernel has an edge on the diagonal
        value, _ = dblquad(lambda s, t: np.exp(-(t - s) / tau_s), 0.0, BLOCK_OF_COLOURS_S, 0.0, lambda t: t)
        value *= 2.0
    else:
        low = lag * BLOCK_OF_COLOURS_S
        value, _ = dblquad(
            lambda s, t: np.exp(-(t - s) / tau_s), low, low + BLOCK_OF_COLOURS_S, 0.0, BLOCK_OF_COLOURS_S
        )
    assert markov_row(np.array([lag]), BLOCK_OF_COLOURS_S, tau_s)[0] == pytest.approx(
        value / BLOCK_OF_COLOURS_S**2, rel=1e-6
    )


def test_flicker_of_the_declared_instability_has_the_spectrum_b2_over_2_pi_f() -> None:
    declared = Declared(1e-9, bias_instability_dph=2e-3)
    colour = declared.colour(BLOCK_OF_COLOURS_S)
    taus = 100.0 * 4.0 ** np.arange(6)
    middle = 1.0 / (2.0 * np.pi * np.sqrt(taus[2] * taus[3]))
    spectrum = colour.slow * sum(4.0 * t / (1.0 + (2.0 * np.pi * middle * t) ** 2) for t in taus)
    assert spectrum == pytest.approx(2.0 * (2e-3) ** 2 / (2.0 * np.pi * middle), rel=0.05), "one-sided"
    assert flicker_row(np.array([0]), 1e-3)[0] == pytest.approx(6.0, rel=1e-4)


def test_declared_white_noise_and_counts_average_as_they_should() -> None:
    white = Declared(1e-3).colour(BLOCK_OF_COLOURS_S)
    assert np.sqrt(white.white) == pytest.approx(1e-3 * 60.0 / np.sqrt(BLOCK_OF_COLOURS_S))
    counts = Declared(1e-9, quantum_arcsec=0.5).colour(BLOCK_OF_COLOURS_S)
    cov = counts.matrix(np.arange(400), BLOCK_OF_COLOURS_S)
    assert cov.sum() == pytest.approx(2.0 * counts.quantum, rel=1e-3), "the angle is wrong at its two ends only"
    assert counts.quantum * BLOCK_OF_COLOURS_S**2 == pytest.approx(0.5**2 / 12.0)


def test_every_colour_of_the_grid_is_a_covariance() -> None:
    for colour in NOISE_COLOURS:
        assert np.linalg.eigvalsh(colour.matrix(np.arange(150), BLOCK_OF_COLOURS_S))[0] > 0.0


@pytest.mark.parametrize("colour", [NOISE_COLOURS[5], Colour(walk=0.04), Colour(white=0.1, quantum=0.45)])
@pytest.mark.parametrize("even", [True, False])
def test_whitening_is_that_of_the_dense_covariance(colour: Colour, even: bool) -> None:
    rng = np.random.default_rng(3)
    size = sum(b.size for b in BLOCKS)
    sigma = None if even else np.exp(0.3 * rng.standard_normal(size))
    dense = block_diag(*(colour.matrix(b, BLOCK_OF_COLOURS_S) for b in BLOCKS))
    if sigma is not None:
        dense = dense * np.outer(sigma, sigma)
    whiten = Whitener(colour, BLOCKS, BLOCK_OF_COLOURS_S, sigma)
    x = rng.standard_normal((size, 3))
    white = whiten(x)
    assert white.T @ white == pytest.approx(x.T @ np.linalg.solve(dense, x), rel=1e-9)
    assert whiten.back(white) == pytest.approx(np.linalg.solve(dense, x), rel=1e-8)
    assert whiten.log_det == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-12)
    assert whiten(whiten.colour(x)) == pytest.approx(x, abs=1e-10)
    assert whiten(x[:, 0]) == pytest.approx(white[:, 0])


HOURS, AVERAGE_S = 24, 100.0


def residual(values: np.ndarray) -> Averages:
    time = AVERAGE_S * (np.arange(values.size) + 0.5)
    return Averages(time_s=time, before_dph=values, after_dph=values, temperature_c=np.zeros(values.size))


def block_noise(seed: int, scale: float = 1.0) -> np.ndarray:
    return scale * np.random.default_rng(seed).standard_normal(36 * HOURS)


def test_the_share_is_of_what_can_be_removed() -> None:
    wave = np.sin(np.arange(36 * HOURS) / 40.0)
    before, after = residual(block_noise(1) + wave), residual(block_noise(1) + 0.5 * wave)
    gain = gain_of([before], [after], 1.0, AVERAGE_S)
    share = gain.share_of_excess_removed
    assert share == pytest.approx(0.75, abs=0.08), "half of the amplitude, three quarters of the power"
    assert gain.low is not None and gain.high is not None and gain.low < 0.75 < gain.high
    assert gain.shown == "gain"
    removed, angle = gain.rms_removed_dph, gain.angle_1h_removed_arcsec
    assert removed.value == pytest.approx(gain.exam_rms_before_dph - gain.exam_rms_after_dph)
    assert removed.low is not None and removed.high is not None and removed.low < removed.value < removed.high
    assert angle is not None and angle.low is not None and angle.low > 0.0


def test_a_loss_is_no_gain() -> None:
    wave = np.sin(np.arange(36 * HOURS) / 40.0)
    assert gain_of([residual(block_noise(2))], [residual(block_noise(2) + 0.3 * wave)], 1.0, AVERAGE_S).shown == "loss"


def test_without_excess_there_is_no_share() -> None:
    gain = gain_of([residual(block_noise(3))], [residual(block_noise(3))], 1.1, AVERAGE_S)
    assert gain.share_of_excess_removed is None and gain.low is None


def floor(left: np.ndarray, block_s: float) -> float:
    """Noise floor of what is left of a steady temperature, one number for each block."""
    time = block_s * np.arange(left.size, dtype=float)
    history = History(time_s=time, temperature_c=np.full(left.size, 20.0), on_s=None, run=0, runs=1, day=None)
    return floor_of(Records((RunRecord("r", history, left, np.ones(left.size, dtype=bool)),), block_s), left, AVERAGE_S)


def test_slow_changes_and_outliers_are_not_floor() -> None:
    slow = 5.0 * np.sin(np.arange(36 * HOURS) / 300.0)
    spikes = np.zeros(36 * HOURS)
    spikes[::400] = 30.0
    assert floor(block_noise(4) + slow, AVERAGE_S) == pytest.approx(1.0, rel=0.08)
    assert floor(block_noise(4) + spikes, AVERAGE_S) == pytest.approx(1.0, rel=0.08)


@pytest.mark.parametrize("block_s", [10.0, 30.0, 60.0, 90.0, 120.0])
def test_the_floor_is_of_full_means_whatever_the_blocks(block_s: float) -> None:
    """100 s hold one or two means over 60 s: differences of such means made the floor 5 % too large."""
    many = np.concatenate([block_noise(k, np.sqrt(AVERAGE_S / block_s)) for k in range(60)])
    assert floor(many, block_s) == pytest.approx(1.0, rel=0.025)


def test_a_short_exam_has_an_interval() -> None:
    before, after = residual(block_noise(5)[:12] + 5.0), residual(block_noise(5)[:12])
    gain = gain_of([before], [after], 1.0, AVERAGE_S)
    low, high = gain.rms_removed_dph.low, gain.rms_removed_dph.high
    assert low is not None and high is not None and low < high, "twelfths where there is no half-hour"
    assert gain.angle_1h_removed_arcsec is None, "no run lasts an hour"


def test_figures_before_and_after_are_each_of_their_own_residuals() -> None:
    """Residuals of 5 and of 2 deg/h, an hour of which is 5 and 2 times 3600 arcsec."""
    hours = np.ones(36 * HOURS)
    gain = gain_of([residual(5.0 * hours)], [residual(2.0 * hours)], 1.0, AVERAGE_S)
    assert (gain.exam_rms_before_dph, gain.exam_rms_after_dph) == pytest.approx((5.0, 2.0))
    assert (gain.rms_30min_before_dph, gain.rms_30min_after_dph) == pytest.approx((5.0, 2.0))
    assert (gain.angle_1h_before_arcsec, gain.angle_1h_after_arcsec) == pytest.approx((18000.0, 7200.0))
    assert gain.rms_removed_dph.value == pytest.approx(3.0)
    assert gain.angle_1h_removed_arcsec is not None and gain.angle_1h_removed_arcsec.value == pytest.approx(10800.0)


def test_no_gain_is_seldom_taken_for_one() -> None:
    """The lower limit is that of 95 %: of 200 pairs of equally large noise 2.5 % are to seem a gain, and chance."""
    found = [
        gain_of([residual(block_noise(100 + k))], [residual(block_noise(1000 + k))], 1.0, AVERAGE_S).shown
        for k in range(200)
    ]
    assert 0 < found.count("gain") <= 15, found.count("gain")
