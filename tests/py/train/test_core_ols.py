"""Orthogonal least squares of the core against a plain Gram-Schmidt written from eq. (7) to (16) of the paper."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc import _core
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SEEDS = range(8)


def cloud(seed: int, n: int = 400) -> tuple[Floats, Floats, Floats, Floats]:
    """t, r, y, weight: holds at three temperatures and a sweep, a curved target with noise."""
    rng = np.random.default_rng(seed)
    t = np.concatenate([rng.choice([-0.8, 0.1, 0.9], n // 2), rng.uniform(-1.0, 1.0, n - n // 2)])
    r = np.clip(rng.normal(0.0, 0.3, n), -1.0, 1.0)
    y = 2.0 + np.sin(3.0 * t) / (1.5 + r) + rng.normal(0.0, 0.2, n)
    return t, r, y, rng.uniform(0.5, 2.0, n)


def design(t: Floats, r: Floats, centers: Floats, width_t: float, width_r: float) -> Floats:
    """A constant and one Gaussian for each center, as columns."""
    g = np.exp(
        -(((t[:, None] - centers[:, 0]) / width_t) ** 2) - ((r[:, None] - centers[:, 1]) / width_r) ** 2
    )
    return np.concatenate([np.ones((len(t), 1)), g], axis=1)


def textbook_ols(p: Floats, y: Floats, steps: int, guard: float = 1e-7) -> tuple[list[int], list[float]]:
    """Eq. (7) to (15): at each step every candidate is orthogonalised, the largest error reduction is taken."""
    chosen, reductions, basis = [0], [float((p[:, 0] @ y) ** 2 / (p[:, 0] @ p[:, 0]) / (y @ y))], [p[:, 0]]
    while len(chosen) < steps:
        best, best_err, best_b = -1, -1.0, p[:, 0]
        for i in range(p.shape[1]):
            if i in chosen:
                continue
            b = p[:, i].copy()
            for _ in range(2):  # twice is enough for full precision
                for other in basis:
                    b = b - (other @ b) / (other @ other) * other
            if b @ b <= guard * (p[:, i] @ p[:, i]):
                continue
            err = float((b @ y) ** 2 / ((b @ b) * (y @ y)))
            if err > best_err:
                best, best_err, best_b = i, err, b
        if best < 0:
            break
        chosen.append(best)
        reductions.append(best_err)
        basis.append(best_b)
    return chosen, reductions


def grid(width_t: float, width_r: float) -> _core.EqualGaussians:
    return _core.EqualGaussians.on_grid(-1.0, 0.25, 9, -1.0, 0.5, 5, width_t, width_r)


def scattered(seed: int, width_t: float, width_r: float) -> _core.EqualGaussians:
    centers = np.random.default_rng(seed).uniform(-1.0, 1.0, (40, 2))
    return _core.EqualGaussians.at(centers, width_t, width_r)


def both(seed: int, width_t: float, width_r: float) -> list[_core.EqualGaussians]:
    return [grid(width_t, width_r), scattered(seed, width_t, width_r)]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("widths", [(0.2, 0.4), (0.6, 0.6), (1.5, 0.9)])
def test_closed_form_normal_equations_are_those_of_the_columns(
    seed: int, widths: tuple[float, float]
) -> None:
    t, r, y, weight = cloud(seed)
    for dictionary in both(seed, *widths):
        dictionary.add(_core.Samples(t[:150], r[:150], y[:150], weight[:150]))
        dictionary.add(_core.Samples(t[150:], r[150:], y[150:], weight[150:]))
        p = design(t, r, dictionary.centers, *widths)
        gram = p.T @ (weight[:, None] * p)
        tolerance = 1e-12 * gram.max()
        found = np.stack([dictionary.column(j) for j in range(len(gram))])
        np.testing.assert_allclose(found, gram, rtol=0.0, atol=tolerance)
        np.testing.assert_allclose(dictionary.norms(), np.diag(gram), rtol=0.0, atol=tolerance)
        np.testing.assert_allclose(dictionary.moments(), p.T @ (weight * y), rtol=0.0, atol=3.0 * tolerance)
        assert dictionary.energy == pytest.approx(float(weight @ y**2), rel=1e-13)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("width", [0.25, 0.5, 1.0])
def test_the_selection_is_the_textbook_one(seed: int, width: float) -> None:
    t, r, y, weight = cloud(seed)
    root = np.sqrt(weight)
    for dictionary in both(seed, width, 1.3 * width):
        dictionary.add(_core.Samples(t, r, y, weight))
        p = root[:, None] * design(t, r, dictionary.centers, width, 1.3 * width)
        # Reductions below 1e-9 of the target are rounding of ill-conditioned columns, in either way of computing.
        expected, reductions = textbook_ols(p, root * y, 12)
        path = _core.select_columns(dictionary, 12)
        kept = sum(1 for err in reductions if err > 1e-9)
        assert path.chosen[:kept] == expected[:kept]
        np.testing.assert_allclose(path.reduction[:kept], reductions[:kept], rtol=1e-5)
        rest = (1.0 - np.cumsum(path.reduction)) * dictionary.energy
        np.testing.assert_allclose(path.rest, rest, rtol=1e-9)


def test_rho_ends_the_selection_at_eq_16() -> None:
    t, r, y, weight = cloud(1)
    dictionary = grid(0.5, 0.5)
    dictionary.add(_core.Samples(t, r, y, weight))
    whole = _core.select_columns(dictionary, 30)
    rho = float(1.0 - np.sum(whole.reduction[:5])) * (1.0 + 1e-9)
    stopped = _core.select_columns(dictionary, 30, rho=rho)
    assert stopped.chosen == whole.chosen[:5]


def test_columns_that_the_chosen_ones_span_are_passed_over() -> None:
    """Five copies of one center give one column, and weights that stay small."""
    t, r, y, weight = cloud(2)
    centers = np.array([[0.2, 0.1]] * 5 + [[-0.5, 0.0]])
    dictionary = _core.EqualGaussians.at(centers, 0.5, 0.5)
    dictionary.add(_core.Samples(t, r, y, weight))
    assert sorted(_core.select_columns(dictionary, 7).chosen) == [0, 1, 6]


def test_subtracting_a_part_is_never_having_added_it() -> None:
    t, r, y, weight = cloud(3)
    first, second = slice(0, 250), slice(250, 400)
    for make in (lambda: grid(0.4, 0.6), lambda: scattered(3, 0.4, 0.6)):
        whole, part, rest = make(), make(), make()
        whole.add(_core.Samples(t, r, y, weight))
        part.add(_core.Samples(t[second], r[second], y[second], weight[second]))
        rest.add(_core.Samples(t[first], r[first], y[first], weight[first]))
        whole.subtract(part)
        np.testing.assert_allclose(whole.column(3), rest.column(3), atol=1e-10)
        assert _core.select_columns(whole, 8).chosen == _core.select_columns(rest, 8).chosen


def test_errors_on_other_samples_are_those_of_least_squares_on_the_chosen_columns() -> None:
    t, r, y, weight = cloud(4)
    here, there = slice(0, 300), slice(300, 400)
    dictionary = grid(0.5, 0.5)
    dictionary.add(_core.Samples(t[here], r[here], y[here], weight[here]))
    path = _core.select_columns(dictionary, 8)
    errors = _core.errors_along(path, dictionary, _core.Samples(t[there], r[there], y[there], weight[there]))
    p = design(t, r, dictionary.centers, 0.5, 0.5)[:, path.chosen]
    root = np.sqrt(weight[here])
    for size in range(1, len(path.chosen) + 1):
        w = np.linalg.lstsq(root[:, None] * p[here, :size], root * y[here], rcond=None)[0]
        expected = float(np.sum(weight[there] * (y[there] - p[there, :size] @ w) ** 2))
        assert errors[size - 1] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("n", [30, 2047, 2048, 2049, 5000])
def test_weights_by_qr_are_least_squares(n: int) -> None:
    """Block borders of the streamed QR included; with a ridge, the minimum of the penalised sum."""
    t, r, y, weight = cloud(5, n)
    gaussians = np.array([[-0.5, 0.0, 0.4, 0.6], [0.3, 0.2, 0.7, 0.5], [0.9, -0.4, 0.5, 1.0]])
    p = np.concatenate(
        [np.ones((n, 1)), *[design(t, r, g[None, :2], g[2], g[3])[:, 1:] for g in gaussians]], axis=1
    )
    root = np.sqrt(weight)
    for ridge in (0.0, 0.5):
        penalty = np.sqrt(ridge) * np.eye(4)[1:]
        expected = np.linalg.lstsq(
            np.concatenate([root[:, None] * p, penalty]), np.concatenate([root * y, np.zeros(3)]), rcond=None
        )[0]
        found = _core.least_squares(_core.Samples(t, r, y, weight), gaussians, ridge)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11)


def test_lengths_that_differ_are_refused() -> None:
    with pytest.raises(ValueError, match="length"):
        _core.Samples(np.zeros(3), np.zeros(3), np.zeros(2), np.ones(3))
