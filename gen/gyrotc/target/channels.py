"""Auxiliary channels as the target sees them: what each shows at every correction."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arithmetic import Arithmetic, Numbers
from .front_end import FALLBACK, KEEP, MAP, Settings, Steps, follow
from .recursions import CourseChannel
from .samples import Guarded
from .status import CHANNEL_LOST, CLAMPED, HELD

__all__ = ["channel_at"]

_WINDOW = 2  # blocks: the slope of a channel is of no use


def channel_at(
    arithmetic: Arithmetic, readings: Numbers, guard: Guarded, fallback: Any, settings: Settings, steps: Steps
) -> CourseChannel:
    """Mean of a channel and remarks at every correction.

    Args:
        arithmetic: The numbers that the target computes with.
        readings: One for each sample of the temperature, missing ones as `arithmetic.missing`.
        guard: What is believed of them.
        fallback: What stands for the channel where there is no reading.
        settings: Of the temperature.
        steps: The corrections.
    """
    own = follow(arithmetic, readings, replace(settings, guard=guard, slope_blocks=_WINDOW))
    # Blocks of the channels close, and their readings are taken, before those of the temperature.
    k = np.searchsorted(2 * own.at + own.is_restart, 2 * steps.at + steps.is_restart, side="right") - 1
    clamped = _clamped(readings, guard, own, settings.samples_per_block)
    mean = np.concatenate([own.temperature[:0], [fallback], own.temperature]).astype(own.temperature.dtype)
    remarks = np.zeros(own.at.size + 1, dtype=np.int32)
    remarks[0] = HELD
    remarks[1:] = np.where(clamped, CLAMPED, 0) | np.where(own.kind == KEEP, HELD, 0)
    fallen = 1 + np.flatnonzero(own.kind == FALLBACK)
    mean[fallen], remarks[fallen] = fallback, HELD | CHANNEL_LOST
    is_away = np.zeros(own.at.size + 1, dtype=np.bool_)
    is_away[0] = is_away[fallen] = True
    return CourseChannel(mean[k + 1], remarks[k + 1], is_away[k + 1])


def _clamped(readings: Numbers, guard: Guarded, own: Steps, n: int) -> NDArray[np.bool_]:
    """Whether the mean of each correction has a reading that was taken as the edge of the range."""
    edge = own.believed & (guard.limited(readings) != readings)
    restarts = own.at[own.is_restart]
    used = edge.copy()
    for i in restarts.tolist():  # what came before in the block is dropped
        used[i - i % n : i] = False
    blocks = np.zeros(-(-max(readings.size, 1) // n) + 1, dtype=np.bool_)
    blocks[np.flatnonzero(used) // n] = True
    found = np.where(own.is_restart, edge[np.minimum(own.at, readings.size - 1)], blocks[own.at // n - 1])
    if not found.size:
        return found
    source = np.maximum.accumulate(np.where(own.kind == MAP, np.arange(own.kind.size), 0))
    return np.asarray(found[source])
