"""What both arithmetics' tables share: settings, coverage bits, limits."""

from __future__ import annotations

import itertools
import re
import zlib
from typing import Any, TypedDict

import numpy as np

from ..model import Model
from ..target.table import SERIAL_WORDS, Words
from .sigma import sigma_cells

__all__ = ["STEEPEST", "Shared", "coverage_words", "shared"]

#: Largest derivative of exp(-x²): at x = 1/√2.
STEEPEST = 0.8577638849607068


class Shared(TypedDict):
    """Members of a table that are integers in every arithmetic."""

    name: str
    id: int
    calibrated: int
    block_us: int
    slope_blocks: int
    lead_blocks: int
    coverage_cells: tuple[int, int]
    sigma_cells: tuple[int, int]
    serial: Words
    coverage: Words


def shared(model: Model) -> Shared:
    """The members that need no rounding."""
    coverage = model.coverage
    return Shared(
        name=model.id,
        id=zlib.crc32(model.id.encode("ascii")),
        calibrated=_date(model),
        block_us=max(1, round(model.block_s * 1e6)),
        slope_blocks=model.slope_blocks,
        lead_blocks=model.lead_blocks,
        coverage_cells=coverage.cells if coverage else (0, 0),
        sigma_cells=sigma_cells(model),
        serial=_serial_words(model.serial),
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


def _serial_words(serial: str) -> Words:
    """Four characters a word, the first one lowest; zeros behind the end."""
    octets = serial.encode("ascii").ljust(4 * SERIAL_WORDS, b"\0")
    return np.frombuffer(octets, dtype="<u4").astype(np.uint32)


def _date(model: Model) -> int:
    """Date of calibration as a decimal number yyyymmdd; 0 where `[meta]` has none in ISO 8601."""
    found = re.match(r"(\d{4})-(\d{2})-(\d{2})", str(model.meta.get("calibrated_on", "")))
    return int("".join(found.groups())) if found else 0
