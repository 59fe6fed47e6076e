"""The other blind world: its own physics, checked by what physics says.

`make blind` measures the figures; `tests/check/test_blind_other.py` runs every stage of it on a few recordings.
"""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]

from tests.blind.other import heat, noise  # noqa: E402
from tests.blind.other.mechanisms import Scene, draw_map  # noqa: E402
from tests.blind.other.yardstick import Yardstick  # noqa: E402

WORLD = ("heat", "noise", "mechanisms", "grammar", "yardstick", "record")
SEED = 20261122  # always the same: what is drawn anew is for `make blind`


def test_the_world_imports_nothing_of_the_tool_nor_of_the_sibling() -> None:
    for name in WORLD:
        tree = ast.parse((ROOT / "tests" / "blind" / "other" / f"{name}.py").read_text("utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                assert not any(alias.name.startswith(("gyrotc", "tests")) for alias in node.names), name
            if isinstance(node, ast.ImportFrom):
                assert node.level <= 1 and not str(node.module).startswith(("gyrotc", "tests")), name


def test_noise_has_the_covariance_that_the_yardstick_counts_on() -> None:
    level = noise.PowerLaw(1e-3, 2e-4, 1.2)
    rng = np.random.default_rng(8)
    means = np.array([noise.draw(level, 6000, rng).reshape(-1, 100).mean(axis=1) for _ in range(300)])
    wanted = noise.covariance(level, 60, 100)
    drawn = means.T @ means / len(means)
    assert np.trace(drawn) == pytest.approx(np.trace(wanted), rel=0.05)
    assert drawn[0, 5] == pytest.approx(wanted[0, 5], abs=0.2 * wanted[0, 0])


def test_a_map_of_a_late_temperature_is_no_foreign_effect() -> None:
    """Polynomials of degree 6 and clocks 300 s apart took less than half of a saturation that comes 240 s late."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    body = heat.draw_body(rng)
    runs = [heat.run_heat(body, *heat.programme(rng, 3.0), rng) for _ in range(3)]
    zeros = [np.zeros(h.sensor.size) for h in runs]
    scene = Scene(runs, lambda: runs, [0.0, 1.0, 2.0], draw_map(rng), zeros)
    stick = Yardstick(scene, [0, 1, 2], noise.PowerLaw(1e-3, 2e-4, 1.0))
    edge = float(np.mean(runs[0].sensor))
    lag = round(240 / heat.STEP_S)
    late = [np.concatenate([np.full(lag, h.sensor[0]), h.sensor[:-lag]]) for h in runs]
    assert stick.imitated([np.tanh((t - edge) / 6.0) for t in late]) > 0.8
    noises = [np.repeat(rng.normal(size=t.size // 100 + 1), 100)[: t.size] for t in late]
    assert stick.imitated(noises) < 0.5, "noise is nobody's"
