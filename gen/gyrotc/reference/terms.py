"""Extension terms, step by step: mirrors of libc/gtc_term_*.inl in both arithmetics.

A term is a small object with the four hooks that its C code has; numbers are np.float32, or Python
integers for fixed point, and every operation is one of the target's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..table import ARRAYS, AUXILIARY, HARMONIC, MEMORY, PLAY, Table
from . import f32, q31

__all__ = ["Effect", "Hook", "hooks"]

_HELD = 8  # GTC_HELD
_SINE_F32 = tuple(
    np.float32(float.fromhex(c))
    for c in ("0x1.3c4b2cp-13", "-0x1.3232fap-8", "0x1.46676ep-4", "-0x1.4abbb6p-1", "0x1.921fb4p+0")
)
_SINE_Q31 = (161942, -5016767, 85564854, -693597876, 1686629674)  # 2^-30
_ROUND = np.float32(1.5 * 2**23)
_ONE, _FOUR = np.float32(1.0), np.float32(4.0)


@dataclass(slots=True)
class Effect:
    """What the terms make of an input (temperature, slope) and add to the bias."""

    temperature: Any
    slope: Any
    added: Any
    remarks: int


_CHANNEL_MAX = np.float32(1e9)  # magnitude of a sample of an auxiliary channel in float32


class Operations(Protocol):
    """Operations of one arithmetic on single numbers."""

    zero: Any

    def is_missing(self, x: Any) -> bool:
        """Whether a sample of an auxiliary channel is none."""

    def settle(self, x: Any) -> Any: ...

    def follow(self, z: Any, x: Any, gain: Any) -> Any: ...

    def power(self, gain: Any, blocks: int) -> Any: ...

    def reading(self, z: Any) -> Any:
        """The number that a memory shows."""

    def scaled_difference(self, a: Any, b: Any, factor: Any) -> Any: ...

    def slope_of(self, a: Any, b: Any, rate: Any) -> Any: ...

    def fading(self, blocks: int, gain: Any, amplitude: Any) -> Any: ...

    def wave(self, x: Any, frequency: Any, phase: Any, amplitude: Any) -> Any: ...

    def mean(self, base: Any, total: Any, n: int) -> Any: ...


class _F32:
    zero = np.float32(0.0)

    def is_missing(self, x: Any) -> bool:
        return not abs(x) <= _CHANNEL_MAX

    def settle(self, x: Any) -> Any:
        return x

    def reading(self, z: Any) -> Any:
        return z

    def follow(self, z: Any, x: Any, gain: Any) -> Any:
        d = x - z
        d = gain * d
        return z + d

    def power(self, gain: Any, blocks: int) -> Any:
        factor, left = _ONE - gain, _ONE
        while blocks and left > np.float32(2.0**-30):
            if blocks & 1:
                left = left * factor
            factor = factor * factor
            blocks >>= 1
        return _ONE - left

    def scaled_difference(self, a: Any, b: Any, factor: Any) -> Any:
        d = a - b
        return factor * d

    def slope_of(self, a: Any, b: Any, rate: Any) -> Any:
        return self.scaled_difference(a, b, rate)

    def fading(self, blocks: int, gain: Any, amplitude: Any) -> Any:
        u = np.float32(blocks) * gain
        return amplitude * f32.gauss(np.array([u], dtype=np.float32))[0]

    def wave(self, x: Any, frequency: Any, phase: Any, amplitude: Any) -> Any:
        turns = x * frequency
        turns = turns + phase
        whole = turns + _ROUND
        whole = whole - _ROUND
        t = np.abs(turns - whole)
        t = _FOUR * t
        t = _ONE - t
        s = t * t
        h = _SINE_F32[0]
        for coefficient in _SINE_F32[1:]:
            h = h * s
            h = h + coefficient
        h = h * t
        return amplitude * h

    def mean(self, base: Any, total: Any, n: int) -> Any:
        quotient = total / np.float32(n)
        return base + quotient


class _Q31:
    zero = 0

    def is_missing(self, x: Any) -> bool:
        return bool(x == -(2**31))

    def settle(self, x: Any) -> Any:
        return x << 16

    def reading(self, z: Any) -> Any:
        return z >> 16

    def follow(self, z: Any, x: Any, gain: Any) -> Any:
        d = (x << 16) - z
        return z + (((d >> 10) * gain) >> 21)

    def power(self, gain: Any, blocks: int) -> Any:
        factor, left = 0x7FFFFFFF - gain, 0x7FFFFFFF
        while blocks:
            if blocks & 1:
                left = (left * factor) >> 31
            factor = (factor * factor) >> 31
            blocks >>= 1
        return 0x7FFFFFFF - left

    def scaled_difference(self, a: Any, b: Any, factor: Any) -> Any:
        return ((a - b) * factor) >> 16

    def slope_of(self, a: Any, b: Any, rate: Any) -> Any:
        return min(max(((a - b) * rate) >> 24, -(2**31) + 1), 2**31 - 1)

    def fading(self, blocks: int, gain: Any, amplitude: Any) -> Any:
        u = (blocks * gain) >> 4
        if u >= q31.CUT:
            return 0
        return (amplitude * int(q31.exp2(np.array([u], dtype=np.uint64))[0])) >> 29

    def wave(self, x: Any, frequency: Any, phase: Any, amplitude: Any) -> Any:
        part = (((x * frequency) >> 16) + phase) & 0xFFFFFFFF
        t = 2**30 - (2**32 - part if part > 2**31 else part)
        s = (t * t) >> 30
        h = _SINE_Q31[0]
        for coefficient in _SINE_Q31[1:]:
            h = ((h * s) >> 30) + coefficient
        h = (h * t) >> 30
        return (amplitude * h) >> 30

    def mean(self, base: Any, total: Any, n: int) -> Any:
        magnitude = (abs(total) + n // 2) // n
        return base + (magnitude if total >= 0 else -magnitude)


class Hook:
    """A term that has nothing to do in some of its hooks."""

    survives = False

    def __init__(self, operations: Operations, parameters: list[Any], channel: int) -> None:
        self.do = operations
        self.p = parameters
        self.channel = channel
        self.state: Any = None

    def begin(self, x: Any, off_blocks: int) -> None:
        """First believed temperature."""

    def take(self, x: Any) -> None:
        """A sample of the term's channel."""

    def step(self, x: Any, samples_per_block: int) -> None:
        """A block of mean temperature x ends."""

    def apply(self, x: Any, elapsed: int, effect: Effect) -> None:
        """Changes the inputs, adds to the bias."""


class _Memory(Hook):
    survives = True

    def begin(self, x: Any, off_blocks: int) -> None:
        if self.state is None:
            self.state = self.do.settle(x)
        else:
            self.state = self.do.follow(self.state, x, self.do.power(self.p[0], off_blocks))

    def step(self, x: Any, samples_per_block: int) -> None:
        self.state = self.do.follow(self.state, x, self.p[0])

    def apply(self, x: Any, elapsed: int, effect: Effect) -> None:
        z = self.do.reading(self.state)
        if self.p[2] != 0:
            effect.temperature, effect.slope = z, self.do.slope_of(x, z, self.p[2])
        effect.added = effect.added + self.do.scaled_difference(z, x, self.p[1])


class _Play(Hook):
    survives = True

    def begin(self, x: Any, off_blocks: int) -> None:
        self.state = x if self.state is None else self.state
        self.step(x, 0)

    def step(self, x: Any, samples_per_block: int) -> None:
        low, high = x - self.p[0], x + self.p[0]
        self.state = low if self.state < low else min(self.state, high)

    def apply(self, x: Any, elapsed: int, effect: Effect) -> None:
        effect.added = effect.added + self.do.scaled_difference(self.state, x, self.p[1])


class _WarmUp(Hook):
    def apply(self, x: Any, elapsed: int, effect: Effect) -> None:
        effect.added = effect.added + self.do.fading(elapsed, self.p[0], self.p[1])


class _Harmonic(Hook):
    def apply(self, x: Any, elapsed: int, effect: Effect) -> None:
        effect.added = effect.added + self.do.wave(x, *self.p[:3])


class _Auxiliary(Hook):
    """`state` is the mean of the last block; `base` is None where the last block had too few samples."""

    base: Any = None
    total: Any = None
    count = 0

    def begin(self, x: Any, off_blocks: int) -> None:
        self.count = 0

    def take(self, x: Any) -> None:
        if self.do.is_missing(x):
            return
        if self.state is None:
            self.state = x
        if self.count == 0:
            self.base, self.total = x, self.do.zero
        self.total = self.total + (x - self.base)
        self.count += 1

    def step(self, x: Any, samples_per_block: int) -> None:
        if 2 * self.count >= samples_per_block:
            self.state = self.do.mean(self.base, self.total, self.count)
        else:
            self.base = None
        self.count = 0

    def apply(self, x: Any, elapsed: int, effect: Effect) -> None:
        if self.base is None:
            effect.remarks |= _HELD
        if self.state is not None:
            effect.added = effect.added + self.do.scaled_difference(self.state, self.p[1], self.p[0])


_KINDS: dict[int, type[Hook]] = {MEMORY: _Memory, PLAY: _Play, HARMONIC: _Harmonic, AUXILIARY: _Auxiliary}


def hooks(table: Table) -> list[Hook]:
    """The terms of a table, without state."""
    operations: Operations = _F32() if table.numeric == "f32" else _Q31()
    made = []
    for record in table.terms.reshape(-1, ARRAYS["terms"]):
        numbers = table.numbers(record[2:])
        parameters = list(numbers) if table.numeric == "f32" else [int(n) for n in numbers]
        made.append(_KINDS.get(int(record[0]), _WarmUp)(operations, parameters, int(record[1])))
    return made
