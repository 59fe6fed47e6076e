"""The smallest and largest correction that a table may give, and that its terms may add."""

from __future__ import annotations

from typing import TypedDict

from ..reference.table import Numeric, f32_words

__all__ = ["Bounds", "unbounded"]

_LARGEST_DPH = 1.5e7  # twice the largest rate that anything here takes for one
_LARGEST = 2**31 - 1  # a signed 32-bit word


class Bounds(TypedDict):
    """Members of a table: smallest and largest correction, and of what the terms add."""

    authority: tuple[int, ...]
    effect: tuple[int, ...]


def unbounded(numeric: Numeric) -> Bounds:
    """The widest that a table holds."""
    if numeric == "q31":
        return Bounds(authority=(-_LARGEST & 0xFFFFFFFF, _LARGEST), effect=(-_LARGEST & 0xFFFFFFFF, _LARGEST))
    words = tuple(f32_words([-_LARGEST_DPH, _LARGEST_DPH]).tolist())
    return Bounds(authority=words, effect=words)
