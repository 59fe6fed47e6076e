"""The C++ core against plain formulas: orthogonal least squares, Kohonen network, variable projection."""

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
    g = np.exp(-(((t[:, None] - centers[:, 0]) / width_t) ** 2) - ((r[:, None] - centers[:, 1]) / width_r) ** 2)
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
def test_closed_form_normal_equations_are_those_of_the_columns(seed: int, widths: tuple[float, float]) -> None:
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


@pytest.mark.parametrize("n", [30, 2047, 2048, 2049, 5000])
def test_weights_by_qr_are_least_squares(n: int) -> None:
    """Block borders of the streamed QR included; with a ridge, the minimum of the penalised sum."""
    t, r, y, weight = cloud(5, n)
    gaussians = np.array([[-0.5, 0.0, 0.4, 0.6], [0.3, 0.2, 0.7, 0.5], [0.9, -0.4, 0.5, 1.0]])
    p = np.concatenate([np.ones((n, 1)), *[design(t, r, g[None, :2], g[2], g[3])[:, 1:] for g in gaussians]], axis=1)
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


_MASK = (1 << 64) - 1


class SplitMix64:
    """The published generator, so that the reference sees the samples in the core's order."""

    def __init__(self, seed: int) -> None:
        self.state = seed

    def next(self) -> int:
        self.state = (self.state + 0x9E3779B97F4A7C15) & _MASK
        z = self.state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
        return z ^ (z >> 31)

    def permutation(self, n: int) -> list[int]:
        order = list(range(n))
        for i in range(n, 1, -1):
            j = self.next() % i
            order[i - 1], order[j] = order[j], order[i - 1]
        return order


def plain_kohonen(samples: Floats, m: int, epochs: int, seed: int) -> tuple[Floats, Floats]:
    """Every distance to every node, eq. (5); the nearest node moves, eq. (6); the rate decays geometrically."""
    random = SplitMix64(seed)
    nodes = samples[random.permutation(len(samples))[:m]].copy()
    first, last = 0.5, 0.005
    decay = (last / first) ** (1.0 / (len(samples) * epochs - 1.0))
    rate = first
    wins = np.zeros(m)
    for _ in range(epochs):
        wins[:] = 0.0
        for i in random.permutation(len(samples)):
            winner = int(np.argmin(np.sum((nodes - samples[i]) ** 2, axis=1)))
            nodes[winner] += rate * (samples[i] - nodes[winner])
            wins[winner] += 1.0
            rate *= decay
    return nodes, wins


def blobs(seed: int, n: int) -> Floats:
    """Crowded holds, a sparse sweep and a far point, in a long and flat range."""
    rng = np.random.default_rng(seed)
    holds = rng.choice([-0.9, 0.2, 0.95], n // 2)[:, None] + rng.normal(0.0, 0.003, (n // 2, 2))
    sweep = np.stack([rng.uniform(-1.0, 1.0, n - n // 2 - 1), 0.05 * rng.normal(size=n - n // 2 - 1)], axis=1)
    return np.concatenate([holds, sweep, [[3.0, 0.4]]])


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("n", "m"), [(300, 7), (500, 60), (200, 150)])
def test_the_winner_found_in_cells_is_the_nearest_of_all_nodes(seed: int, n: int, m: int) -> None:
    samples = blobs(seed, n)
    nodes, wins = plain_kohonen(samples, m, 3, seed)
    found = _core.kohonen(samples, m, max_epochs=3, tolerance=0.0, seed=seed)
    np.testing.assert_allclose(found.nodes, nodes, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(found.occupancy, wins)
    assert found.epochs == 3


def test_nodes_stand_in_the_clusters() -> None:
    rng = np.random.default_rng(0)
    centers = np.array([[-0.8, -0.5], [0.1, 0.6], [0.7, -0.2]])
    samples = np.repeat(centers, 200, axis=0) + rng.normal(0.0, 0.02, (600, 2))
    nodes = _core.kohonen(samples, 12, seed=3).nodes
    distance = np.min(np.linalg.norm(nodes[:, None] - centers, axis=2), axis=1)
    assert distance.max() < 0.1


def test_learning_ends_when_the_nodes_stand_still() -> None:
    samples = np.tile([[0.0, 0.0], [1.0, 1.0]], (50, 1))
    found = _core.kohonen(samples, 2, max_epochs=100, tolerance=1e-3, seed=1)
    assert found.epochs < 100


def test_no_more_samples_than_nodes_are_their_own_nodes() -> None:
    samples = np.array([[0.0, 1.0], [2.0, 3.0]])
    found = _core.kohonen(samples, 5)
    np.testing.assert_array_equal(found.nodes, samples)


def test_a_neighbourhood_orders_the_lattice() -> None:
    """With a neighbourhood, nodes that are neighbours on the lattice end up nearer to each other than chance."""
    samples = np.random.default_rng(5).uniform(-1.0, 1.0, (2000, 2))

    def steps(neighbourhood: float) -> float:
        nodes = _core.kohonen(samples, 64, max_epochs=10, neighbourhood=neighbourhood, seed=2).nodes
        lattice = nodes.reshape(8, 8, 2)
        return float(np.linalg.norm(np.diff(lattice, axis=0), axis=2).mean())

    assert steps(3.0) < 0.5 * steps(0.0)


def test_a_seed_gives_one_result_and_bad_input_is_refused() -> None:
    samples = blobs(1, 200)
    again = [_core.kohonen(samples, 20, seed=9).nodes for _ in range(2)]
    np.testing.assert_array_equal(again[0], again[1])
    assert np.abs(_core.kohonen(samples, 20, seed=10).nodes - again[0]).max() > 0.0
    with pytest.raises(ValueError, match="finite"):
        _core.kohonen(np.array([[np.nan, 0.0], [1.0, 1.0]]), 1)
    with pytest.raises(ValueError, match="no"):
        _core.kohonen(np.zeros((0, 2)), 1)


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
        [rng.uniform(-1.4, 1.4, 4), rng.uniform(-1.4, 1.4, 4), rng.uniform(-2, 1.6, 4), rng.uniform(-2, 1.6, 4)]
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


@pytest.mark.parametrize("n", [1, 15, 16, 47, 121])
def test_posterior_covariances_are_inverses_of_the_sums(n: int) -> None:
    rng = np.random.default_rng(n)
    prior = np.diag(rng.uniform(0.5, 2.0, n))
    factor = rng.normal(size=(3, n, n + 2))
    precision = factor @ factor.transpose(0, 2, 1)
    covariance, log_determinant = _core.posteriors(prior, precision)
    np.testing.assert_allclose(covariance @ (prior + precision), np.broadcast_to(np.eye(n), precision.shape), atol=1e-9)
    np.testing.assert_array_equal(covariance, covariance.transpose(0, 2, 1))
    np.testing.assert_allclose(log_determinant, -np.linalg.slogdet(prior + precision)[1], rtol=1e-12)


def test_a_sum_that_is_no_precision_is_refused() -> None:
    with pytest.raises(ValueError, match="not positive definite"):
        _core.posteriors(-np.eye(2), np.zeros((1, 2, 2)))
