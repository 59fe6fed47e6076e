"""The map in fixed point: docs/numerics.md, section 3, in numpy integers of 64 bits.

Every product fits: inputs have 16 bits, arguments 31, entries of the table 31, weights 31.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Context, Decimal

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import IntArray
from .recursions import divided
from .table import Table

ENTRIES = 64  # docs/numerics.md, "Why the lookup table has 64 entries"
CUT = 32 << 24  # u in 2^-24
_H = np.uint64(1557473452)  # 2^-24
_G = np.uint64(558709134)  # 2^-16
_TOP = 2052389455  # 2^-29 of one, at the top of the table: docs/numerics.md, section 3
#: |2^-29 exp2(u) - 2^-v| for every v that truncates to u (all u: tests/cases/mirror/test_reference.py)
GAUSS_ERROR = 2.9e-8

_FULL_SHARE = 2**24  # one, in 2^-24
_LAST_POSITION = 65535  # 16 bits of an input: docs/numerics.md, section 3


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

    x_t: IntArray
    x_r: IntArray


def normalise(table: Table, x: IntArray) -> Points:
    """Normalise inputs (T, slope per block in 2^-16 C) inside the envelope as the network sees them, shape (n, 2)."""
    low_t, _, low_r, _ = (int(v) for v in table.numbers(table.envelope))
    return Points(_position(x[:, 0], low_t, table.scale[0]), _position(x[:, 1], low_r, table.scale[1]))


def _position(x: IntArray, low: int, gain: int) -> IntArray:
    offset = (x - low).astype(np.uint64) << np.uint64(5)
    return np.asarray(((offset * np.uint64(gain)) >> np.uint64(32)).astype(np.int64))


def biases(table: Table, points: Points) -> IntArray:
    """The map's results."""
    networks = table.numbers(table.records("networks"))[: table.n_networks]
    if len(networks) == 1:
        return _network(table, networks[0], 0, points)
    total: IntArray = np.zeros_like(points.x_t)
    shares: IntArray = np.zeros_like(points.x_t)
    first = 0
    for network in networks:
        share: IntArray = np.minimum(_share(network[4:6], points.x_t), _share(network[6:8], points.x_r))
        total = total + share * _network(table, network, first, points)
        shares = shares + share
        first += int(network[0])
    blended = divided(total, np.maximum(shares, 1))
    return np.where(shares > 0, blended, table.numbers([table.fallback])[0])


def fallback_model(table: Table, number: int, points: Points) -> IntArray:
    """Evaluate the network of a number, from 1 on, at inputs."""
    networks = table.numbers(table.records("networks"))
    return _network(table, networks[number - 1], int(networks[: number - 1, 0].sum()), points)


def _network(table: Table, network: IntArray, first: int, points: Points) -> IntArray:
    """One network, whose centers stand from record `first` on; units of the bias."""
    narrow = int(table.scale[2])
    count, w0, linear_t, linear_r = (int(n) for n in network[:4])
    acc = (linear_t * points.x_t + linear_r * points.x_r) * 8192
    centers = table.numbers(table.records("centers"))[first : first + count]
    for s_t, k_t, s_r, k_r, weight in centers:
        a = (s_t * points.x_t + k_t).astype(np.uint64)  # squares are those of the signed number, mod 2^64
        b = (s_r * points.x_r + k_r).astype(np.uint64)
        u = (a * a + b * b) >> np.uint64(32 - narrow)
        inside = u < CUT
        e = exp2(np.where(inside, u, np.uint64(0))).astype(np.int64)
        acc = acc + np.where(inside, weight * e, 0)
    return np.asarray(w0 + (acc >> 29))


def _share(region: IntArray, x: IntArray) -> IntArray:
    """Share of a network by one input, in 2^-24, before the blend is divided by their sum."""
    low, high = (int(edge) for edge in region)
    share = np.full_like(x, _FULL_SHARE)
    if low > 0:
        share = np.minimum(share, np.maximum(x - low, 0) * _FULL_SHARE // np.int64(high - low))
    if high < _LAST_POSITION:
        share = np.minimum(share, np.maximum(high - x, 0) * _FULL_SHARE // np.int64(high - low))
    return share


def cells(points: Points, counts: tuple[int, int]) -> IntArray:
    """Cells of a grid of so many over the envelope, (T, slope), shape (n, 2)."""
    n_t, n_r = counts
    return np.stack([(points.x_t * n_t) >> 16, (points.x_r * n_r) >> 16], axis=1)
