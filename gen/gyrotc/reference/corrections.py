"""Every correction of a history: the front end's inputs, what the terms make of them, the map.

The static map is evaluated for all corrections at once; what depends on the order (held, fallen back)
was settled by `frontend.follow` and by the recursions of the terms.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import status as status_bits
from ..frontend import F32, FALLBACK, KEEP, MAP, Q31, Arithmetic, Settings, Steps, Stream, period_us
from ..frontend.numbers import Numbers
from ..terms.recursion import TermOutcome
from .maps import evaluate_map
from .operations import recursions
from .table import ARRAYS, Table, Words

__all__ = ["arithmetic_of", "corrections", "settings_of"]


def settings_of(table: Table, samples_per_block: int) -> Settings:
    """Members of a table that the front end uses."""
    guard = table.guards[: ARRAYS["guards"]]
    number = table.numbers(guard)
    return Settings(
        samples_per_block=samples_per_block,
        slope_blocks=table.slope_blocks,
        hold_blocks=int(guard[6]),
        period_us=period_us(table.block_us, samples_per_block),
        stuck_us=int(guard[5]),
        max_step=number[2],
        max_rate=number[3],
    )


def arithmetic_of(table: Table) -> Arithmetic:
    """Operations of a table's arithmetic."""
    return F32 if table.numeric == "f32" else Q31


def corrections(
    table: Table, steps: Steps, stream: Stream, channels: Words, samples_per_block: int
) -> tuple[NDArray[np.int32], Words]:
    """Status and bits of every correction, after one entry for the time before the first.

    Args:
        table: The table.
        steps: The corrections of the history.
        stream: Its samples.
        channels: Bits of every row's channels, shape (n, n_channels).
        samples_per_block: What the target gives to `gtc_<n>_init`.
    """
    steps = steps.led(table.lead_blocks)
    made = np.flatnonzero(steps.kind == MAP)
    outcome = _outcome(table, steps, stream, table.numbers(channels), samples_per_block)
    inputs = np.stack([_bits(table, outcome.temperature), _bits(table, outcome.slope)], axis=1)
    status = np.zeros(steps.kind.size, dtype=np.int32)
    bits = np.zeros(steps.kind.size, dtype=np.uint32)
    status[made], plain = evaluate_map(table, inputs[made])
    bits[made] = _total(table, plain, outcome.added[made])
    status[made] |= outcome.remarks[made]
    source = np.maximum.accumulate(np.where(steps.kind == MAP, np.arange(steps.kind.size), 0))
    status, bits = status[source], bits[source]
    status[steps.kind == KEEP] |= status_bits.HELD
    fallen = steps.kind == FALLBACK
    status[fallen] = status_bits.HELD | status_bits.FALLBACK
    bits[fallen] = table.fallback
    return np.concatenate([[np.int32(status_bits.HELD)], status]).astype(np.int32), np.concatenate(
        [[np.uint32(0)], bits]
    ).astype(np.uint32)


def _outcome(
    table: Table, steps: Steps, stream: Stream, channels: NDArray[Any], samples_per_block: int
) -> TermOutcome:
    """What the terms make of every correction; of use where the map makes it."""
    found = TermOutcome(steps.temperature, steps.slope, np.zeros_like(steps.temperature), steps.remarks)
    terms = recursions(table)
    if not terms or steps.at.size == 0:
        return found
    course = stream.course(steps, samples_per_block)
    for recursion, channel in terms:
        recursion.apply(course, channels[:, channel], found)
    return found


def _total(table: Table, bits: Words, added: Numbers) -> Words:
    """Bits of the map's results with what the terms add."""
    if table.numeric == "f32":
        return np.asarray(bits.view(np.float32) + added.astype(np.float32)).view(np.uint32)
    total = np.clip(table.numbers(bits) + added, -(2**31) + 1, 2**31 - 1)
    return np.asarray(total.astype(np.int32).view(np.uint32))


def _bits(table: Table, numbers: NDArray[Any]) -> Words:
    if table.numeric == "f32":
        return np.asarray(numbers, dtype=np.float32).view(np.uint32)
    return np.asarray(numbers, dtype=np.int64).astype(np.int32).view(np.uint32)
