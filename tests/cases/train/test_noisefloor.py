"""Noise terms found again, slopes of a plane, coverage and uncertainty of a fit."""

from __future__ import annotations

from dataclasses import replace

import allantools
import numpy as np
import pytest
from gyrotc.train import (
    TrainingData,
    allan_variance,
    coverage,
    fit,
    noise_terms,
    sensitivities,
    stretches,
    uncertainty_of,
)
from numpy.typing import NDArray
from training_data import samples

SEED = 20260302
STEP_S = 10.0


def runs(n: int = 6, rows: int = 5000) -> list[np.ndarray]:
    rng = np.random.default_rng(SEED)
    return [rng.normal(0.0, 1.0, rows) for _ in range(n)]


def test_white_noise_is_angle_random_walk_alone() -> None:
    arw = 0.002
    sigma = arw / np.sqrt(STEP_S / 3600.0)
    terms = noise_terms([sigma * r for r in runs()], STEP_S)
    assert terms.arw_deg_per_sqrt_h == pytest.approx(arw, rel=0.03), f"seed {SEED}"
    assert terms.bias_instability_dph is not None and terms.bias_instability_dph < 0.05 * sigma
    assert terms.allan[0].deviation_dph == pytest.approx(sigma, rel=0.02)


def test_rate_random_walk_is_found_beside_white_noise() -> None:
    arw, walk = 0.002, 0.5
    sigma = arw / np.sqrt(STEP_S / 3600.0)
    rng = np.random.default_rng(SEED)
    step = walk * np.sqrt(STEP_S / 3600.0)
    made = [sigma * r + np.cumsum(rng.normal(0.0, step, len(r))) for r in runs()]
    terms = noise_terms(made, STEP_S)
    assert terms.rate_random_walk_dph_per_sqrt_h == pytest.approx(walk, rel=0.15), f"seed {SEED}"


def test_quantisation_is_found() -> None:
    quantum = 0.5  # arcsec
    rng = np.random.default_rng(SEED)
    angle = np.cumsum(rng.normal(0.3, 0.02, 20001)) * STEP_S
    counted = quantum * np.floor(angle / quantum + rng.random(len(angle)))
    rate = np.diff(counted - angle) / STEP_S
    terms = noise_terms([rate], STEP_S)
    # A dithered floor has an error of variance q²/6, twice that of rounding: Q = q/√6.
    assert terms.quantisation_arcsec == pytest.approx(quantum / np.sqrt(6.0), rel=0.05), f"seed {SEED}"


@pytest.mark.parametrize(("lengths", "walk"), [((1800,), 0.01), ((360,) * 6, 0.03)])
def test_a_term_that_is_not_resolved_lies_below_its_limit(lengths: tuple[int, ...], walk: float) -> None:
    """95 of 100 records with a random walk that some of them show and some do not."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    sigma, step = 0.002 / np.sqrt(STEP_S / 3600.0), walk * np.sqrt(STEP_S / 3600.0)
    wrong = 0
    for _ in range(100):
        made = [rng.normal(0.0, sigma, n) + np.cumsum(rng.normal(0.0, step, n)) for n in lengths]
        terms = noise_terms(made, STEP_S)
        limit = terms.below.rate_random_walk_dph_per_sqrt_h
        assert (limit is None) == bool(terms.rate_random_walk_dph_per_sqrt_h), "a value, or a limit"
        wrong += limit is not None and walk > limit
    assert wrong <= 5


def test_terms_scale_with_the_rate() -> None:
    one = noise_terms(runs(2), STEP_S)
    ten = noise_terms([10.0 * r for r in runs(2)], STEP_S)
    assert ten.arw_deg_per_sqrt_h == pytest.approx(10.0 * (one.arw_deg_per_sqrt_h or 0.0))


def test_the_deviation_is_that_of_allantools() -> None:
    """Of a stretch with white noise, a walk and a mean far from 0, whose length is no power of two."""
    rng = np.random.default_rng(SEED)
    rate = 30.0 + rng.normal(0.0, 1.0, 1237) + np.cumsum(rng.normal(0.0, 0.1, 1237))
    points = allan_variance([rate], STEP_S)
    taus, expected, _, pairs = allantools.oadev(
        rate, rate=1.0 / STEP_S, data_type="freq", taus=[point.tau_s for point in points]
    )
    assert [p.tau_s for p in points] == taus.tolist() == [STEP_S * 2**k for k in range(len(points))]
    assert [p.deviation_dph for p in points] == pytest.approx(expected.tolist(), rel=1e-9), f"seed {SEED}"
    assert [p.freedom * p.tau_s / STEP_S for p in points] == pytest.approx(pairs.tolist())


def test_stretches_are_not_joined() -> None:
    far = [np.full(100, 1.0), np.full(100, 1000.0)]
    assert all(point.deviation_dph == 0.0 for point in allan_variance(far, STEP_S))


def test_stretches_end_at_gaps_and_runs() -> None:
    time = np.array([0.0, 10.0, 20.0, 40.0, 50.0, 0.0, 10.0])
    run = np.array([0, 0, 0, 0, 0, 1, 1])
    parts = stretches(np.arange(7.0), time, run, STEP_S)
    assert [p.tolist() for p in parts] == [[0.0, 1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]


def test_a_short_record_has_no_terms() -> None:
    terms = noise_terms([np.zeros(5)], STEP_S)
    assert terms.arw_deg_per_sqrt_h is None
    assert terms.allan == ()


def test_sensitivities_of_a_plane() -> None:
    rng = np.random.default_rng(SEED)
    t, r = rng.uniform(-40.0, 60.0, 500), rng.uniform(-5.0, 5.0, 500)
    found = sensitivities(t, r, 0.007 + 1e-5 * t - 2e-4 * r, rng.uniform(1.0, 5.0, 500))
    assert found.bias_dph_per_c == pytest.approx(1e-5)
    assert found.bias_dph_per_c_per_min == pytest.approx(-2e-4)
    assert found.residual_rms_dph == pytest.approx(0.0, abs=1e-12)


def test_a_constant_temperature_has_no_slope() -> None:
    found = sensitivities(np.full(50, 25.0), np.zeros(50), np.arange(50.0), np.ones(50))
    assert found.bias_dph_per_c is None
    assert found.bias_dph_per_c_per_min is None
    assert found.residual_rms_dph == pytest.approx(np.arange(50.0).std())


def cells_of(data: TrainingData, found: object, cells: tuple[int, int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cell of T and of dT/dt of every sample, by the formula of docs/numerics.md."""
    spans = (found.envelope["temperature_c"], found.envelope["slope_c_per_min"])  # type: ignore[attr-defined]
    values = (data.temperature_c, data.slope_c_per_min)
    index = [
        np.minimum(np.floor((x - low) * n / (high - low)).astype(np.int64), n - 1)
        for x, (low, high), n in zip(values, spans, cells, strict=True)
    ]
    return index[0], index[1]


def test_coverage_marks_the_cells_that_hold_samples() -> None:
    data = samples(0)
    found = fit(data)
    mapped = coverage(data, found)
    assert mapped["cells"] == [32, 12]
    t, r = cells_of(data, found, (32, 12))
    seen = np.zeros((12, 32), dtype=bool)
    seen[r, t] = True
    assert [[c == "1" for c in row] for row in mapped["rows"]] == seen.tolist()
    assert not seen.all()


def test_coverage_has_cells_however_narrow_the_envelope_is() -> None:
    """Half a degree and half a degree a minute."""
    data = samples(0)
    narrow = replace(data, temperature_c=20.0 + 0.005 * data.temperature_c, slope_c_per_min=0.05 * data.slope_c_per_min)
    found = fit(narrow, method="linear")
    spans = (found.scaling.slope_c_per_min, found.scaling.temperature_c)
    seen, *_ = np.histogram2d(narrow.slope_c_per_min, narrow.temperature_c, bins=(12, 32), range=spans)
    rows = coverage(narrow, found)["rows"]
    assert [[cell == "1" for cell in row] for row in rows] == (seen > 0).tolist()
    assert all(high - low < 1.0 for low, high in spans)


def test_where_no_sample_was_it_is_larger() -> None:
    """A ramp that never cooled: on the other side of dT/dt nothing is known."""
    data = samples(1)
    up = data.select((data.slope_c_per_min > -0.1) | (data.temperature_c < -30.0))
    found = fit(up)
    known = uncertainty_of(up, found, (12, 8))
    t, r = cells_of(up, found, (12, 8))
    seen = np.zeros((8, 12), dtype=bool)
    seen[r, t] = True
    between = known["rules"]["between_dph"]
    uncovered, covered = (np.sqrt(np.array(known[name]) ** 2 - between**2) for name in ("uncovered", "rows"))
    assert np.median(uncovered[~seen]) > 1.1 * np.median(covered[seen])


def test_offsets_between_runs_are_part_of_it() -> None:
    """Runs that differ by 3e-4 deg/h: the next run will differ, too."""
    runs = []
    rng = np.random.default_rng(2)
    for k in range(8):
        one = samples(20 + k, hours=2.0)
        one = one.select(one.run == 1 + k % 2)
        offset = rng.normal(0.0, 3e-4)
        runs.append(replace(one, run=np.full(len(one), k), bias_dph=one.bias_dph + offset))
    data = TrainingData(**{k: np.concatenate([getattr(x, k) for x in runs]) for k in TrainingData.__dataclass_fields__})
    sigma = np.array(uncertainty_of(data, fit(data))["rows"])
    assert 1e-4 < np.median(sigma) < 8e-4, "3e-4, as eight of them tell it"


def test_a_single_run_states_the_uncertainty_of_its_map() -> None:
    data = samples(3)
    one = data.select(data.run == 1)
    sigma = np.array(uncertainty_of(one, fit(one), (4, 3))["rows"])
    assert sigma.shape == (3, 4)
    assert np.isfinite(sigma).all()
    assert (sigma > 0.0).all()
