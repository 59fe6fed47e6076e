"""Known answers of a table: map inputs spread over the envelope, answered by the reference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model import Model
from ..reference import evaluate_map
from ..reference.table import Table

__all__ = ["with_probes"]

N_PROBES = 8
_GOLDEN = (0.7548776662466927, 0.5698402909980532)  # 1/p, 1/p² of p³ = p + 1: an even spread in the plane


def with_probes(model: Model, table: Table) -> Table:
    """The table with its known answers: six points inside the envelope, and one beyond either corner."""
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    k = np.arange(1, N_PROBES - 1)[:, None]
    inside = (k * _GOLDEN) % 1.0
    where = np.concatenate([inside, [[-0.25, -0.25], [1.25, 1.25]]])
    low, span = np.array([t0, r0]), np.array([t1 - t0, r1 - r0])
    points = (low + where * span) * np.array([1.0, model.block_s / 60.0])
    inputs = table.encode_inputs(points)
    status, bits = evaluate_map(table, inputs)
    records = np.concatenate([inputs, bits[:, None], status.astype(np.uint32)[:, None]], axis=1)
    return replace(table, probes=records.reshape(-1))
