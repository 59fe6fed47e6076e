"""Every correction of a history: the front end's inputs, what the terms make of them, the map.

The static map is evaluated for all corrections at once; what depends on the order (held, fallen back)
was settled by `frontend.follow` and by the recursions of the terms.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import status as status_bits
from .believe import Guarded
from .channels import channel_at
from .follow import FALLBACK, KEEP, MAP, Settings, Steps, period_us, with_missing
from .maps import evaluate_map, governed, stand_in
from .numbers import F32, Q31, Arithmetic, Numbers
from .operations import recursions
from .recursion import CourseChannel, TermOutcome
from .sigma import SigmaEvidence, evidence_of
from .stream import Stream
from .table import ARRAYS, Table, Words

__all__ = ["arithmetic_of", "corrections", "evidence", "settings_of"]


def settings_of(table: Table, samples_per_block: int) -> Settings:
    """Members of a table that the front end uses."""
    missing = table.guards.reshape(-1, ARRAYS["guards"])[:, 6]
    return Settings(
        samples_per_block=samples_per_block,
        period_us=period_us(table.block_us, samples_per_block),
        block_us=table.block_us,
        slope_blocks=table.slope_blocks,
        guard=_guarded(table, 0),
        longest_blocks=int(missing.max()),
    )


def _guarded(table: Table, channel: int) -> Guarded:
    """The guard of a channel."""
    record = table.guards.reshape(-1, ARRAYS["guards"])[channel]
    low, high, max_step, max_rate = table.numbers(record)[:4]
    agree_us, stuck_us, missing_blocks = (int(word) for word in record[4:7])
    return Guarded(low, high, max_step, max_rate, agree_us, stuck_us, missing_blocks, takes_edge=channel > 0)


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
    total, governed = _total(table, plain, outcome.added[made], outcome.remarks[made])
    bits[made] = total
    status[made] |= governed
    source = np.maximum.accumulate(np.where(steps.kind == MAP, np.arange(steps.kind.size), 0))
    status, bits = status[source], bits[source]
    status[steps.kind == KEEP] |= status_bits.HELD
    fallen = steps.kind == FALLBACK
    status[fallen] = status_bits.HELD | status_bits.FALLBACK
    bits[fallen] = table.fallback
    return np.concatenate([[np.int32(status_bits.HELD)], status]).astype(np.int32), np.concatenate(
        [[np.uint32(0)], bits]
    ).astype(np.uint32)


def evidence(
    table: Table,
    steps: Steps,
    stream: Stream,
    channels: Words,
    samples_per_block: int,
    status: NDArray[np.int32],
) -> SigmaEvidence:
    """What the uncertainty of every correction goes by; arguments as of `corrections`, and the status of each."""
    led = steps.led(table.lead_blocks)
    outcome = _outcome(table, led, stream, table.numbers(channels), samples_per_block)
    seen = np.clip(led.temperature, *table.numbers(table.envelope)[:2])
    course = replace(stream.course(led, samples_per_block), temperature=seen)
    return evidence_of(table, steps, course, outcome, status)


def _outcome(
    table: Table, steps: Steps, stream: Stream, channels: NDArray[Any], samples_per_block: int
) -> TermOutcome:
    """What the terms make of every correction; of use where the map makes it."""
    low, high = table.numbers(table.envelope)[:2]
    seen = np.clip(steps.temperature, low, high)
    beyond = np.where(seen != steps.temperature, status_bits.CLAMPED, 0).astype(np.int32)
    found = TermOutcome(
        steps.temperature, steps.slope, np.zeros_like(steps.temperature), steps.remarks | beyond
    )
    terms = recursions(table)
    if not terms or steps.at.size == 0:
        return found
    course = replace(stream.course(steps, samples_per_block), temperature=seen)
    settings = settings_of(table, samples_per_block)
    for recursion, channel, number in zip(terms, table.channels, table.stand_ins, strict=True):
        shown = _shown(table, settings, steps, stream, channels, channel) if channel else None
        before = found.added
        recursion.apply(course, shown, found)
        if shown is not None and number:
            away = np.flatnonzero(shown.is_away & (steps.kind == MAP))
            found.added[away] = before[away] + stand_in(
                table, number, found.temperature[away], found.slope[away]
            )
    return found


def _shown(
    table: Table, settings: Settings, steps: Steps, stream: Stream, channels: NDArray[Any], channel: int
) -> CourseChannel:
    """An auxiliary channel at every correction."""
    arithmetic = arithmetic_of(table)
    readings = with_missing(arithmetic, channels[:, channel], stream.position)
    fallback = table.numbers(table.guards.reshape(-1, ARRAYS["guards"])[channel])[7]
    return channel_at(arithmetic, readings, _guarded(table, channel), fallback, settings, steps)


def _total(
    table: Table, bits: Words, added: Numbers, remarks: NDArray[np.int32]
) -> tuple[Words, NDArray[np.int32]]:
    """Bits of the map's results with what the terms add, each within its bounds, and the remarks of the terms."""
    if not table.terms.size:
        return bits, remarks
    within, clamped = governed(table.numbers(table.effect), added)
    if table.numeric == "f32":
        total = bits.view(np.float32) + within.astype(np.float32)
    else:
        total = table.numbers(bits) + within
    total, beyond = governed(table.numbers(table.authority), total)
    remarks = remarks | np.where(clamped | beyond, status_bits.CLAMPED, 0).astype(np.int32)
    return _bits(table, total), remarks


def _bits(table: Table, numbers: NDArray[Any]) -> Words:
    if table.numeric == "f32":
        return np.asarray(numbers, dtype=np.float32).view(np.uint32)
    return np.asarray(numbers, dtype=np.int64).astype(np.int32).view(np.uint32)
