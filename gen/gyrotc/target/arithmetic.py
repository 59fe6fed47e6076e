"""The operations of front end and terms in each arithmetic, and in float64.

`target.history` has those of the target: float32 and fixed point.

Element by element only: `np.sum`, `@` and the like may add in any order and are not used.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Numbers = NDArray[Any]
Bells = tuple[tuple[Any, Any], tuple[Any, Any]]


class Operations:
    """Operations of float64, one by one; those of the target, each rounded as there, are its subclasses."""

    def scalars(self, x: Numbers) -> Sequence[Any]:
        """Numbers one by one, of the type that `follow` takes."""
        return list(x.tolist())

    def array(self, x: Sequence[Any]) -> Numbers:
        return np.array(x, dtype=np.float64)

    def settle(self, x: Any) -> Any:
        """A memory at rest at x."""
        return x

    def follow(self, z: Any, x: Any, gain: Any) -> Any:
        """A memory after a block of mean x."""
        return z + gain * (x - z)

    def reading(self, z: Numbers) -> Numbers:
        """The numbers that a memory shows."""
        return z

    def scaled_difference(self, a: Numbers, b: Any, factor: Any) -> Numbers:
        return np.asarray(factor * (a - b))

    def slope_of(self, a: Numbers, b: Numbers, rate: Any) -> Numbers:
        """(a - b) rate, per block."""
        return self.scaled_difference(a, b, rate)

    def fading(self, blocks: NDArray[np.int64], gain: Any, amplitude: Any) -> Numbers:
        """amplitude 2^-(blocks gain)."""
        return np.asarray(amplitude * np.exp2(-gain * blocks))

    def wave(self, x: Numbers, frequency: Any, phase: Any, amplitude: Any) -> Numbers:
        return np.asarray(amplitude * np.cos(2.0 * np.pi * (x * frequency + phase)))

    def limited(self, x: Numbers) -> Numbers:
        """The nearest number that may be multiplied."""
        return x

    def bells(self, x: Numbers, gain: Any, bells: Bells) -> Numbers:
        """Sum of weight 2^-((x - center) gain)^2 over two (center, weight)."""
        first, second = (weight * np.exp2(-(((x - center) * gain) ** 2)) for center, weight in bells)
        return np.asarray(first + second)


FLOAT64 = Operations()


_MISSING_Q31 = -(2**31)  # the word that fixed point has for no value (docs/FORMAT.md)


class Arithmetic:
    """Operations of float32 on temperatures; arrays broadcast, and every result is rounded as on the target.

    Fixed point has its own.
    """

    def numbers(self, x: ArrayLike) -> Numbers:
        return np.asarray(x, dtype=np.float32)

    def missing(self, n: int) -> Numbers:
        """n samples that did not arrive."""
        return np.full(n, np.nan, dtype=np.float32)

    def is_missing(self, x: Numbers) -> NDArray[np.bool_]:
        return ~np.isfinite(x)

    def limit(self, max_step: Any, max_rate: Any, us: int) -> Any:
        """max_step + max_rate * time, in microseconds."""
        change = np.float32(max_rate) * np.float32(us)
        return np.float32(max_step) + change

    def is_near(self, a: Any, b: Any, limit: Any) -> Any:
        return np.abs(a - b) <= limit

    def running_sum(self, d: Numbers) -> Numbers:
        """Last of the running sums along axis 1, added from left to right."""
        # accumulate is sequential by definition: r[i] = r[i-1] + d[i]
        return np.asarray(np.add.accumulate(d, axis=1, dtype=np.float32)[:, -1])

    def mean(self, base: Numbers, total: Numbers, n: NDArray[np.int64]) -> Numbers:
        quotient = total / n.astype(np.float32)
        return np.asarray(base + quotient)

    def slope(self, d: Numbers, used: NDArray[np.bool_]) -> Numbers:
        """Least-squares slope of differences d at abscissae 0, 1, ... where `used`; 0 where under two are.

        Args:
            d: Shape (abscissae, n).
            used: The same shape.
        """
        sum_d, sum_kd = np.zeros_like(d[0]), np.zeros_like(d[0])
        everywhere = used.all()
        for abscissa, one in enumerate(d):
            product = np.float32(abscissa) * one
            there = True if everywhere else used[abscissa]
            np.add(sum_d, one, out=sum_d, where=there)
            np.add(sum_kd, product, out=sum_kd, where=there)
        n, sum_k, sum_kk = moments(used)
        den = n * sum_kk - sum_k * sum_k
        first = n.astype(np.float32) * sum_kd
        second = sum_k.astype(np.float32) * sum_d
        num = first - second
        return np.asarray(num / np.where(den > 0, den, 1).astype(np.float32))


def moments(used: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """n, Σk, Σk² over the abscissae k = 0, 1, ... in use, shape (n,) each."""
    k = np.arange(len(used), dtype=np.int64)
    if used.all():  # as almost everywhere
        n, sum_k, sum_kk = (np.full(used.shape[1], total) for total in (k.size, k.sum(), (k * k).sum()))
        return n, sum_k, sum_kk
    return np.count_nonzero(used, axis=0), k @ used, (k * k) @ used


class _Q31(Arithmetic):
    """Temperatures in 2^-16 C, held in int64; every result fits 32 bits, sums and products 64."""

    def numbers(self, x: ArrayLike) -> Numbers:
        return np.asarray(x, dtype=np.int64)

    def missing(self, n: int) -> Numbers:
        return np.full(n, _MISSING_Q31, dtype=np.int64)

    def is_missing(self, x: Numbers) -> NDArray[np.bool_]:
        return np.asarray(x == _MISSING_Q31)

    def limit(self, max_step: Any, max_rate: Any, us: int) -> Any:
        return min(int(max_step) + ((int(max_rate) * us) >> 24), 2**32 - 1)

    def running_sum(self, d: Numbers) -> Numbers:
        return np.asarray(np.add.accumulate(d, axis=1)[:, -1])

    def mean(self, base: Numbers, total: Numbers, n: NDArray[np.int64]) -> Numbers:
        return np.asarray(base + divided(total, n))

    def slope(self, d: Numbers, used: NDArray[np.bool_]) -> Numbers:
        sum_d, sum_kd = np.zeros_like(d[0]), np.zeros_like(d[0])
        for abscissa, one in enumerate(d * used):
            sum_d += one
            sum_kd += abscissa * one
        n, sum_k, sum_kk = moments(used)
        den = n * sum_kk - sum_k * sum_k
        return divided(n * sum_kd - sum_k * sum_d, np.where(den > 0, den, 1))


def divided(num: Any, den: Any) -> NDArray[np.int64]:
    """num/den rounded to nearest, halves away from zero; den > 0."""
    magnitude = np.abs(num) + np.asarray(den) // 2
    return np.asarray(np.sign(num) * (magnitude // den))


F32 = Arithmetic()
Q31: Arithmetic = _Q31()
