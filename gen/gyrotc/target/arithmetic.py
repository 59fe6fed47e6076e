"""The operations of which the recursions of terms are made, and those of float64.

`reference` has those of the target: float32 and fixed point.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["FLOAT64", "Bells", "Floating", "Operations"]

Numbers = NDArray[Any]
Bells = tuple[tuple[Any, Any], tuple[Any, Any]]


class Operations(Protocol):
    """Operations of one arithmetic, each rounded as on the target."""

    def scalars(self, x: Numbers) -> Sequence[Any]:
        """Numbers one by one, of the type that `follow` takes."""

    def array(self, x: Sequence[Any]) -> Numbers: ...

    def settle(self, x: Any) -> Any:
        """A memory at rest at x."""

    def follow(self, z: Any, x: Any, gain: Any) -> Any:
        """A memory after a block of mean x."""

    def reading(self, z: Numbers) -> Numbers:
        """The numbers that a memory shows."""

    def scaled_difference(self, a: Numbers, b: Any, factor: Any) -> Numbers: ...

    def slope_of(self, a: Numbers, b: Numbers, rate: Any) -> Numbers:
        """(a - b) rate, per block."""

    def fading(self, blocks: NDArray[np.int64], gain: Any, amplitude: Any) -> Numbers:
        """amplitude 2^-(blocks gain)."""

    def wave(self, x: Numbers, frequency: Any, phase: Any, amplitude: Any) -> Numbers:
        """amplitude cos(2 pi (x frequency + phase))."""

    def limited(self, x: Numbers) -> Numbers:
        """The nearest number that may be multiplied."""

    def bells(self, x: Numbers, gain: Any, bells: Bells) -> Numbers:
        """Sum of weight 2^-((x - center) gain)^2 over two (center, weight)."""


class Floating:
    """Operations of float64; float32 has its own exponential and cosine."""

    def scalars(self, x: Numbers) -> Sequence[Any]:
        return list(x.tolist())

    def array(self, x: Sequence[Any]) -> Numbers:
        return np.array(x, dtype=np.float64)

    def settle(self, x: Any) -> Any:
        return x

    def follow(self, z: Any, x: Any, gain: Any) -> Any:
        return z + gain * (x - z)

    def reading(self, z: Numbers) -> Numbers:
        return z

    def scaled_difference(self, a: Numbers, b: Any, factor: Any) -> Numbers:
        return np.asarray(factor * (a - b))

    def slope_of(self, a: Numbers, b: Numbers, rate: Any) -> Numbers:
        return self.scaled_difference(a, b, rate)

    def fading(self, blocks: NDArray[np.int64], gain: Any, amplitude: Any) -> Numbers:
        return np.asarray(amplitude * np.exp2(-gain * blocks))

    def wave(self, x: Numbers, frequency: Any, phase: Any, amplitude: Any) -> Numbers:
        return np.asarray(amplitude * np.cos(2.0 * np.pi * (x * frequency + phase)))

    def limited(self, x: Numbers) -> Numbers:
        return x

    def bells(self, x: Numbers, gain: Any, bells: Bells) -> Numbers:
        first, second = (weight * np.exp2(-(((x - center) * gain) ** 2)) for center, weight in bells)
        return np.asarray(first + second)


FLOAT64: Operations = Floating()
