"""Known answers of a table: map inputs over the envelope, answered by the reference.

In float32 they are chosen, among many, to come out otherwise where a compiler fuses a product into a sum, whichever
sum it is: the self-test of the target must not pass by luck.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model import Model
from ..target.f32 import FUSIBLE
from ..target.maps import evaluate_map
from ..target.table import Table, Words

__all__ = ["N_PROBES", "with_probes"]

N_PROBES = 8  # known answers in a table: docs/FORMAT.md, section 3
_CANDIDATES = 256  # inputs of which the most telling are taken; more find no better ones
_GOLDEN = (0.7548776662466927, 0.5698402909980532)  # 1/p, 1/p² of p³ = p + 1: an even spread in the plane
#: Each sum fused alone, and what compilers make of all: either of the squares, with everything else.
_BUILDS = (
    *(frozenset({place}) for place in FUSIBLE),
    *(frozenset(FUSIBLE) - {place} for place in ("square of T", "square of slope")),
)


def with_probes(model: Model, table: Table) -> Table:
    """The table with its known answers: six points inside the envelope, and one beyond either corner."""
    k = np.arange(1, _CANDIDATES + 1)[:, None]
    inside = _inputs(model, table, (k * _GOLDEN) % 1.0)
    n = N_PROBES - 2
    chosen = _telling(table, inside, n) if table.numeric == "f32" else list(range(n))
    corners = _inputs(model, table, np.array([[-0.25, -0.25], [1.25, 1.25]]))
    inputs = np.concatenate([inside[chosen], corners])
    status, bits = evaluate_map(table, inputs)
    records = np.concatenate([inputs, bits[:, None], status.astype(np.uint32)[:, None]], axis=1)
    return replace(table, probes=records.reshape(-1))


def _inputs(model: Model, table: Table, where: NDArray[Any]) -> Words:
    """Inputs at shares of the envelope, shape (n, 2)."""
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    low, span = np.array([t0, r0]), np.array([t1 - t0, r1 - r0])
    return table.encode_inputs((low + where * span) * np.array([1.0, model.block_s / 60.0]))


def _telling(table: Table, inputs: Words, n: int) -> list[int]:
    """Numbers of the inputs that tell most builds from a right one, those first that no chosen one told yet."""
    _, right = evaluate_map(table, inputs)
    tells = np.stack([evaluate_map(table, inputs, fused)[1] != right for fused in _BUILDS])
    told = np.zeros(len(_BUILDS))
    free = np.ones(len(inputs), dtype=np.bool_)
    chosen: list[int] = []
    for _ in range(n):
        worth = np.where(free, 2.0 ** (-8.0 * told) @ tells, -1.0)  # exact: sums of powers of two
        best = int(np.argmax(worth))
        chosen.append(best)
        free[best] = False
        told += tells[:, best]
    return chosen
