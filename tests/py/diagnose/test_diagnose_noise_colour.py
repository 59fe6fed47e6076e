"""Stage 2 of diagnosis: covariances of block means against integrals, whitening against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.diagnose.noise import COLOURS, Colour, Declared, Whitener, flicker_row, markov_row
from scipy.integrate import dblquad
from scipy.linalg import block_diag

BLOCK_S = 100.0
BLOCKS = [np.array([0, 1, 2, 3, 5, 6, 9]), np.arange(2, 12)]


@pytest.mark.parametrize("tau_s", [40.0, 400.0, 20000.0])
@pytest.mark.parametrize("lag", [0, 1, 3])
def test_the_covariance_of_markov_block_means_is_the_double_integral(tau_s: float, lag: int) -> None:
    if lag == 0:  # twice the triangle: the kernel has an edge on the diagonal
        value, _ = dblquad(lambda s, t: np.exp(-(t - s) / tau_s), 0.0, BLOCK_S, 0.0, lambda t: t)
        value *= 2.0
    else:
        low = lag * BLOCK_S
        value, _ = dblquad(lambda s, t: np.exp(-(t - s) / tau_s), low, low + BLOCK_S, 0.0, BLOCK_S)
    assert markov_row(np.array([lag]), BLOCK_S, tau_s)[0] == pytest.approx(value / BLOCK_S**2, rel=1e-6)


def test_flicker_of_the_declared_instability_has_the_spectrum_b2_over_2_pi_f() -> None:
    declared = Declared(1e-9, bias_instability_dph=2e-3)
    colour = declared.colour(BLOCK_S)
    taus = 100.0 * 4.0 ** np.arange(6)
    middle = 1.0 / (2.0 * np.pi * np.sqrt(taus[2] * taus[3]))
    spectrum = colour.slow * sum(4.0 * t / (1.0 + (2.0 * np.pi * middle * t) ** 2) for t in taus)
    assert spectrum == pytest.approx(2.0 * (2e-3) ** 2 / (2.0 * np.pi * middle), rel=0.05), "one-sided"
    assert flicker_row(np.array([0]), 1e-3)[0] == pytest.approx(6.0, rel=1e-4)


def test_declared_white_noise_and_counts_average_as_they_should() -> None:
    white = Declared(1e-3).colour(BLOCK_S)
    assert np.sqrt(white.white) == pytest.approx(1e-3 * 60.0 / np.sqrt(BLOCK_S))
    counts = Declared(1e-9, quantum_arcsec=0.5).colour(BLOCK_S)
    cov = counts.matrix(np.arange(400), BLOCK_S)
    assert cov.sum() == pytest.approx(2.0 * counts.quantum, rel=1e-3), (
        "the angle is wrong at its two ends only"
    )
    assert counts.quantum * BLOCK_S**2 == pytest.approx(0.5**2 / 12.0)


def test_every_colour_of_the_grid_is_a_covariance() -> None:
    for colour in COLOURS:
        assert np.linalg.eigvalsh(colour.matrix(np.arange(150), BLOCK_S))[0] > 0.0


@pytest.mark.parametrize("colour", [COLOURS[5], Colour(walk=0.04), Colour(white=0.1, quantum=0.45)])
@pytest.mark.parametrize("even", [True, False])
def test_whitening_is_that_of_the_dense_covariance(colour: Colour, even: bool) -> None:
    rng = np.random.default_rng(3)
    size = sum(b.size for b in BLOCKS)
    sigma = None if even else np.exp(0.3 * rng.standard_normal(size))
    dense = block_diag(*(colour.matrix(b, BLOCK_S) for b in BLOCKS))
    if sigma is not None:
        dense = dense * np.outer(sigma, sigma)
    whiten = Whitener(colour, BLOCKS, BLOCK_S, sigma)
    x = rng.standard_normal((size, 3))
    white = whiten(x)
    assert white.T @ white == pytest.approx(x.T @ np.linalg.solve(dense, x), rel=1e-9)
    assert whiten.back(white) == pytest.approx(np.linalg.solve(dense, x), rel=1e-8)
    assert whiten.log_det == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-12)
    assert whiten(whiten.colour(x)) == pytest.approx(x, abs=1e-10)
    assert whiten(x[:, 0]) == pytest.approx(white[:, 0])
