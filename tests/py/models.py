"""Hand-written models for the tests of tables and runtime."""

from __future__ import annotations

from typing import Any

import numpy as np
from gyrotc.model import Coverage, Envelope, Model, Network, Scale


def random_model(seed: int, **changes: Any) -> Model:
    """A model with random centers, anisotropic widths, coverage and envelope."""
    rng = np.random.default_rng(seed)
    t0 = rng.uniform(-50.0, 20.0)
    t1 = t0 + rng.uniform(2.0, 110.0)
    r = rng.uniform(0.2, 6.0)
    n = int(rng.integers(0, 24))
    cells = int(rng.integers(1, 20)), int(rng.integers(1, 9))
    widths = [
        tuple(None if rng.random() < 0.1 else float(w) for w in pair)
        for pair in rng.uniform(0.2, 3.0, (n, 2))
    ]
    values: dict[str, Any] = {
        "serial": f"RLG-{seed}",
        "axis": None,
        "method": "mrbf",
        "block_s": 10.0,
        "slope_blocks": int(rng.integers(2, 12)),
        "scale": Scale(temperature_c=((t0 + t1) / 2, (t1 - t0) / 2), slope_c_per_min=r),
        "envelope": Envelope(temperature_c=(t0, t1), slope_c_per_min=(-r, r)),
        "coverage": None
        if rng.random() < 0.2
        else Coverage(
            cells=cells, rows=tuple("".join(row) for row in rng.choice(["0", "1"], (cells[1], cells[0])))
        ),
        "networks": (
            Network(
                w0=float(rng.normal(0.0, 0.01)),
                linear=(float(rng.normal(0.0, 0.01)), float(rng.normal(0.0, 0.01))),
                centers=tuple(
                    zip(rng.uniform(t0, t1, n).tolist(), rng.uniform(-r, r, n).tolist(), strict=True)
                ),
                widths=tuple(widths),
                weights=tuple(rng.normal(0.0, 0.01, n).tolist()),
            ),
        ),
        "fallback_dph": float(rng.normal(0.0, 0.01)),
        "hold_blocks": int(rng.integers(1, 6)),
        "stuck_samples": int(rng.choice([0, 0, 3, 20])),
        "max_step_c": float(rng.uniform(0.05, 1.0)),
        "max_rate_c_per_min": 6.0 * r,
        "noise_floor_dph": None,
        "noise_floor_source": None,
        "data": (),
        "seed": seed,
    }
    return Model(**(values | changes))


def random_history(
    model: Model, seed: int, rows: int, samples_per_block: int
) -> tuple[np.ndarray, np.ndarray]:
    """Temperatures with every fault there is, and the samples missed before each: shapes (n,), (n,)."""
    rng = np.random.default_rng(seed)
    low, high = model.envelope.temperature_c
    step = model.max_rate_c_per_min * model.block_s / 60.0 / samples_per_block
    x = (low + high) / 2 + np.cumsum(rng.normal(0.0, 0.3 * (step + model.max_step_c / 5), rows))
    x = low + np.abs((x - low) % (2 * (high - low)) - (high - low))
    missed = np.zeros(rows, dtype=np.int64)
    for _ in range(max(3, rows // 40)):
        at, length = int(rng.integers(0, rows)), int(rng.integers(1, 3 * samples_per_block + 2))
        fault = rng.integers(0, 7)
        if fault == 0:
            x[at : at + length] = np.nan
        elif fault == 1:
            x[at : at + length] = rng.choice([np.inf, -np.inf, 250.0, -91.0, 1e30])
        elif fault == 2:
            x[at : at + int(rng.integers(1, 5))] += rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 30.0)
        elif fault == 3:
            x[at:] = np.clip(x[at:] + rng.normal(0.0, 10.0), -89.0, 199.0)
        elif fault == 4:
            x[at : at + length] = x[at]
        elif fault == 5:
            missed[at] = rng.integers(1, 4 * samples_per_block)
        else:
            missed[at] = rng.integers(1, samples_per_block * (model.hold_blocks + model.slope_blocks + 9))
    return x, missed
