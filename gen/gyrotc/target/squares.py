"""Operations of the uncertainty in both arithmetics: mirrors of the last part of libc/gtc_num_<n>.h.

A square is a float32 number, or an unsigned one of 64 bits in the square of the bias' unit; in fixed point each part
is no larger than 2^30, so that the sum of all fits.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["RULES", "SQUARES", "Squares"]

Numbers = NDArray[Any]

#: Words of a table's uncertainty behind its two grids, without those of the terms.
RULES = 11

_PART = 2**30  # fewer than 16 squares of it fit 64 bits
_LARGEST = 2**31 - 1  # of a word
_HALF_EXPONENT = np.uint32(
    0x1FBB4F2E
)  # half the exponent's bias, less what makes the first guess of a root even
_HALF, _ONE, _TWO = np.float32(0.5), np.float32(1.0), np.float32(2.0)  # in float32, so that nothing widens


class Squares(Protocol):
    """Operations of one arithmetic, element by element, each rounded as on the target."""

    def squared(self, x: Numbers) -> Numbers: ...

    def per_c(self, a: Numbers, b: Any, word: Any) -> Numbers:
        """word (a - b)"""

    def times(self, k: NDArray[np.int64], x: Any) -> Numbers:
        """k x, x of magnitude 2^30 at most in fixed point."""

    def limited(self, x: Numbers) -> Numbers: ...

    def estimate(self, mean: Numbers, start: Numbers, blocks: NDArray[np.int64]) -> Numbers:
        """2 (mean - start) / (2 blocks - 1): the slope of a front end that began at `start`."""

    def root(self, x: Numbers) -> Numbers: ...

    def remaining(self, word: Any, gain: Any, blocks: NDArray[np.int64]) -> Numbers: ...

    def unsettled(self, width: Any, low: Numbers, high: Numbers, word: Any) -> Numbers: ...


class _F32:
    def squared(self, x: Numbers) -> Numbers:
        x = np.asarray(x, dtype=np.float32)
        return np.asarray(x * x)

    def per_c(self, a: Numbers, b: Any, word: Any) -> Numbers:
        return np.asarray(word * (a - b))

    def times(self, k: NDArray[np.int64], x: Any) -> Numbers:
        return np.asarray(np.asarray(k).astype(np.float32) * x)

    def limited(self, x: Numbers) -> Numbers:
        return x

    def estimate(self, mean: Numbers, start: Numbers, blocks: NDArray[np.int64]) -> Numbers:
        return np.asarray((_TWO * (mean - start)) / (2 * blocks - 1).astype(np.float32))

    def root(self, x: Numbers) -> Numbers:
        x = np.asarray(x, dtype=np.float32)
        there = x > 0
        safe = np.where(there, x, _ONE)
        y = ((safe.view(np.uint32) >> np.uint32(1)) + _HALF_EXPONENT).view(np.float32)
        for _ in range(4):
            y = _HALF * (y + safe / y)
        return np.asarray(np.where(there, y, np.float32(0.0)))

    def remaining(self, word: Any, gain: Any, blocks: NDArray[np.int64]) -> Numbers:
        left = np.array([self._left(gain, int(n)) for n in np.asarray(blocks).reshape(-1)], dtype=np.float32)
        return np.asarray(word * (_ONE - left))

    def _left(self, gain: Any, blocks: int) -> Any:
        """What a memory has taken of a difference after so many blocks."""
        factor, left = _ONE - gain, _ONE
        while blocks:
            if blocks & 1:
                left = left * factor
            factor = factor * factor
            blocks >>= 1
            if left <= np.float32(2.0**-30):
                blocks = 0
        return _ONE - left

    def unsettled(self, width: Any, low: Numbers, high: Numbers, word: Any) -> Numbers:
        left = word * ((width + width) - (high - low))
        return np.asarray(np.where(left > 0, left, np.float32(0.0)))


class _Q31:
    def squared(self, x: Numbers) -> Numbers:
        magnitude = np.abs(self.limited(np.asarray(x, dtype=np.int64))).astype(np.uint64)
        return np.asarray(magnitude * magnitude)

    def per_c(self, a: Numbers, b: Any, word: Any) -> Numbers:
        return np.asarray(((a - b) * int(word)) >> 16)

    def times(self, k: NDArray[np.int64], x: Any) -> Numbers:
        return np.asarray(np.asarray(k, dtype=np.int64) * x)

    def limited(self, x: Numbers) -> Numbers:
        return np.asarray(np.clip(x, -_PART, _PART))

    def estimate(self, mean: Numbers, start: Numbers, blocks: NDArray[np.int64]) -> Numbers:
        num, den = 2 * (mean - start), 2 * blocks - 1
        return np.asarray(np.sign(num) * ((np.abs(num) + den // 2) // den))

    def root(self, x: Numbers) -> Numbers:
        rest = np.atleast_1d(np.asarray(x, dtype=np.uint64)).copy()
        root = np.zeros_like(rest)
        for shift in range(62, -1, -2):
            bit = np.uint64(1 << shift)
            more = rest >= root + bit
            rest = np.where(more, rest - (root + bit), rest)
            root = np.where(more, (root >> np.uint64(1)) + bit, root >> np.uint64(1))
        return np.asarray(np.minimum(root, np.uint64(_LARGEST)).astype(np.int64).reshape(np.shape(x)))

    def remaining(self, word: Any, gain: Any, blocks: NDArray[np.int64]) -> Numbers:
        left = [self._left(int(gain), int(n)) for n in np.asarray(blocks).reshape(-1)]
        return np.asarray((int(word) * np.array(left, dtype=np.int64)) >> 31)

    def _left(self, gain: int, blocks: int) -> int:
        factor, left = _LARGEST - gain, _LARGEST
        while blocks:
            if blocks & 1:
                left = (left * factor) >> 31
            factor = (factor * factor) >> 31
            blocks >>= 1
        return left

    def unsettled(self, width: Any, low: Numbers, high: Numbers, word: Any) -> Numbers:
        left = self.limited(2 * int(width) - (high - low))
        return np.asarray(np.where(left > 0, (left * int(word)) >> 16, 0))


SQUARES: dict[str, Squares] = {"f32": _F32(), "q31": _Q31()}
