"""The Kohonen network of the core against one written plainly from eq. (5) and (6) of the paper."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc import _core
from numpy.typing import NDArray

Floats = NDArray[np.float64]
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
