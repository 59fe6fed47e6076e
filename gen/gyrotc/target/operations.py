"""Operations of extension terms in both arithmetics of the target: mirrors of libc/gtc_num_<n>.h.

The recursions themselves stand in `target.recursions`; every operation here is rounded as on the target.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import f32, q31
from .arithmetic import Bells, Numbers, Operations
from .recursions import Recursion, TableKind, recursion_of
from .table import Table

_SINE_F32 = tuple(
    np.float32(float.fromhex(c))
    for c in ("0x1.3c4b2cp-13", "-0x1.3232fap-8", "0x1.46676ep-4", "-0x1.4abbb6p-1", "0x1.921fb4p+0")
)
_SINE_Q31 = (161942, -5016767, 85564854, -693597876, 1686629674)  # 2^-30
_ROUND = np.float32(1.5 * 2**23)  # added and subtracted again: rounds to an integer
_ONE, _FOUR = np.float32(1.0), np.float32(4.0)  # a turn has four quarters
_LARGEST = 2**31 - 1  # a signed 32-bit word
_PART = 2**30  # of a factor of products that keep to 63 bits
_FAR = 6 * 2**28  # an argument whose square is 36 octaves: a Gaussian ends at 32


class _F32(Operations):
    """float32: the same operations, one by one, on numpy's float32; exponential and cosine are its own."""

    def scalars(self, x: Numbers) -> Sequence[Any]:
        return list(x)

    def array(self, x: Sequence[Any]) -> Numbers:
        return np.array(x, dtype=np.float32)

    def fading(self, blocks: NDArray[np.int64], gain: Any, amplitude: Any) -> Numbers:
        u = blocks.astype(np.float32) * gain
        return np.asarray(amplitude * f32.gauss(u))

    def wave(self, x: Numbers, frequency: Any, phase: Any, amplitude: Any) -> Numbers:
        turns = x * frequency
        turns = turns + phase
        whole = turns + _ROUND
        whole = whole - _ROUND
        t = np.abs(turns - whole)
        t = _FOUR * t
        t = _ONE - t
        s = t * t
        h = np.full_like(s, _SINE_F32[0])
        for coefficient in _SINE_F32[1:]:
            h = h * s
            h = h + coefficient
        h = h * t
        return np.asarray(amplitude * h)

    def bells(self, x: Numbers, gain: Any, bells: Bells) -> Numbers:
        first, second = (self._bell(x, gain, center, weight) for center, weight in bells)
        return np.asarray(first + second)

    def _bell(self, x: Numbers, gain: Any, center: Any, weight: Any) -> Numbers:
        u = x - center
        u = u * gain
        u = u * u
        return np.asarray(weight * f32.gauss(u))


class _Q31(Operations):
    """Fixed point: Python integers one by one, int64 in arrays; no product leaves 63 bits."""

    def array(self, x: Sequence[Any]) -> Numbers:
        return np.array(x, dtype=np.int64)

    def settle(self, x: Any) -> Any:
        return x << 16

    def reading(self, z: Numbers) -> Numbers:
        return np.asarray(z >> 16)

    def follow(self, z: Any, x: Any, gain: Any) -> Any:
        d = (x << 16) - z
        return z + (((d >> 10) * gain) >> 21)

    def scaled_difference(self, a: Numbers, b: Any, factor: Any) -> Numbers:
        return np.asarray(((a - b) * factor) >> 16)

    def slope_of(self, a: Numbers, b: Numbers, rate: Any) -> Numbers:
        return np.asarray(np.clip(((a - b) * rate) >> 24, -_LARGEST, _LARGEST))

    def fading(self, blocks: NDArray[np.int64], gain: Any, amplitude: Any) -> Numbers:
        u = (blocks * gain) >> 4
        power = q31.exp2(np.minimum(u, q31.CUT - 1).astype(np.uint64)).astype(np.int64)
        return np.where(u >= q31.CUT, 0, (amplitude * power) >> 29)

    def wave(self, x: Numbers, frequency: Any, phase: Any, amplitude: Any) -> Numbers:
        part = (((x * frequency) >> 16) + phase) & 0xFFFFFFFF
        t = 2**30 - np.where(part > 2**31, 2**32 - part, part)
        s = (t * t) >> 30
        h = np.full_like(s, _SINE_Q31[0])
        for coefficient in _SINE_Q31[1:]:
            h = ((h * s) >> 30) + coefficient
        h = (h * t) >> 30
        return np.asarray((amplitude * h) >> 30)

    def limited(self, x: Numbers) -> Numbers:
        return np.clip(x, -_PART, _PART)

    def bells(self, x: Numbers, gain: Any, bells: Bells) -> Numbers:
        first, second = (weight * self._bell(x, gain, center) for center, weight in bells)
        return np.asarray((first + second) >> 29)

    def _bell(self, x: Numbers, gain: Any, center: Any) -> Numbers:
        """2^-((x - center) gain)^2 in 2^-29."""
        argument = ((x - center) * gain) >> 12
        far = np.abs(argument) > _FAR
        u = (np.where(far, 0, argument) ** 2) >> 32
        power = q31.exp2(np.minimum(u, q31.CUT - 1).astype(np.uint64)).astype(np.int64)
        return np.where(far | (u >= q31.CUT), 0, power)


_OPERATIONS: dict[str, Operations] = {"f32": _F32(), "q31": _Q31()}


def recursions(table: Table) -> list[Recursion]:
    """The terms of a table."""
    made = []
    for record in table.records("terms"):
        numbers = table.numbers(record[2:])
        parameters = list(numbers) if table.numeric == "f32" else [int(n) for n in numbers]
        made.append(recursion_of(TableKind(int(record[0])), _OPERATIONS[table.numeric], parameters))
    return made
