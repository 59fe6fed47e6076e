"""The map in float32: docs/numerics.md, section 2, one numpy operation for each IEEE operation.

No `np.exp`, `@` or `np.sum`: their results differ between processors. The table of the Gaussian is
made with decimal arithmetic at 60 digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Context, Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..table import Table, Words

__all__ = ["ENTRIES", "cells", "exp2_table", "gauss", "network_bits", "normalise"]

ENTRIES = 64
_CUT = 32 * ENTRIES
#: ((f - H)² + G) c = 2^(-f/64) (1 + 6.7e-9) for |f| <= 1/2
_H = np.float32(float.fromhex("0x1.71549ep+6"))
_G = np.float32(float.fromhex("0x1.0a69ccp+13"))
_C = Decimal(float.fromhex("0x1.ebfc21c077705p-15"))
_ROUND = np.float32(1.5 * 2**23)  # added and subtracted again: rounds to an integer
_EIGHT = np.float32(8.0)


def exp2_table() -> Words:
    """Bits of c 2^(-i/64) in float32, plus i · 2^17; i = 0 ... 63."""
    context = Context(prec=60)
    exact = [_C * context.power(Decimal(2), Decimal(-i) / Decimal(ENTRIES)) for i in range(ENTRIES)]
    # float() rounds to float64 first; at 24 of 53 bits no entry lies near a tie.
    bits = np.array([float(e) for e in exact], dtype=np.float32).view(np.uint32)
    return np.asarray(bits + (np.arange(ENTRIES, dtype=np.uint32) << np.uint32(17)))


_TABLE = exp2_table()


def gauss(u: NDArray[np.float32]) -> NDArray[np.float32]:
    """2^(-u/64), u >= 0; 0 where u rounds to 2048 or more, or is not a number."""
    whole = u + _ROUND
    n = whole.view(np.uint32) - _ROUND.view(np.uint32)
    inside = n < _CUT
    n = np.where(inside, n, np.uint32(0))
    bits = _TABLE[n & np.uint32(ENTRIES - 1)] - (n << np.uint32(17))
    f = np.where(inside, u, np.float32(0.0)) - np.where(inside, whole - _ROUND, np.float32(0.0))
    f = f - _H
    f = f * f
    f = f + _G
    return np.asarray(np.where(inside, bits.view(np.float32) * f, np.float32(0.0)))


@dataclass(frozen=True, slots=True)
class Points:
    """Inputs as they are, shape (n, 2), and normalised: multiples of 2^-21."""

    x: NDArray[np.float32]
    z_t: NDArray[np.float32]
    z_r: NDArray[np.float32]


def normalise(table: Table, x: NDArray[np.float32]) -> Points:
    """What the network sees of inputs (T, slope per block) that lie inside the envelope."""
    scale = table.numbers(table.scale)
    z_t = x[:, 0] - scale[0]
    z_t = z_t * scale[1]
    z_t = (z_t + _EIGHT) - _EIGHT
    z_r = x[:, 1] * scale[2]
    z_r = (z_r + _EIGHT) - _EIGHT
    return Points(x, z_t, z_r)


def network_bits(table: Table, points: Points) -> Words:
    """Bits of the bias."""
    z_t, z_r = points.z_t, points.z_r
    network = table.numbers(table.networks)
    acc = network[1] + network[2] * z_t
    acc = acc + network[3] * z_r
    with np.errstate(under="ignore"):
        for c_t, g_t, c_r, g_r, weight in table.numbers(table.centers).reshape(-1, 5):
            u = (z_t - c_t) * g_t
            u = u * u
            q = (z_r - c_r) * g_r
            q = q * q
            acc = acc + weight * gauss(u + q)
    return np.asarray(acc).view(np.uint32)


def cells(table: Table, points: Points) -> NDArray[np.int64]:
    """Cells of the coverage map, (T, slope), shape (n, 2)."""
    envelope = table.numbers(table.envelope)
    columns = [_cell(points.x[:, k], envelope[2 * k : 2 * k + 2], table.coverage_cells[k]) for k in (0, 1)]
    return np.stack(columns, axis=1)


def _cell(x: NDArray[np.float32], limits: NDArray[Any], n: int) -> NDArray[np.int64]:
    span = limits[1] - limits[0]
    if not span > 0:
        return np.zeros(x.size, dtype=np.int64)
    factor = np.float32(n) / span
    position = (x - limits[0]) * factor
    inner = position < np.float32(n - 1)
    return np.where(inner, np.where(inner, position, 0).astype(np.int64), n - 1)
