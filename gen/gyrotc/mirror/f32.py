"""The map in float32: docs/numerics.md, section 2, one numpy operation for each IEEE operation.

No `np.exp`, `@` or `np.sum`: their results differ between processors. The table of the Gaussian is
made with decimal arithmetic at 60 digits.

With `fused` the same map comes out as a build makes it that breaks the rules: the named sums take a product
that was not rounded. Known answers are chosen by it; it answers nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Context, Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .table import Table, Words

Fused = frozenset[str]
#: Sums of the map that take a product: the grid of the inputs, the linear part, the squared distance (either of its
#: products), the polynomial of the Gaussian, the weighted sum.
FUSIBLE = ("grid", "linear", "square of T", "square of slope", "polynomial", "weight")
_NONE: Fused = frozenset()

ENTRIES = 64  # docs/numerics.md, "Why the lookup table has 64 entries"
_CUT = 32 * ENTRIES  # 64ths of an octave: a Gaussian is 0 beyond 32 octaves
#: ((f - H)² + G) c = 2^(-f/64) (1 + 6.7e-9) for |f| <= 1/2, with these:
_H = np.float32(float.fromhex("0x1.71549ep+6"))
_G = np.float32(float.fromhex("0x1.0a69ccp+13"))
_C = Decimal(float.fromhex("0x1.ebfc21c077705p-15"))
_ROUND = np.float32(1.5 * 2**23)  # added and subtracted again: rounds to an integer
_ONE, _EIGHT = np.float32(1.0), np.float32(8.0)  # the largest normalised input: docs/numerics.md, section 2


def exp2_table() -> Words:
    """Bits of c 2^(-i/64) in float32, plus i · 2^17; i = 0 ... 63."""
    context = Context(prec=60)
    exact = [_C * context.power(Decimal(2), Decimal(-i) / Decimal(ENTRIES)) for i in range(ENTRIES)]
    # float() rounds to float64 first; at 24 of 53 bits no entry lies near a tie.
    bits = np.array([float(e) for e in exact], dtype=np.float32).view(np.uint32)
    return np.asarray(bits + (np.arange(ENTRIES, dtype=np.uint32) << np.uint32(17)))


_TABLE = exp2_table()


def product_plus(
    place: str, a: NDArray[np.float32], b: Any, c: NDArray[np.float32] | np.float32, fused: Fused
) -> NDArray[np.float32]:
    """a b + c, the product rounded unless this place is fused."""
    if place not in fused:
        return np.asarray(a * b + c)
    product, addend = a.astype(np.float64) * np.float64(b), np.float64(c)  # 48 bits: exact
    total = product + addend
    back = total - product
    error = (product - (total - back)) + (addend - back)
    # Rounded to odd, a float64 rounds on to float32 as the exact sum does (Boldo and Melquiond 2008).
    even = (total.view(np.int64) & 1) == 0
    away = np.where((error > 0) == (total > 0), 1, -1)
    odd = np.where((error != 0) & even, total.view(np.int64) + away, total.view(np.int64))
    return np.asarray(odd.view(np.float64).astype(np.float32))


def gauss(u: NDArray[np.float32], fused: Fused = _NONE) -> NDArray[np.float32]:
    """2^(-u/64), u >= 0; 0 where u rounds to 2048 or more, or is not a number."""
    whole = u + _ROUND
    n = whole.view(np.uint32) - _ROUND.view(np.uint32)
    inside = n < _CUT
    n = np.where(inside, n, np.uint32(0))
    bits = _TABLE[n & np.uint32(ENTRIES - 1)] - (n << np.uint32(17))
    f = np.where(inside, u, np.float32(0.0)) - np.where(inside, whole - _ROUND, np.float32(0.0))
    f = f - _H
    f = product_plus("polynomial", f, f, _G, fused)
    return np.asarray(np.where(inside, bits.view(np.float32) * f, np.float32(0.0)))


@dataclass(frozen=True, slots=True)
class Points:
    """Inputs as they are, shape (n, 2), and normalised: multiples of 2^-21."""

    x: NDArray[np.float32]
    z_t: NDArray[np.float32]
    z_r: NDArray[np.float32]


def normalise(table: Table, x: NDArray[np.float32], fused: Fused = _NONE) -> Points:
    """Normalise inputs (T, slope per block) inside the envelope as the network sees them."""
    scale = table.numbers(table.scale)
    z_t = product_plus("grid", x[:, 0] - scale[0], scale[1], _EIGHT, fused) - _EIGHT
    z_r = product_plus("grid", x[:, 1], scale[2], _EIGHT, fused) - _EIGHT
    return Points(x, z_t, z_r)


def biases(table: Table, points: Points, fused: Fused = _NONE) -> NDArray[np.float32]:
    """The map's results."""
    networks = table.numbers(table.records("networks"))[: table.n_networks]
    counts = table.records("networks")[: table.n_networks, 0].astype(np.int64)
    if len(networks) == 1:
        return _network(table, networks[0], 0, int(counts[0]), points, fused)
    total, shares = np.zeros_like(points.z_t), np.zeros_like(points.z_t)
    first = 0
    for network, count in zip(networks, counts, strict=True):
        share = _share(table, network, points)
        used = share > 0
        product = share * _network(table, network, first, int(count), points, fused)
        total = np.where(used, total + product, total)
        shares = np.where(used, shares + share, shares)
        first += int(count)
    quotient = total / np.where(shares > 0, shares, _ONE)
    fallback = table.numbers([table.fallback])[0]
    return np.asarray(np.where(shares > 0, quotient, fallback))


def fallback_model(table: Table, number: int, points: Points) -> NDArray[np.float32]:
    """Evaluate the network of a number, from 1 on, at inputs."""
    records = table.records("networks")
    first, count = int(records[: number - 1, 0].sum()), int(records[number - 1, 0])
    return _network(table, table.numbers(records[number - 1]), first, count, points, _NONE)


def _network(
    table: Table, network: NDArray[np.float32], first: int, count: int, points: Points, fused: Fused
) -> NDArray[np.float32]:
    """One network, whose centers are `first` ... `first + count - 1`."""
    z_t, z_r = points.z_t, points.z_r
    acc = product_plus("linear", z_t, network[2], network[1], fused)
    acc = product_plus("linear", z_r, network[3], acc, fused)
    centers = table.numbers(table.records("centers"))[first : first + count]
    with np.errstate(under="ignore"):
        for c_t, g_t, c_r, g_r, weight in centers:
            u = (z_t - c_t) * g_t
            q = (z_r - c_r) * g_r
            if "square of slope" in fused:
                u = product_plus("square of slope", q, q, u * u, fused)
            else:
                u = product_plus("square of T", u, u, q * q, fused)
            acc = product_plus("weight", gauss(u, fused), weight, acc, fused)
    return np.asarray(acc)


def _share(table: Table, network: NDArray[np.float32], points: Points) -> NDArray[np.float32]:
    """Share of a network, before the blend is divided by their sum."""
    envelope = table.numbers(table.envelope)
    share = np.full_like(points.z_t, _ONE)
    for k in (0, 1):
        low, high = network[4 + 2 * k : 6 + 2 * k]
        if low > envelope[2 * k]:
            share = np.minimum(share, _fraction(low, points.x[:, k], high))
        if high < envelope[2 * k + 1]:
            share = np.minimum(share, _fraction(high, points.x[:, k], low))
    return share


def _fraction(start: Any, x: NDArray[np.float32], end: Any) -> NDArray[np.float32]:
    way = (x - start) / (end - start)
    return np.asarray(np.where(way > 0, way, np.float32(0.0)))


def cells(table: Table, points: Points, counts: tuple[int, int]) -> NDArray[np.int64]:
    """Cells of a grid of so many over the envelope, (T, slope), shape (n, 2)."""
    envelope = table.numbers(table.envelope)
    columns = [_cell(points.x[:, k], envelope[2 * k : 2 * k + 2], counts[k]) for k in (0, 1)]
    return np.stack(columns, axis=1)


def _cell(x: NDArray[np.float32], limits: NDArray[Any], n: int) -> NDArray[np.int64]:
    span = limits[1] - limits[0]
    if not span > 0:
        return np.zeros(x.size, dtype=np.int64)
    factor = np.float32(n) / span
    position = (x - limits[0]) * factor
    inner = position < np.float32(n - 1)
    return np.where(inner, np.where(inner, position, 0).astype(np.int64), n - 1)
