"""The numbers of the example `main.c`: what it reads, how often, and how many samples until its start is believed."""

from __future__ import annotations

import math
from typing import Any

from ..common.texts import c_code
from ..model import Model
from ..target.follow import period_us
from .guards import guard_of
from .terms import channel_names

__all__ = ["example_period_us", "example_samples", "example_values"]

_EXAMPLE_US = 10000  # 100 samples a second


def example_values(model: Model) -> dict[str, Any]:
    """What the example reads: the middle of the envelope, and of each further channel what is used when it is lost."""
    middle = round(sum(model.envelope.temperature_c) / 2.0, 1)
    readings = [middle, *(guard_of(model, name).fallback for name in channel_names(model))]
    return {
        "readings": [c_code(f"{middle:.1f}F"), *(c_code(f"{value:#.7g}F") for value in readings[1:])],
        "readings_q16": [round(value * 65536) for value in readings],
        "period_us": example_period_us(model),
        "samples": example_samples(model),
    }


def example_samples(model: Model) -> int:
    """Samples until the first start of the example is believed, of every channel."""
    longest_s = max(guard_of(model, name).agree_s for name in (None, *channel_names(model)))
    return math.ceil(longest_s * 1e6 / example_period_us(model)) + 1


def example_period_us(model: Model) -> int:
    """A sample period that fits the model's block: 10 ms where it does, else a tenth of the block."""
    block_us = max(1, round(model.block_s * 1e6))
    return _EXAMPLE_US if block_us % _EXAMPLE_US == 0 else period_us(block_us, min(10, block_us))
