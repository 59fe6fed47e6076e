"""Noise against the formulas of IEEE Std 647 (annex C), measured by allantools."""

from __future__ import annotations

import secrets

import allantools
import numpy as np
import pytest
from gyrotc.simulate import noise
from gyrotc.simulate.instrument import SimulatedRecord
from gyrotc.simulate.noise import CELL_S, cell_noise
from gyrotc.simulate.recording import RowLength, rows
from gyrotc.simulate.scenario import NoiseLevels
from numpy.typing import NDArray
from scipy.stats import chi2

Array = NDArray[np.float64]
HOUR_S = 3600.0
# Two-sided risk of a false alarm at one averaging time; about twenty are looked at in one run of the tests.
RISK = 1e-7


@pytest.fixture
def seed() -> int:
    drawn = secrets.randbits(32)
    print(f"seed {drawn}")
    return drawn


def made(levels: NoiseLevels, cells: int, seed: int, temperature_c: float = 20.0) -> Array:
    """Angle of each cell, arcsec."""
    flat = np.full(cells, temperature_c)
    return cell_noise(np.random.SeedSequence(seed), levels, flat, np.zeros(cells)).angle_arcsec


def allan(rate_dph: Array, taus_s: list[float], rate_hz: float = 1.0) -> tuple[Array, Array, Array]:
    """Overlapping Allan deviation and, for white frequency noise, its confidence limits."""
    taus, deviation, _, _ = allantools.oadev(rate_dph, rate=rate_hz, data_type="freq", taus=taus_s)
    assert np.allclose(taus, taus_s)
    freedom = np.array([max(1.0, 0.7 * len(rate_dph) / (rate_hz * tau)) for tau in taus])
    low = deviation * np.sqrt(freedom / chi2.ppf(1.0 - RISK / 2.0, freedom))
    high = deviation * np.sqrt(freedom / chi2.ppf(RISK / 2.0, freedom))
    return deviation, low, high


def test_angle_random_walk_falls_as_one_over_the_root_of_tau(seed: int) -> None:
    n = 2e-3
    taus = [1.0, 10.0, 100.0, 1000.0]
    _, low, high = allan(made(NoiseLevels(arw_deg_per_sqrt_h=n), 500_000, seed) / CELL_S, taus)
    expected = n / np.sqrt(np.array(taus) / HOUR_S)
    assert np.all((low < expected) & (expected < high))


def test_bias_instability_stands_at_0_664_b(seed: int) -> None:
    """A sum of Markov processes is flat within a few percent; the spread of one record comes on top."""
    b = 1e-3
    levels = NoiseLevels(bias_instability_dph=b)
    taus = [10.0, 100.0, 1000.0, 10000.0]
    several = [allan(made(levels, 200_000, seed + k) / CELL_S, taus)[0] ** 2 for k in range(8)]
    deviation = np.sqrt(np.mean(several, axis=0))
    expected = np.sqrt(2.0 * np.log(2.0) / np.pi) * b
    assert deviation[:3] == pytest.approx(expected, rel=0.12)
    assert deviation[3] == pytest.approx(expected, rel=0.5)


def test_rate_random_walk_rises_with_the_root_of_tau(seed: int) -> None:
    k = 5e-3
    taus = np.array([30.0, 100.0, 300.0])
    levels = NoiseLevels(rate_random_walk_dph_per_sqrt_h=k)
    several = [allan(made(levels, 100_000, seed + j) / CELL_S, taus.tolist())[0] ** 2 for j in range(4)]
    deviation = np.sqrt(np.mean(several, axis=0))
    # Means over m cells of a walk with one step a cell: K²τ/3 times 1 + 1/(2 m²).
    expected = k * np.sqrt(taus / HOUR_S / 3.0 * (1.0 + 0.5 / taus**2))
    assert deviation == pytest.approx(expected, rel=0.2)


def test_a_quantum_falls_as_one_over_tau(seed: int) -> None:
    """σ = √3 Q/τ with Q = quantum/√12."""
    quantum = 0.5
    rng = np.random.default_rng(seed)
    angle = np.cumsum(rng.normal(0.0, 1e-3, 200_001))
    read = noise.quantised(angle, quantum, rng.random(200_001))
    assert np.abs(read - angle).max() <= 0.5 * quantum * (1.0 + 1e-12)
    taus = [1.0, 4.0, 16.0]
    _, low, high = allan(np.diff(read) / CELL_S, taus)
    expected = np.sqrt(3.0) * quantum / np.sqrt(12.0) / np.array(taus)
    white = 1e-3 / np.sqrt(np.array(taus))
    assert np.all((low < np.hypot(expected, white)) & (np.hypot(expected, white) < high))


def test_noise_grows_with_temperature_and_ramp_as_declared() -> None:
    levels = NoiseLevels(arw_deg_per_sqrt_h=1e-3, arw_growth_per_c=-0.01, arw_growth_per_c_per_min=0.3)
    at = noise.white_sigma_arcsec(levels, np.array([20.0, -30.0, 20.0]), np.array([0.0, 0.0, -2.0]))
    assert at / at[0] == pytest.approx([1.0, 1.5, 1.6])
    assert at[0] == pytest.approx(1e-3 * 60.0)


def test_outliers_come_as_often_and_as_large_as_declared() -> None:
    levels = NoiseLevels(outliers_per_h=20.0, outlier_arcsec=2.0)
    angle = made(levels, 360_000, 5)
    hit = np.abs(angle[angle != 0.0])
    assert len(hit) == pytest.approx(2000, abs=5 * 2000**0.5)
    assert hit.min() >= 1.0 and hit.max() <= 3.0


def plain_record(seed: int, cells: int, levels: NoiseLevels) -> SimulatedRecord:
    """A record without bias."""
    made_noise = cell_noise(np.random.SeedSequence(seed), levels, np.full(cells, 20.0), np.zeros(cells))
    angle = np.concatenate(([0.0], np.cumsum(made_noise.angle_arcsec)))
    zero = np.zeros(cells + 1)
    return SimulatedRecord(
        reading_c=np.zeros(cells),
        channels={},
        states={},
        air_c=zero,
        cavity_c=zero,
        bias_dph=zero,
        true_arcsec=zero,
        rough_arcsec=angle,
        angle_arcsec=angle,
        white_arcsec=made_noise.white_arcsec,
        quantum_arcsec=0.0,
        power_on_s=0.0,
        seeds=np.random.SeedSequence(seed + 1),
    )


def test_rows_shorter_than_a_second_keep_the_random_walk(seed: int) -> None:
    n = 1e-3
    record = plain_record(seed, 4000, NoiseLevels(arw_deg_per_sqrt_h=n))
    edges = np.concatenate([chunk.edge_arcsec[:-1] for chunk in rows(record, RowLength.of(10.0, 100.0))])
    taus = [0.01, 0.05, 0.2, 0.5, 1.0, 5.0]
    _, low, high = allan(np.diff(edges) / 0.01, taus, rate_hz=100.0)
    expected = n / np.sqrt(np.array(taus) / HOUR_S)
    assert np.all((low < expected) & (expected < high))
