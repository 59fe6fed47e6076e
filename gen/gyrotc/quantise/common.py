"""What both arithmetics' tables share: settings, coverage bits, limits."""

from __future__ import annotations

import itertools
import zlib
from typing import Any, TypedDict

import numpy as np

from ..model import Model
from ..reference.table import Words

__all__ = ["STEEPEST", "Shared", "coverage_words", "max_slope_c", "shared"]

#: Largest derivative of exp(-x²): at x = 1/√2.
STEEPEST = 0.8577638849607068


class Shared(TypedDict):
    """Members of a table that are integers in every arithmetic."""

    serial: str
    name: str
    id: int
    block_s: float
    slope_blocks: int
    hold_blocks: int
    stuck_samples: int
    n_channels: int
    coverage_cells: tuple[int, int]
    sigma_cells: tuple[int, int]
    coverage: Words


def shared(model: Model) -> Shared:
    """The members that need no rounding."""
    coverage, sigma = model.coverage, model.uncertainty_dph
    return Shared(
        serial=model.serial,
        name=model.id,
        id=zlib.crc32(model.id.encode("ascii")),
        block_s=model.block_s,
        slope_blocks=model.slope_blocks,
        hold_blocks=model.hold_blocks,
        stuck_samples=model.stuck_samples,
        n_channels=1 + len({t.channel for t in model.terms if t.channel}),
        coverage_cells=coverage.cells if coverage else (0, 0),
        sigma_cells=sigma.cells if sigma else (0, 0),
        coverage=coverage_words(model),
    )


def coverage_words(model: Model) -> Words:
    """One bit a cell, T fastest, 32 cells a word, low bit first."""
    if model.coverage is None:
        return np.zeros(0, dtype=np.uint32)
    bits = [c == "1" for c in itertools.chain.from_iterable(model.coverage.rows)]
    padded = np.zeros(-(-len(bits) // 32) * 32, dtype=np.uint32)
    padded[: len(bits)] = bits
    words: Any = padded.reshape(-1, 32) << np.arange(32, dtype=np.uint32)
    return np.asarray(np.bitwise_or.reduce(words, axis=1), dtype=np.uint32)


def max_slope_c(model: Model) -> float:
    """Largest believable change of temperature in a block, C."""
    return model.max_rate_c_per_min * model.block_s / 60.0
