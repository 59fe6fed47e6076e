"""Records of guards: what the front end believes of each channel (docs/FORMAT.md, section 3)."""

from __future__ import annotations

import math

import numpy as np

from ..model import Guard, Model
from ..target.table import Numeric, Words, f32_words
from ..train.samples import PLAUSIBLE_C
from .terms import channel_names

__all__ = ["TEMPERATURE", "guard_of", "guard_words"]

TEMPERATURE = "temperature_c"
"""Name of the temperature among the guards of a model."""

_US_PER_MIN = 60e6  # microseconds in a minute
_LARGEST = 2**31 - 1  # a signed 32-bit word
_MOST_BLOCKS = 100000  # libc/gtc_limits.inl


def guard_of(model: Model, channel: str | None) -> Guard:
    """The guard of a channel; None: of the temperature. Without one in the model every reading passes."""
    missing_s = model.hold_blocks * model.block_s
    if channel is None:
        if TEMPERATURE in model.guards and TEMPERATURE not in channel_names(model):
            return model.guards[TEMPERATURE]
        low, high = PLAUSIBLE_C
        return Guard(
            low=low,
            high=high,
            max_step=model.max_step_c,
            max_rate_per_min=model.max_rate_c_per_min,
            agree_s=model.agree_s,
            stuck_s=model.stuck_s,
            missing_s=missing_s,
            fallback=0.0,
        )
    if channel in model.guards:
        return model.guards[channel]
    reference = next(t.parameters["reference"] for t in model.terms if t.channel == channel)
    return Guard(
        low=-1e9,
        high=1e9,
        max_step=1e9,
        max_rate_per_min=0.0,
        agree_s=0.0,
        stuck_s=0.0,
        missing_s=missing_s,
        fallback=reference,
    )


def guard_words(model: Model, numeric: Numeric) -> Words:
    """One record for each channel, the temperature first."""
    guards = [guard_of(model, channel) for channel in (None, *channel_names(model))]
    return np.concatenate([_record(guard, numeric, model.block_s) for guard in guards])


def _record(guard: Guard, numeric: Numeric, block_s: float) -> Words:
    values = [guard.low, guard.high, guard.max_step, guard.max_rate_per_min / _US_PER_MIN, guard.fallback]
    if numeric == "f32":
        numbers = f32_words(values)
    else:
        scales = (2.0**16, 2.0**16, 2.0**16, 2.0**40, 2.0**16)
        whole = [_held(value * scale) for value, scale in zip(values, scales, strict=True)]
        numbers = np.array([w & 0xFFFFFFFF for w in whole], dtype=np.uint32)
    blocks = min(max(1, round(guard.missing_s / block_s)), _MOST_BLOCKS)
    times = [_microseconds(guard.agree_s), _microseconds(guard.stuck_s), blocks]
    return np.concatenate([numbers[:4], np.array(times, dtype=np.uint32), numbers[4:]])


def _held(value: float) -> int:
    """The nearest number that the word has: a wider range than 32 bits hold is none."""
    return int(math.copysign(min(round(abs(value)), _LARGEST), value))


def _microseconds(seconds: float) -> int:
    return min(round(seconds * 1e6), _LARGEST)
