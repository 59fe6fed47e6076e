"""The evidence model of the core against the plain formulas of Gaussian process regression."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc import _core
from numpy.typing import NDArray

Floats = NDArray[np.float64]

REACH = 1.4
PRIOR_MEAN = np.log([0.3, 0.15, 1.0, 0.7, 0.3, 0.8, 0.8, 0.3])
PRIOR_SD = np.array([1.5, 0.7, 1.0, 0.5, 1.5, 0.5, 0.5, 3.0])


def bins(seed: int, n: int = 60) -> dict[str, Floats | float]:
    """Bins with counts, and the squares within them."""
    rng = np.random.default_rng(seed)
    t, r = rng.uniform(-1.0, 1.0, n), rng.uniform(-1.0, 1.0, n)
    count = rng.integers(1, 20, n).astype(float)
    mean = np.sin(4.0 * t) * (1.0 + 0.3 * r) + rng.normal(0.0, 0.3, n) / np.sqrt(count)
    within = float(np.sum(rng.chisquare(count - 1 + 1e-9)) * 0.09)
    return {"t": t, "r": r, "count": count, "mean": mean, "within": within, "samples": float(count.sum())}


def model(data: dict[str, Floats | float]) -> _core.EvidenceModel:
    return _core.EvidenceModel(**data)  # type: ignore[arg-type]


def basis(t: Floats, r: Floats, reach_t: float, reach_r: float) -> tuple[Floats, Floats, Floats]:
    """Columns sin(ω (x + L))/√L and their frequencies (T, dT/dt; 0 where a column does not depend on it)."""

    def sines(x: Floats, n: int, reach: float) -> tuple[Floats, Floats]:
        w = np.pi * np.arange(1, n + 1) / (2.0 * reach)
        return np.sin(w * (x[:, None] + reach)) / np.sqrt(reach), w

    of_t, w_t = sines(t, 40, reach_t)
    of_r, w_r = sines(r, 8, reach_r)
    coupled = (of_t[:, :10, None] * of_r[:, None, :]).reshape(len(t), -1)
    columns = np.concatenate([np.ones((len(t), 1)), of_t, coupled], axis=1)
    return columns, w_t, w_r


def prior_variance(p: Floats, w_t: Floats, w_r: Floats) -> Floats:
    def density(s: float, scale: float, w: Floats) -> Floats:
        return np.asarray(s**2 * np.sqrt(2.0 * np.pi) * scale * np.exp(-0.5 * (scale * w) ** 2))

    coupled = density(p[4], p[5], w_t[:10])[:, None] * density(1.0, p[6], w_r)[None, :]
    return np.concatenate(
        [[100.0], density(p[0], p[1], w_t) + density(p[2], p[3], w_t) + 1e-10, coupled.ravel() + 1e-10]
    )


def dense(data: dict[str, Floats | float], log_p: Floats) -> tuple[float, Floats, Floats, Floats]:
    """Negative log posterior by the n x n covariance of the bins; prior covariance and columns for predictions."""
    t, r, count, mean = (np.asarray(data[k]) for k in ("t", "r", "count", "mean"))
    p = np.exp(log_p)
    phi, w_t, w_r = basis(t, r, REACH * np.abs(t).max(), REACH * np.abs(r).max())
    prior = prior_variance(p, w_t, w_r)
    noise = p[7] ** 2
    covariance = (phi * prior) @ phi.T + np.diag(noise / count)
    _, logdet = np.linalg.slogdet(covariance)
    value = 0.5 * mean @ np.linalg.solve(covariance, mean) + 0.5 * logdet + 0.5 * np.sum(np.log(count))
    n, samples = len(t), float(data["samples"])
    value += 0.5 * float(data["within"]) / noise + (samples - n) * log_p[7]
    value += 0.5 * float(np.sum(((log_p - PRIOR_MEAN) / PRIOR_SD) ** 2))
    return float(value), covariance, prior, phi


@pytest.mark.parametrize("seed", range(4))
def test_the_objective_is_the_negative_log_posterior(seed: int) -> None:
    """Differences between parameter sets: the additive constant is free."""
    data = bins(seed)
    process = model(data)
    rng = np.random.default_rng(100 + seed)
    points = [PRIOR_MEAN + 0.5 * rng.normal(size=8) for _ in range(3)]
    found = [process.objective(p)[0] for p in points]
    expected = [dense(data, p)[0] for p in points]
    np.testing.assert_allclose(np.diff(found), np.diff(expected), rtol=1e-7, atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_the_gradient_is_the_slope_of_the_objective(seed: int) -> None:
    process = model(bins(seed))
    at = PRIOR_MEAN + 0.4 * np.random.default_rng(seed).normal(size=8)
    _, gradient = process.objective(at)
    step = 1e-5
    for k in range(8):
        up, down = at.copy(), at.copy()
        up[k] += step
        down[k] -= step
        slope = (process.objective(up)[0] - process.objective(down)[0]) / (2.0 * step)
        assert gradient[k] == pytest.approx(slope, rel=1e-5, abs=1e-4)


def test_mean_and_variance_are_those_of_the_conditioned_process() -> None:
    data = bins(7)
    process = model(data)
    log_p = PRIOR_MEAN + 0.2
    process.condition(log_p)
    _, covariance, prior, phi = dense(data, log_p)
    t, r = np.asarray(data["t"]), np.asarray(data["r"])
    at_t, at_r = np.linspace(-1.0, 1.0, 9), np.linspace(0.5, -0.5, 9)
    columns, *_ = basis(at_t, at_r, REACH * np.abs(t).max(), REACH * np.abs(r).max())
    cross = (columns * prior) @ phi.T
    np.testing.assert_allclose(
        process.mean(at_t, at_r), cross @ np.linalg.solve(covariance, np.asarray(data["mean"])), atol=1e-8
    )
    variance = np.sum(columns**2 * prior, axis=1) - np.sum(
        cross * np.linalg.solve(covariance, cross.T).T, axis=1
    )
    np.testing.assert_allclose(process.variance(at_t, at_r), variance, rtol=1e-6)
    # Effective parameters: the trace of the hat matrix.
    count = np.asarray(data["count"])
    hat = np.trace(np.linalg.solve(covariance, (phi * prior) @ phi.T))
    assert process.freedom == pytest.approx(float(hat), rel=1e-6)
    assert count.sum() == data["samples"]


def test_the_optimum_is_no_worse_than_many_starts_find() -> None:
    """Ripple and trend together: two starts of the short scale are what the search has."""
    rng = np.random.default_rng(11)
    t, r = np.sort(rng.uniform(-1.0, 1.0, 400)), rng.uniform(-1.0, 1.0, 400)
    y = np.sin(2.0 * t) + 0.4 * np.cos(2.0 * np.pi * t / 0.22) + rng.normal(0.0, 0.3, 400)
    process = _core.EvidenceModel(t, r, np.ones(400), y, 0.0, 400.0)
    process.optimise()
    best = process.value
    gradient = process.objective(process.log_parameters)[1]
    assert np.abs(gradient).max() < 1.0
    for scale in (0.04, 0.1, 0.2, 0.5):
        start = PRIOR_MEAN.copy()
        start[1] = np.log(scale)
        process.optimise_from(start)
        assert process.value > best - 0.05


def test_noise_is_found() -> None:
    rng = np.random.default_rng(3)
    t, r = rng.uniform(-1.0, 1.0, 800), rng.uniform(-1.0, 1.0, 800)
    y = np.sin(3.0 * t) + 0.2 * r + rng.normal(0.0, 0.25, 800)
    process = _core.EvidenceModel(t, r, np.ones(800), y, 0.0, 800.0)
    process.optimise()
    assert process.sigma == pytest.approx(0.25, rel=0.08)


def test_many_points_are_answered_as_each_part_of_them() -> None:
    """Points go through in blocks: none may be lost at an edge, nor depend on the others."""
    rng = np.random.default_rng(7)
    process = model(bins(7))
    process.optimise()
    t, r = rng.uniform(-1.1, 1.1, (2, 2003))
    for ask in (process.mean, process.variance):
        whole = ask(t, r)
        for part in (slice(0, 1), slice(0, 481), slice(477, 962), slice(1400, 2003)):
            np.testing.assert_allclose(ask(t[part], r[part]), whole[part], rtol=1e-11)


def test_a_process_that_is_conditioned_anew_forgets_its_earlier_variance() -> None:
    data = bins(8)
    again, fresh = model(data), model(data)
    at = np.linspace(-1.0, 1.0, 50), np.linspace(1.0, -1.0, 50)
    again.condition(PRIOR_MEAN - 0.5)
    before, freedom = again.variance(*at), again.freedom
    again.condition(PRIOR_MEAN)
    fresh.condition(PRIOR_MEAN)
    assert not np.array_equal(again.variance(*at), before) and again.freedom != freedom
    assert np.array_equal(again.variance(*at), fresh.variance(*at)) and again.freedom == fresh.freedom
    assert np.array_equal(again.mean(*at), fresh.mean(*at))


@pytest.mark.parametrize("sigma", [0.3, 1e-2, 1e-4])
def test_variance_keeps_its_digits_where_hardly_any_noise_is_left(sigma: float) -> None:
    """Of 1e-4 a sum of waves has cancelled to nothing. Held against a QR, which squares nothing."""
    data = bins(12, 400)
    log_p = PRIOR_MEAN.copy()
    log_p[7] = np.log(sigma)
    process = model(data)
    process.condition(log_p)
    t, r, count = (np.asarray(data[k]) for k in ("t", "r", "count"))
    reach = REACH * np.abs(t).max(), REACH * np.abs(r).max()
    phi, w_t, w_r = basis(t, r, *reach)
    root = np.sqrt(prior_variance(np.exp(log_p), w_t, w_r))
    factor = np.linalg.qr(
        np.concatenate([phi * root * np.sqrt(count)[:, None] / sigma, np.eye(121)]), mode="r"
    )
    at = np.linspace(-1.0, 1.0, 37), np.linspace(0.9, -0.9, 37)
    columns, *_ = basis(*at, *reach)
    expected = np.sum(np.linalg.solve(factor.T, (columns * root).T) ** 2, axis=0)
    np.testing.assert_allclose(process.variance(*at), expected, rtol=1e-4)
