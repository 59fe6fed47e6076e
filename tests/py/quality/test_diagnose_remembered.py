"""A change of a run beside memories: a play is no change, a factor is no memory."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.quality.events import evidence_beside_memories
from gyrotc.target.recursions import first_order, play
from numpy.typing import NDArray

Array = NDArray[np.float64]

TIME_S = 60.0 * np.arange(400)
HALF = TIME_S >= 12000.0


def _temperature() -> Array:
    return np.asarray(25.0 + 30.0 * np.sin(2.0 * np.pi * TIME_S / 9000.0) + 8.0 * np.sin(TIME_S / 700.0))


def _evidence(y: Array, known: Array) -> float:
    """For another factor on the known curve in the second half."""
    side = np.column_stack([np.ones_like(TIME_S), known])
    change = np.hstack([side * ~HALF[:, None], side * HALF[:, None]])
    means = TIME_S, _temperature(), y
    return evidence_beside_memories(means, np.ones(TIME_S.size, dtype=bool), change, known[:, None])


@pytest.mark.parametrize("seed", range(4))
def test_memories_are_no_change_and_a_factor_is_no_memory(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise, t = rng.standard_normal(TIME_S.size), _temperature()
    curve = 0.2 * t + 3.0 * np.tanh((t - 20.0) / 12.0)
    loops = play(float(rng.uniform(2.0, 10.0)), t) - t
    lag = first_order(float(rng.uniform(300.0, 2000.0)), TIME_S, t) - t
    assert _evidence(curve + 0.6 * loops + noise, curve) < 0.0
    assert _evidence(curve + 0.6 * lag + noise, curve) < 0.0
    assert _evidence(curve * np.where(HALF, 1.5, 1.0) + noise, curve) > 10.0
