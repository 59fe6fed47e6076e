"""What several stages of diagnosis compute with: orthonormal columns, quantiles."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.common.metrics import MAD_TO_SIGMA
from gyrotc.common.statistics import (
    CHI2_95_ONE,
    CHI2_95_TWO,
    NORMAL_95,
    TOLERANCE,
    main_directions,
    orthonormal,
)
from scipy import stats
from scipy.linalg import subspace_angles

RNG = np.random.default_rng(11)


def test_independent_columns_are_made_orthogonal_in_their_order() -> None:
    x = RNG.standard_normal((40, 6)) * np.geomspace(1e-6, 1e6, 6)
    q = orthonormal(x[:, :2], x[:, 2:])
    expected = np.linalg.qr(x)[0]
    assert np.abs(q - expected).max() < 1e-12, "the size of a column says nothing about its direction"
    for count in range(1, 7):
        assert subspace_angles(q[:, :count], x[:, :count]).max() < 1e-7


def test_a_dependent_column_takes_nothing_away_from_those_after_it() -> None:
    """Of a plain factorisation the second direction is e2 by chance; dropped, the third column would be lost."""
    e1, e2 = np.eye(5)[:, 0], np.eye(5)[:, 1]
    q = orthonormal(np.column_stack([e1, e1, e2]))
    assert q.shape == (5, 2)
    assert np.abs(q @ (q.T @ e2) - e2).max() < 1e-15


@pytest.mark.parametrize("own", [0.1, 10.0])
def test_the_tolerance_is_what_a_column_has_of_its_own(own: float) -> None:
    e1, e2 = np.eye(5)[:, 0], np.eye(5)[:, 1]
    for size in (1e-9, 1.0, 1e9):
        q = orthonormal(np.column_stack([e1, size * (e1 + own * TOLERANCE * e2)]))
        assert q.shape[1] == (2 if own > 1.0 else 1)


def test_more_columns_than_rows_zeros_and_nothing() -> None:
    x = RNG.standard_normal((4, 9))
    assert np.abs(orthonormal(x) @ orthonormal(x).T - np.eye(4)).max() < 1e-12
    assert orthonormal(np.zeros((4, 2))).shape == (4, 0)
    assert orthonormal(np.zeros((4, 0))).shape == (4, 0)
    assert orthonormal(np.zeros((4, 1)), np.eye(4)[:, :1]).shape == (4, 1)


def test_main_directions_are_those_of_the_strongest_mixtures() -> None:
    left = np.linalg.qr(RNG.standard_normal((30, 3)))[0]
    right = np.linalg.qr(RNG.standard_normal((3, 3)))[0]
    columns = left @ np.diag([1.0, 0.2, 0.01]) @ right
    assert subspace_angles(main_directions(columns, 0.05), left[:, :2]).max() < 1e-7
    assert main_directions(columns, 0.5).shape[1] == 1
    assert main_directions(np.zeros((30, 0)), 0.05).shape == (30, 0)


def test_quantiles_are_those_of_their_distributions() -> None:
    assert stats.chi2.cdf([CHI2_95_ONE], 1) == pytest.approx(0.95)
    assert stats.chi2.cdf([CHI2_95_TWO], 2) == pytest.approx(0.95)
    assert stats.norm.cdf(NORMAL_95) - stats.norm.cdf(-NORMAL_95) == pytest.approx(0.95)
    assert pytest.approx(NORMAL_95**2) == CHI2_95_ONE
    normal = 3.0 * stats.norm.ppf((np.arange(100001) + 0.5) / 100001)
    assert MAD_TO_SIGMA * np.median(np.abs(normal)) == pytest.approx(3.0, rel=1e-4)
