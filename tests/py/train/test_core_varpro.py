"""Variable projection of the core: gradients, recovered centers, and what it promises about sizes."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc import _core
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def points(seed: int, n: int = 500) -> tuple[Floats, Floats, Floats]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1.0, 1.0, n), rng.uniform(-1.0, 1.0, n), rng.uniform(0.5, 3.0, n)


def evaluate(shapes: Floats, weights: Floats, t: Floats, r: Floats) -> Floats:
    value = weights[0] + weights[1] * t + weights[2] * r
    for (c, d, s, q), w in zip(shapes.T, weights[3:], strict=True):
        value = value + w * np.exp(-(((t - c) / np.exp(s)) ** 2) - ((r - d) / np.exp(q)) ** 2)
    return np.asarray(value)


def shapes_of(*gaussians: tuple[float, float, float, float]) -> Floats:
    """Columns c, d, log s, log q."""
    a = np.array(gaussians).T
    return np.concatenate([a[:2], np.log(a[2:])])


@pytest.mark.parametrize("seed", range(5))
def test_the_gradient_is_the_slope_of_the_projected_objective(seed: int) -> None:
    """Weights projected out at every point; also beyond the walls."""
    t, r, weight = points(seed)
    rng = np.random.default_rng(50 + seed)
    solver = _core.VariableProjection(t, r, weight, np.sin(3.0 * t) + r * t, 0.1)
    shapes = np.stack(
        [
            rng.uniform(-1.4, 1.4, 4),
            rng.uniform(-1.4, 1.4, 4),
            rng.uniform(-2, 1.6, 4),
            rng.uniform(-2, 1.6, 4),
        ]
    )
    gradient = solver.gradient(solver.project(shapes))
    step = 1e-6
    for i in range(4):
        for j in range(4):
            up, down = shapes.copy(), shapes.copy()
            up[i, j] += step
            down[i, j] -= step
            slope = (solver.project(up).cost - solver.project(down).cost) / (2.0 * step)
            assert gradient[i, j] == pytest.approx(slope, rel=2e-4, abs=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_projected_weights_are_ridge_regression(seed: int) -> None:
    t, r, weight = points(seed)
    target = np.cos(2.0 * t) + 0.1 * r
    shapes = shapes_of((-0.5, 0.2, 0.4, 0.8), (0.6, -0.3, 0.3, 1.5))
    found = _core.VariableProjection(t, r, weight, target, 0.3).project(shapes)
    g = np.stack([evaluate(shapes[:, [k]], np.array([0.0, 0.0, 0.0, 1.0]), t, r) for k in range(2)], axis=1)
    x = np.sqrt(weight)[:, None] * np.concatenate([np.ones((len(t), 1)), t[:, None], r[:, None], g], axis=1)
    y = np.sqrt(weight) * target
    w = np.linalg.solve(x.T @ x + np.diag([0.0, 0.0, 0.0, 0.3, 0.3]), x.T @ y)
    np.testing.assert_allclose(found.weights, w, rtol=1e-7, atol=1e-9)
    assert found.misfit == pytest.approx(float(np.sum((y - x @ w) ** 2)), rel=1e-8)
    assert found.cost == pytest.approx(found.misfit + 0.3 * float(np.sum(w[3:] ** 2)), rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_the_loss_of_a_deletion_is_that_of_a_projection_without_it(seed: int) -> None:
    """Also of a Gaussian beyond the walls, whose price goes with it, and of two that nearly coincide."""
    t, r, weight = points(seed)
    solver = _core.VariableProjection(t, r, weight, np.sin(3.0 * t) + r * t, 0.1)
    shapes = shapes_of((-0.5, 0.2, 0.4, 0.8), (-0.5, 0.21, 0.4, 0.8), (0.6, -0.3, 0.3, 1.5), (1.4, 0.1, 0.5, 0.9))
    whole = solver.project(shapes).cost
    exact = [solver.project(np.delete(shapes, j, axis=1)).cost - whole for j in range(4)]
    np.testing.assert_allclose(solver.losses(shapes), exact, rtol=1e-6, atol=1e-9 * whole)


def test_true_centers_and_widths_are_recovered() -> None:
    t, r, weight = points(2)
    truth = shapes_of((-0.6, 0.1, 0.35, 0.7), (0.5, -0.4, 0.5, 0.9))
    weights = np.array([0.3, 0.2, -0.1, 1.0, -0.8])
    solver = _core.VariableProjection(t, r, weight, evaluate(truth, weights, t, r), 1e-10)
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 7), np.linspace(-1, 1, 5)), axis=-1).reshape(-1, 2)
    sizes = solver.path(grid, 2, 0.0, 0.0, 1e-14)
    found = sizes[2].shapes[:, np.argsort(sizes[2].shapes[0])]
    np.testing.assert_allclose(found, truth, atol=1e-3)
    assert sizes[2].misfit < 1e-8


@pytest.mark.parametrize("seed", range(3))
def test_a_larger_network_is_never_worse_and_weights_stay_bounded(seed: int) -> None:
    t, r, weight = points(seed)
    target = np.tanh(4.0 * t) * (1.0 + 0.5 * r) + 0.2 * np.cos(25.0 * t)
    solver = _core.VariableProjection(t, r, weight, target, 1e-3)
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 5)), axis=-1).reshape(-1, 2)
    sizes = solver.path(grid, 25, 0.0, 0.0, 1e-4)
    assert [n.shapes.shape[1] for n in sizes] == list(range(len(sizes)))
    costs = np.array([n.cost for n in sizes])
    assert len(sizes) > 15
    assert np.all(np.diff(costs) < 0.0)
    assert costs[-1] < 0.01 * costs[0]
    assert max(np.abs(n.weights[3:]).sum() for n in sizes) < 100.0


def test_refining_never_makes_it_worse() -> None:
    t, r, weight = points(4)
    solver = _core.VariableProjection(t, r, weight, np.sin(5.0 * t), 1e-6)
    start = solver.project(shapes_of((0.0, 0.0, 0.3, 2.0), (0.5, 0.0, 0.3, 2.0)))
    once = solver.refine(start, 0.0, 1)
    many = solver.refine(start, 0.0, 50)
    assert start.cost >= once.cost >= many.cost
    assert solver.refine(start, 0.0, 0).cost == start.cost


def test_the_path_ends_one_size_after_enough() -> None:
    t, r, weight = points(6)
    solver = _core.VariableProjection(t, r, weight, np.exp(-((t / 0.4) ** 2)), 1e-8)
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 9), [0.0]), axis=-1).reshape(-1, 2)
    sizes = solver.path(grid, 20, 1e-3 * weight.sum(), 0.0, 1e-9)
    reached = next(m for m, n in enumerate(sizes) if n.misfit <= 1e-3 * weight.sum())
    assert len(sizes) <= reached + 2


@pytest.mark.parametrize("ridge", [1e-1, 1e-6])
def test_a_network_that_only_grows_is_projected_as_if_from_scratch(ridge: float) -> None:
    """Also with candidates that are there twice, and with far more Gaussians than the target has structure.

    1e-6 of the cost: the normal matrix has a condition of up to 1e9, so weights are known to 1e-7; the cost is
    stationary in them and errs by far less, beside the sums of rounding errors over the points.
    """
    seed = int(np.random.default_rng().integers(2**31))
    print(f"seed {seed}")
    t, r, weight = points(seed, 300)
    centers = np.random.default_rng(seed).uniform(-1.0, 1.0, (10, 2))[[*range(10), 0, 1, 2]]
    solver = _core.VariableProjection(t, r, weight, np.sin(3.0 * t) + r * t, ridge)
    sizes = solver.path(centers, 60, 0.0, np.inf, 0.0)
    assert len(sizes) > 20
    for network in sizes:
        again = solver.project(network.shapes)
        assert network.cost == pytest.approx(again.cost, rel=1e-6)
    last = solver.project(sizes[-1].shapes)
    assert np.array_equal(sizes[-1].weights, last.weights), "what is emitted comes from the columns themselves"
