"""The map in fixed point: docs/numerics.md, section 3, in numpy integers of 64 bits.

Every product fits: inputs have 16 bits, arguments 31, entries of the table 31, weights 31.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Context, Decimal

import numpy as np
from numpy.typing import NDArray

from ..table import Table, Words

__all__ = [
    "CUT",
    "ENTRIES",
    "GAUSS_ERROR",
    "POSITION_BITS",
    "Points",
    "cells",
    "exp2",
    "exp2_table",
    "network_bits",
    "normalise",
]

ENTRIES = 64
CUT = 32 << 24  # u in 2^-24
POSITION_BITS = 27  # gain of an input: position = offset * gain * 2^-27
_H = np.uint64(1557473452)  # 2^-24
_G = np.uint64(558709134)  # 2^-16
_TOP = 2052389455
#: |2^-29 exp2(u) - 2^-v| for every v that truncates to u; proved by visiting every u (tests/py/test_reference.py)
GAUSS_ERROR = 2.9e-8

Integers = NDArray[np.int64]


def exp2_table() -> NDArray[np.uint64]:
    """round(2052389455 · 2^(-i/64)), i = 0 ... 63."""
    context = Context(prec=60)
    exact = [_TOP * context.power(Decimal(2), Decimal(-i) / Decimal(ENTRIES)) for i in range(ENTRIES)]
    return np.array([int(e.to_integral_value(ROUND_HALF_EVEN)) for e in exact], dtype=np.uint64)


_TABLE = exp2_table()


def exp2(u: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """2^-u in 2^-29, for u in 2^-24, 0 <= u < CUT: table · ((H - t)² + G), shifted."""
    v = _H - ((u & np.uint64(0x3FFFF)) << np.uint64(6))
    s = ((v * v) >> np.uint64(32)) + _G
    entry = _TABLE[((u >> np.uint64(18)) & np.uint64(63)).astype(np.int64)]
    return np.asarray(((entry * s) >> np.uint64(32)) >> (u >> np.uint64(24)))


@dataclass(frozen=True, slots=True)
class Points:
    """Inputs over the envelope, 0 ... 2^16 - 1."""

    x_t: Integers
    x_r: Integers


def normalise(table: Table, x: Integers) -> Points:
    """What the network sees of inputs (T, slope per block in 2^-16 C) inside the envelope, shape (n, 2)."""
    low_t, _, low_r, _ = (int(v) for v in table.numbers(table.envelope))
    return Points(_position(x[:, 0], low_t, table.scale[0]), _position(x[:, 1], low_r, table.scale[1]))


def _position(x: Integers, low: int, gain: int) -> Integers:
    offset = (x - low).astype(np.uint64) << np.uint64(5)
    return np.asarray(((offset * np.uint64(gain)) >> np.uint64(32)).astype(np.int64))


def network_bits(table: Table, points: Points) -> Words:
    """Bits of the bias."""
    narrow = int(table.scale[2])
    _, w0, linear_t, linear_r, *_ = (int(n) for n in table.numbers(table.networks))
    acc = (linear_t * points.x_t + linear_r * points.x_r) * 8192
    for s_t, k_t, s_r, k_r, weight in table.numbers(table.centers).reshape(-1, 5):
        a = (s_t * points.x_t + k_t).astype(np.uint64)  # squares are those of the signed number, mod 2^64
        b = (s_r * points.x_r + k_r).astype(np.uint64)
        u = (a * a + b * b) >> np.uint64(32 - narrow)
        inside = u < CUT
        e = exp2(np.where(inside, u, np.uint64(0))).astype(np.int64)
        acc = acc + np.where(inside, weight * e, 0)
    return np.asarray(w0 + (acc >> 29)).astype(np.int32).view(np.uint32)


def cells(table: Table, points: Points) -> Integers:
    """Cells of the coverage map, (T, slope), shape (n, 2)."""
    n_t, n_r = table.coverage_cells
    return np.stack([(points.x_t * n_t) >> 16, (points.x_r * n_r) >> 16], axis=1)
