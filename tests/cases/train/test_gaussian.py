"""The Gaussian model of the map against dense matrices: evidence, gradient, posterior, what is left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from gyrotc.train import Basis, GaussianMap, Structure, Sums, VarianceSearch
from numpy.typing import NDArray

Floats = NDArray[np.float64]
POWER_ONS = 4
WHITE = 0.1
STRUCTURES = [
    Structure(columns, own) for columns, own in [(1, 0), (1, 1), (5, 0), (5, 1), (5, 5), (93, 0), (93, 1), (93, 5)]
]


@dataclass
class Means:
    """Means of four power-ons of very different length, each with an offset and a slope of its own."""

    t: Floats
    r: Floats
    y: Floats
    weight: Floats
    power_on: NDArray[np.int64]

    @property
    def basis(self) -> Basis:
        return Basis.over(self.t, self.r)

    def sums(self, columns: int, kept: NDArray[np.bool_] | None = None) -> list[Sums]:
        kept = np.ones(len(self.t), dtype=bool) if kept is None else kept
        x = self.basis.columns(self.t, self.r, columns)
        own = [kept & (self.power_on == g) for g in range(POWER_ONS)]
        return [Sums.over(x[m], self.y[m], self.weight[m]) for m in own if m.any()]


def means(seed: int) -> Means:
    rng = np.random.default_rng(seed)
    power_on = np.repeat(np.arange(POWER_ONS), [20, 40, 60, 5])
    n = len(power_on)
    t, r = rng.uniform(-1.0, 1.0, (2, n))
    y = np.sin(3.0 * t) + 0.3 * r * t + (0.4 * rng.normal(size=POWER_ONS))[power_on]
    y += (0.2 * rng.normal(size=POWER_ONS))[power_on] * t + rng.normal(0.0, WHITE, n)
    return Means(t, r, y, rng.uniform(0.5, 2.0, n), power_on)


def density(size: float, scale: float, n: int, reach: float) -> Floats:
    w = np.pi * np.arange(1, n + 1) / (2.0 * reach)
    return np.asarray(size**2 * np.sqrt(2.0 * np.pi) * scale * np.exp(-0.5 * (scale * w) ** 2))


def prior_variance(structure: Structure, p: Floats, basis: Basis) -> Floats:
    variance = [100.0]
    if structure.columns >= 5:
        variance += list(np.exp(2.0 * p[[0, 1, 1, 2]]))
    if structure.columns > 5:
        of_t = density(np.exp(p[3]), np.exp(p[4]), 40, basis.reach_t)
        coupled = np.outer(
            density(np.exp(p[5]), np.exp(p[6]), 8, basis.reach_t), density(1.0, np.exp(p[7]), 6, basis.reach_r)
        )
        variance += [*of_t, *coupled.ravel()]
    return np.array(variance) + 1e-10


def prior_of_logarithms(structure: Structure) -> tuple[Floats, Floats]:
    """As docs/training.md, section 1, has them."""
    mean, sd = [], []
    if structure.columns >= 5:
        mean, sd = [0.0, -1.0, -2.0], [1.0, 1.0, 1.0]
    if structure.columns > 5:
        mean += list(np.log([0.3, 0.15, 0.3, 0.8, 0.8]))
        sd += [1.5, 0.7, 1.5, 0.5, 0.5]
    own = {0: 0, 1: 1, 5: 4}[structure.own]
    return (
        np.array(mean + own * [np.log(0.3 * WHITE)] + [np.log(WHITE)]),
        np.array(sd + own * [2.0] + [1.0]),
    )


@dataclass
class Dense:
    """The same model by the covariance of all means."""

    structure: Structure
    data: Means
    p: Floats
    kept: NDArray[np.bool_]

    @property
    def columns(self) -> Floats:
        return self.data.basis.columns(self.data.t, self.data.r, self.structure.columns)

    @property
    def covariance(self) -> Floats:
        x, s = self.columns, self.structure
        common = (x * prior_variance(s, self.p, self.data.basis)) @ x.T
        at = len(self.p) - 1 - {0: 0, 1: 1, 5: 4}[s.own]
        scatter = np.exp(2.0 * self.p[at:-1])[[0, 1, 2, 2, 3][: s.own]]
        of_own = (x[:, : s.own] * scatter) @ x[:, : s.own].T
        own = of_own * np.equal.outer(self.data.power_on, self.data.power_on)
        total = common + own + np.diag(np.exp(2.0 * self.p[-1]) / self.data.weight)
        return np.asarray(total[np.ix_(self.kept, self.kept)])

    def objective(self) -> float:
        y = self.data.y[self.kept]
        mean, sd = prior_of_logarithms(self.structure)
        value = 0.5 * y @ np.linalg.solve(self.covariance, y) + 0.5 * np.linalg.slogdet(self.covariance)[1]
        return float(value + 0.5 * np.sum(((self.p - mean) / sd) ** 2))

    def map(self) -> tuple[Floats, Floats]:
        """Mean and covariance of the common map at the means."""
        x = self.columns
        prior = (x * prior_variance(self.structure, self.p, self.data.basis)) @ x.T
        cross = prior[:, self.kept]
        gain = np.linalg.solve(self.covariance, cross.T).T
        return gain @ self.data.y[self.kept], prior - gain @ cross.T


def parameters(structure: Structure, seed: int) -> Floats:
    mean, _ = prior_of_logarithms(structure)
    return np.asarray(mean + 0.5 * np.random.default_rng(seed).normal(size=len(mean)))


@pytest.mark.parametrize("structure", STRUCTURES, ids=str)
def test_the_objective_is_the_negative_log_posterior_and_the_gradient_its_slope(structure: Structure) -> None:
    """Differences between points: a constant is free."""
    data = means(1)
    search = VarianceSearch(structure, data.basis, data.sums(structure.columns), WHITE)
    points = [parameters(structure, seed) for seed in range(3)]
    found = [search.objective(p)[0] for p in points]
    everything = np.ones(len(data.t), dtype=bool)
    expected = [Dense(structure, data, p, everything).objective() for p in points]
    np.testing.assert_allclose(np.diff(found), np.diff(expected), rtol=1e-6, atol=1e-6)
    step = 1e-5 * np.eye(len(points[0]))
    slope = [(search.objective(points[0] + e)[0] - search.objective(points[0] - e)[0]) / 2e-5 for e in step]
    np.testing.assert_allclose(search.objective(points[0])[1], slope, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("structure", STRUCTURES, ids=str)
def test_mean_and_covariance_are_those_of_the_dense_posterior(structure: Structure) -> None:
    data, p = means(2), parameters(structure, 7)
    found = GaussianMap(structure, data.basis, tuple(data.sums(structure.columns)), p, 0.0, 0)
    mean, covariance = Dense(structure, data, p, np.ones(len(data.t), dtype=bool)).map()
    np.testing.assert_allclose(found.mean(data.t, data.r), mean, atol=1e-7)
    roots = found.roots(data.t, data.r)[:, : structure.columns]
    np.testing.assert_allclose(roots @ roots.T, covariance, atol=1e-6 * np.abs(covariance).max())


@pytest.mark.parametrize("structure", STRUCTURES, ids=str)
@pytest.mark.parametrize("piece", ["a power-on", "part of one"])
def test_a_piece_that_is_left_out_by_subtraction_is_left_out(structure: Structure, piece: str) -> None:
    data, p = means(3), parameters(structure, 8)
    out = data.power_on == 1
    if piece == "part of one":
        out &= np.arange(len(out)) < 40
    found = GaussianMap(structure, data.basis, tuple(data.sums(structure.columns)), p, 0.0, 0)
    x = data.basis.columns(data.t, data.r, structure.columns)
    left = found.without(1, Sums.over(x[out], data.y[out], data.weight[out]))
    np.testing.assert_allclose(x @ left, Dense(structure, data, p, ~out).map()[0], atol=1e-6)


def test_what_a_power_on_has_of_its_own_is_found_and_taken_off_the_noise() -> None:
    """Offsets of four times the noise: without intercepts they are noise or map."""
    data = means(4)
    with_own = VarianceSearch(Structure(93, 5), data.basis, data.sums(93), WHITE).best()
    without = VarianceSearch(Structure(93, 0), data.basis, data.sums(93), WHITE).best()
    assert with_own.sigma == pytest.approx(WHITE, rel=0.2)
    assert without.sigma > 2.0 * WHITE
    assert 0.1 < np.sqrt(with_own.scatter[0]) < 1.6, "0.4, as four power-ons tell it"


def test_the_search_ends_no_worse_than_many_starts_do() -> None:
    """Ripple and trend together: two starts of the short scale are what the search has."""
    rng = np.random.default_rng(11)
    t, r = np.sort(rng.uniform(-1.0, 1.0, 400)), rng.uniform(-1.0, 1.0, 400)
    y = np.sin(2.0 * t) + 0.4 * np.cos(2.0 * np.pi * t / 0.22) + rng.normal(0.0, 0.3, 400)
    basis = Basis.over(t, r)
    search = VarianceSearch(Structure(93, 0), basis, [Sums.over(basis.columns(t, r), y, np.ones(400))], 0.3)
    best = search.best()
    for scale in (0.04, 0.1, 0.2, 0.5):
        start = search.mean.copy()
        start[4] = np.log(scale)
        assert search.best(start).value > best.value - 0.05


def test_a_wrong_guess_of_the_noise_costs_the_search_little() -> None:
    """The noise is known a hundred times better than a scale: with steps alike, three times too little costs 109."""
    rng = np.random.default_rng(12)
    t, r = np.sort(rng.uniform(-1.0, 1.0, 4000)), rng.uniform(-1.0, 1.0, 4000)
    y = np.sin(2.0 * t) + rng.normal(0.0, 0.3, 4000)
    basis = Basis.over(t, r)
    sums = [Sums.over(basis.columns(t, r), y, np.ones(4000))]
    found = [VarianceSearch(Structure(93, 0), basis, sums, white).best() for white in (0.1, 0.3, 0.9)]
    assert max(one.evaluations for one in found) < 80
    assert np.ptp([np.log(one.sigma) for one in found]) < 0.01
