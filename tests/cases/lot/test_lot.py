"""A lot: what is learnt from units that share directions, what a new unit gains, who does not belong."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from gyrotc.common import InputError
from gyrotc.jobs import checksum_of, lot_from
from gyrotc.results import Lot, LotCluster
from gyrotc.train import TrainingData, coverage, fit, predict, uncertainty_of
from gyrotc.train.prior import (
    FALSE_ALARM,
    PRIOR_LOG,
    Learned,
    LotPrior,
    PriorBasis,
    UnitMeans,
    evidence,
    fitted,
    learn_prior,
    p_value,
    prior_of,
    scores,
    sums_of,
)
from numpy.typing import NDArray
from scipy.stats import kstest, multivariate_normal

Floats = NDArray[np.float64]

ENVELOPE = ((-40.0, 60.0), (-2.4, 2.4))
NOISE = 7e-4  # deg/h of a mean of 50 s


def shared(t: Floats, r: Floats) -> Floats:
    """What units have in common, deg/h."""
    return 7e-3 + 1e-3 * np.tanh((t - 15.0) / 25.0) - 6e-4 * np.exp(-(((t - 20.0) / 30.0) ** 2)) + 2e-4 * r


def unit_map(rng: np.random.Generator, spread: float, other: float = 0.0) -> list[float]:
    """What a unit's own is: offset, slope, wave, rate; `other` shifts it to another cluster."""
    return [*(spread * rng.normal(size=4)), other]


def bias(own: list[float], t: Floats, r: Floats) -> Floats:
    offset, slope, wave, rate, other = own
    x = (t - 10.0) / 50.0
    return shared(t, r) + offset + slope * x + wave * np.sin(2.5 * x) + rate * r + other * np.cos(3.0 * x)


def calibrated(rng: np.random.Generator, own: list[float], n: int = 300) -> UnitMeans:
    """A unit with means all over the envelope."""
    t, r = rng.uniform(*ENVELOPE[0], n), rng.uniform(*ENVELOPE[1], n)
    count = rng.integers(1, 8, n).astype(float)
    return UnitMeans(t, r, bias(own, t, r) + NOISE * rng.normal(size=n) / np.sqrt(count), count, NOISE)


def short_run(rng: np.random.Generator, own: list[float]) -> TrainingData:
    """A rest, a ramp up, a rest, a ramp down: 100 samples of 50 s."""
    t = np.concatenate([np.full(15, 0.0), np.linspace(0, 60, 15), np.full(40, 60.0), np.linspace(60, -40, 30)])
    t = t + 0.05 * rng.normal(size=len(t))
    r = np.clip(np.gradient(t) * 1.2, -2.4, 2.4)
    n = len(t)
    measured = bias(own, t, r) + NOISE * rng.normal(size=n)
    return TrainingData(
        t, r, measured, np.full(n, 5.0), np.zeros(n, dtype=np.int64), 50.0 * np.arange(n), np.full(n, 50.0)
    )


def lot_of(units: list[UnitMeans]) -> tuple[Lot, Learned]:
    found = learn_prior(units, ENVELOPE, lambda *_: None)
    return lot_from([(f"U{k}", "0" * 64) for k in range(len(units))], units, found, ENVELOPE), found


@cache
def family(seed: int, spread: float = 2e-4, units: int = 24) -> tuple[Lot, LotPrior, Learned]:
    rng = np.random.default_rng(seed)
    lot, found = lot_of([calibrated(rng, unit_map(rng, spread)) for _ in range(units)])
    return lot, prior_of(lot), found


def test_evidence_is_that_of_the_normal_distribution_of_the_recordings() -> None:
    """Against scipy's density of the recordings themselves."""
    rng = np.random.default_rng(3)
    basis = PriorBasis.over(*ENVELOPE)
    basis = basis.only(np.arange(93) < 9)
    units = [calibrated(rng, unit_map(rng, 1e-4), 30) for _ in range(2)]
    sums = sums_of(units, basis, 7e-3, 1e-3)
    mean, factor = 0.1 * rng.normal(size=9), 0.3 * rng.normal(size=(9, 9))
    covariance = factor @ factor.T + 0.01 * np.eye(9)
    known = []
    for u in units:
        values = basis.values(u.temperature_c, u.slope_c_per_min)
        noise = np.diag((u.sigma_dph / 1e-3) ** 2 / u.count)
        y = (u.bias_dph - 7e-3) / 1e-3
        full = multivariate_normal.logpdf(y, values @ mean, values @ covariance @ values.T + noise)
        known.append(full - multivariate_normal.logpdf(y, np.zeros(30), noise))
    assert evidence(sums, mean, covariance) == pytest.approx(known, rel=1e-9)
    state = fitted(sums, basis, 0, np.zeros(2, dtype=np.int64), 0)
    wide = np.diag(basis.variance(state.of_mean))
    own = np.diag(basis.variance(state.rest))
    values = [basis.values(u.temperature_c, u.slope_c_per_min) for u in units]
    y = np.concatenate([(u.bias_dph - 7e-3) / 1e-3 for u in units])
    noise = np.diag(np.concatenate([(u.sigma_dph / 1e-3) ** 2 / u.count for u in units]))
    both = np.block([[a @ (wide + (own if a is b else 0.0)) @ b.T for b in values] for a in values])
    total = multivariate_normal.logpdf(y, np.zeros(60), both + noise) - multivariate_normal.logpdf(
        y, np.zeros(60), noise
    )
    assert state.evidence == pytest.approx(total, rel=1e-7)


def test_what_a_power_on_has_of_its_own_is_no_part_of_the_map() -> None:
    """Against scipy's density of recordings whose offset and line over T scatter from power-on to power-on."""
    rng = np.random.default_rng(4)
    basis = PriorBasis.over(*ENVELOPE)
    basis = basis.only(np.arange(93) < 9)
    unit = replace(calibrated(rng, unit_map(rng, 1e-4), 30), power_on=np.repeat([3, 5], 15))
    own, mean, covariance = np.array([0.3, 0.1]), 0.1 * rng.normal(size=9), 0.04 * np.eye(9)
    values = basis.values(unit.temperature_c, unit.slope_c_per_min)
    same = np.kron(np.eye(2), np.ones((15, 15)))
    noise = np.diag((unit.sigma_dph / 1e-3) ** 2 / unit.count) + same * ((values[:, :2] * own) @ values[:, :2].T)
    y = (unit.bias_dph - 7e-3) / 1e-3
    full = multivariate_normal.logpdf(y, values @ mean, values @ covariance @ values.T + noise)
    known = full - multivariate_normal.logpdf(y, np.zeros(30), noise)
    assert evidence(sums_of([unit], basis, 7e-3, 1e-3, own), mean, covariance) == pytest.approx([known], rel=1e-9)


def test_one_power_on_tells_the_constant_no_better_than_power_ons_repeat() -> None:
    """Error of the map's mean over its 1 sigma, for units of a lot whose power-ons scatter by four times the noise."""
    lot, _, _ = family(11)
    prior, rng = prior_of(lot.model_copy(update={"between_dph": 3e-4})), np.random.default_rng(31)
    t, r = (x.ravel() for x in np.meshgrid(np.linspace(-39, 59, 15), np.linspace(-2.3, 2.3, 5)))
    ratios = []
    for _ in range(40):
        own = unit_map(rng, 2e-4)
        run = calibrated(rng, own, 100)
        run = replace(run, bias_dph=run.bias_dph + 3e-4 * rng.normal(), power_on=np.zeros(100, dtype=np.int64))
        found = prior.with_runs(run)
        error = np.mean(found.mean_dph(t, r) - bias(own, t, r))
        mean_of_map = np.mean(prior.basis.values(t, r), axis=0)
        ratios.append(error / (prior.unit_dph * np.sqrt(mean_of_map @ found.covariance @ mean_of_map)))
    assert 0.75 < np.sqrt(np.mean(np.square(ratios))) < 1.25


def test_each_further_round_raises_the_evidence() -> None:
    rng = np.random.default_rng(5)
    units = [calibrated(rng, unit_map(rng, 3e-4)) for _ in range(10)]
    basis = PriorBasis.over(*ENVELOPE)
    sums, together = sums_of(units, basis, 7e-3, 1e-3), np.zeros(10, dtype=np.int64)
    found = [fitted(sums, basis, 0, together, rounds).evidence for rounds in (0, 3, 8, 16)]
    assert found == sorted(found)
    assert fitted(sums, basis, 1, together, 16).evidence > found[-1] - 1.0


def test_a_unit_with_one_run_gains_what_its_lot_knows() -> None:
    _, prior, _ = family(11)
    rng = np.random.default_rng(13)
    t, r = (x.ravel() for x in np.meshgrid(np.linspace(-39, 59, 30), np.linspace(-2.3, 2.3, 9)))
    errors, inside = [], []
    for _ in range(8):
        own = unit_map(rng, 2e-4)
        data = short_run(rng, own)
        with_lot, alone = fit(data, method="auto", prior=prior), fit(data, method="mrbf")
        assert with_lot.lot is not None
        if not with_lot.lot.accepted:
            continue
        truth = bias(own, t, r)
        left = predict(with_lot, t, r) - truth
        errors.append((np.std(left) / np.std(predict(alone, t, r) - truth), np.sqrt(np.mean(left**2))))
        known = uncertainty_of(data, with_lot)
        sigma = np.sqrt(np.mean(np.square(known["rows"])))
        inside.append(errors[-1][1] / sigma)
        assert with_lot.scaling.temperature_c[0] <= -40.0 and with_lot.scaling.slope_c_per_min == ENVELOPE[1]
        assert 0.0 < (with_lot.lot.own_share or 0.0) < 1.0
        assert with_lot.lot.sigma_dph < with_lot.lot.prior_sigma_dph
    assert len(errors) >= 6
    assert np.median([e for e, _ in errors]) < 0.9
    assert 0.4 < np.median(inside) < 2.0  # the table's sigma is of the size of the error


def test_scores_of_the_lots_own_units_are_as_expected() -> None:
    """p-values of units drawn from the prior itself are uniform, whatever their runs tell."""
    _, prior, _ = family(11)
    rng = np.random.default_rng(12)
    data = short_run(rng, unit_map(rng, 0.0))
    values = prior.basis.values(data.temperature_c, data.slope_c_per_min) * prior.lot.unit_dph / NOISE
    precision = values.T @ values
    factor = np.linalg.cholesky(prior.covariances[0])
    found = []
    for _ in range(300):
        w = prior.means[0] + factor @ rng.normal(size=len(factor))
        moment = precision @ w + values.T @ rng.normal(size=len(values))
        found.append(p_value(*scores(precision, moment, prior.means[0], np.linalg.cholesky(prior.covariances[0]))))
    assert kstest(found, "uniform").pvalue > 1e-3


def test_a_stranger_is_reported_and_calibrated_without_the_lot() -> None:
    _, prior, _ = family(11)
    rng = np.random.default_rng(22)
    data = short_run(rng, [2e-3, -2e-3, 1e-3, 0.0, 1e-3])
    with_lot, alone = fit(data, method="auto", prior=prior), fit(data, method="auto")
    assert with_lot.lot is not None and not with_lot.lot.accepted and with_lot.lot.p_value < 0.01
    assert "not_of_its_lot" in [f["id"] for f in with_lot.findings]
    assert with_lot.networks == alone.networks and with_lot.method == alone.method
    assert coverage(data, with_lot) == coverage(data, alone)


@pytest.mark.parametrize(("distance", "accepted"), [(0.25, True), (0.29, False)])
def test_one_in_a_hundred_of_its_units_is_a_stranger_to_a_lot(distance: float, accepted: bool) -> None:
    _, prior, _ = family(11)
    own = distance * np.array([2e-3, -2e-3, 1e-3, 0.0, 1e-3])
    found = fit(short_run(np.random.default_rng(22), own.tolist()), method="auto", prior=prior)
    assert found.lot is not None and FALSE_ALARM == 0.01
    assert 0.003 < found.lot.p_value < 0.03, "the case is near the threshold"
    assert found.lot.accepted == (found.lot.p_value >= 0.01) == accepted
    assert ("not_of_its_lot" in [f["id"] for f in found.findings]) != accepted


def test_without_a_family_the_prior_is_wide_and_says_so() -> None:
    rng = np.random.default_rng(31)
    units = []
    for _ in range(20):
        own = unit_map(rng, 1e-3)
        u = calibrated(rng, own)
        units.append(replace(u, bias_dph=u.bias_dph - shared(u.temperature_c, u.slope_c_per_min) + 7e-3))
    lot, found = lot_of(units)
    assert "no family" in lot.text
    assert prior_of(lot).alone().rms_sigma_dph() > 5e-4
    assert len(found.state.means) == 1


def test_two_clusters_are_found_and_a_unit_goes_to_its_own() -> None:
    rng = np.random.default_rng(71)
    side = np.arange(20) % 2
    lot, found = lot_of([calibrated(rng, unit_map(rng, 1e-4, 3e-3 * (s - 0.5))) for s in side])
    assert len(lot.clusters) == 2 and "2 clusters" in lot.text
    assert abs(np.corrcoef(found.state.cluster, side[found.inside])[0, 1]) > 0.99
    prior = prior_of(lot)
    own = unit_map(rng, 1e-4, 1.5e-3)
    data = short_run(rng, own)
    use = fit(data, method="auto", prior=prior).lot
    assert use is not None and use.cluster == found.state.cluster[int(np.argmax(side == 1))]


def test_a_unit_that_stands_apart_is_set_aside_and_named() -> None:
    rng = np.random.default_rng(41)
    units = [calibrated(rng, unit_map(rng, 1e-4)) for _ in range(15)]
    units[4] = calibrated(rng, [3e-3, 2e-3, -2e-3, 0.0, 0.0])
    lot, found = lot_of(units)
    assert not found.inside[4] and found.inside.sum() >= 13
    assert lot.units[4].cluster is None and "U4" in lot.text


@pytest.mark.parametrize(("distance", "inside"), [(5.5, True), (6.0, False)])
def test_of_twenty_units_one_is_set_aside_at_a_twentieth_of_the_level(distance: float, inside: bool) -> None:
    """The level of 1 % is that of a lot, not of each of its units: one of a hundred clean units is below it."""
    rng = np.random.default_rng(41)
    units = [calibrated(rng, unit_map(rng, 2e-4)) for _ in range(20)]
    units[4] = calibrated(rng, [0.0, 2e-4 * distance, -2e-4 * distance, 0.0, 1e-4 * distance])
    _, found = lot_of(units)
    assert 1e-4 < found.p_values[4] < 0.005, "a single unit as far away would be set aside"
    assert found.inside[4] == (found.p_values[4] >= 0.01 / 20) == inside
    assert np.delete(found.inside, 4).all()


def test_a_lot_of_few_units_knows_its_mean_badly() -> None:
    few, many = family(51, units=4)[1], family(51, units=40)[1]
    assert few.alone().rms_sigma_dph() > many.alone().rms_sigma_dph()


def test_the_same_units_give_the_same_file() -> None:
    rng = np.random.default_rng(61)
    units = [calibrated(rng, unit_map(rng, 2e-4)) for _ in range(6)]
    one, other = lot_of(units)[0], lot_of(units)[0]
    assert one.content() == other.content() and one.checksum == checksum_of(one)


@pytest.mark.parametrize("part", ["mean", "covariance", "occupancy", "units"])
def test_a_file_that_contradicts_itself_is_refused(part: str) -> None:
    lot = family(11)[0]
    cluster = lot.clusters[0]
    broken: dict[str, Lot] = {
        "mean": lot.model_copy(update={"clusters": (cluster.model_copy(update={"mean": cluster.mean[1:]}),)}),
        "covariance": lot.model_copy(update={"clusters": (_negative(cluster),)}),
        "occupancy": lot.model_copy(update={"occupancy": ((0.0, 0.0), (0.0, 0.0))}),
        "units": lot.model_copy(update={"clusters": (cluster.model_copy(update={"units": 0}),)}),
    }
    with pytest.raises(InputError, match=r"lot\.json, (clusters|occupancy)"):
        prior_of(broken[part])


def _negative(cluster: LotCluster) -> LotCluster:
    rows = [list(row) for row in cluster.covariance]
    rows[0][0] = -1e6
    return cluster.model_copy(update={"covariance": tuple(tuple(row) for row in rows)})


def test_the_search_for_a_process_finds_the_process() -> None:
    basis = PriorBasis.over(*ENVELOPE)
    truth = PRIOR_LOG + np.array([0.3, -0.4, 0.2, 0.3, -0.1, 0.5, 0.2, -0.2, 0.1])
    found = basis.fitted_parameters(basis.variance(truth), 1e6, PRIOR_LOG)
    for _ in range(5):  # each search goes on where the last one ended
        found = basis.fitted_parameters(basis.variance(truth), 1e6, found)
    np.testing.assert_allclose(basis.variance(found)[:20], basis.variance(truth)[:20], rtol=0.02)
