"""Whole histories: the front end's corrections evaluated, and the status of every call.

The static map is evaluated for all corrections at once; what depends on the order (held, fallen
back) was settled by `frontend.follow`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..frontend import (
    F32,
    FALLBACK,
    KEEP,
    MAP,
    Q31,
    Arithmetic,
    Settings,
    Steps,
    expand_missed,
    follow,
    positions,
    with_missing,
)
from ..table import Table, Words
from .maps import evaluate_map

__all__ = ["Replay", "answers", "replay"]

_HELD, _FALLBACK = 8, 16  # as in gtc.h


class Event(Protocol):
    """One call of a step function: bits of every channel, or `missed` samples."""

    @property
    def channels(self) -> tuple[int, ...]: ...

    @property
    def missed(self) -> int: ...


class Vectors(Protocol):
    """Inputs of the known-answer test, as `gyrotc.vectors` makes them."""

    @property
    def samples_per_block(self) -> int: ...

    def map_inputs(self, numeric: str) -> Words: ...

    def events(self, numeric: str) -> Iterable[Event]: ...


@dataclass(frozen=True, slots=True)
class Replay:
    """Every step of a history, one entry per row (call of `sample`)."""

    sample_status: NDArray[np.int32]  # what `sample` returns
    status: NDArray[np.int32]  # what `bias` returns after it
    bits: Words  # of the bias that it writes

    missed_status: NDArray[np.int32]  # what `missed` returns before the row (0 where nothing was missed)
    block_valid: NDArray[np.bool_]  # the row's own block has enough believed samples


def replay(table: Table, channels: Words, *, missed: NDArray[np.int64], samples_per_block: int) -> Replay:
    """Feeds a history to a fresh state.

    Args:
        table: The table.
        channels: Bits of every row's channels, shape (n, n_channels).
        missed: Samples that did not arrive before each row, shape (n,).
        samples_per_block: As given to `gtc_<n>_init`.
    """
    settings = _settings(table, samples_per_block)
    shortened = expand_missed(np.asarray(missed, dtype=np.int64), settings)
    position = positions(shortened)
    arithmetic = _arithmetic(table)
    samples = with_missing(arithmetic, table.numbers(np.asarray(channels)[:, 0]), position)
    steps = follow(arithmetic, samples, settings)
    status, bits = _corrections(table, steps)

    in_force = steps.in_force(position) + 1
    gaps = np.flatnonzero(shortened)
    missed_status = np.zeros(shortened.size, dtype=np.int32)
    missed_status[gaps] = status[steps.in_force(position[gaps] - 1) + 1] | _HELD
    held = np.where(steps.believed[position], np.int32(0), np.int32(_HELD))
    at_rows = status[in_force]
    return Replay(
        sample_status=at_rows | held,
        status=at_rows,
        bits=bits[in_force],
        missed_status=missed_status,
        block_valid=steps.valid[position // samples_per_block],
    )


def answers(table: Table, vectors: Vectors) -> NDArray[np.uint32]:
    """What `board_test.c` prints for a table: (status, bits) of every result, shape (n, 2).

    In order: the self-test; every map vector; `init`; every step of the history, whose status is that of
    the call plus 256 times that of `gtc_<n>_bias` after it.
    """
    status, bits = evaluate_map(table, vectors.map_inputs(table.numeric))
    maps = np.stack([status.astype(np.uint32), bits], axis=1)
    zero = np.zeros((1, 2), dtype=np.uint32)
    history = _step_answers(table, vectors.events(table.numeric), vectors.samples_per_block)
    return np.concatenate([zero, maps, zero, history])


def _step_answers(table: Table, events: Iterable[Event], samples_per_block: int) -> NDArray[np.uint32]:
    """Answers of the step functions; each event is one row, or samples missed before the next row."""
    settings = _settings(table, samples_per_block)
    arithmetic = _arithmetic(table)
    parts: list[NDArray[Any]] = []
    ends: list[int] = []
    missing: list[bool] = []
    total = 0
    for event in events:
        if event.missed:
            count = int(expand_missed(np.array([event.missed]), settings)[0])
            parts.append(arithmetic.missing(count))
        else:
            count = 1
            parts.append(table.numbers([event.channels[0]]))
        total += count
        ends.append(total - 1)
        missing.append(bool(event.missed))
    last = np.array(ends, dtype=np.int64)
    steps = follow(arithmetic, np.concatenate(parts), settings)
    status, bits = _corrections(table, steps)
    k = steps.in_force(last) + 1
    held = np.where(np.array(missing) | ~steps.believed[last], _HELD, 0)
    call = status[k] | held
    return np.stack([(call + 256 * status[k]).astype(np.uint32), bits[k]], axis=1)


def _settings(table: Table, samples_per_block: int) -> Settings:
    number = table.numbers([table.max_step, table.max_slope])
    return Settings(
        samples_per_block=samples_per_block,
        slope_blocks=table.slope_blocks,
        hold_blocks=table.hold_blocks,
        stuck_samples=table.stuck_samples,
        max_step=number[0],
        max_slope=number[1],
    )


def _arithmetic(table: Table) -> Arithmetic:
    return F32 if table.numeric == "f32" else Q31


def _corrections(table: Table, steps: Steps) -> tuple[NDArray[np.int32], Words]:
    """Status and bits of every correction, after one entry for the time before the first."""
    inputs = np.stack([_bits(table, steps.temperature), _bits(table, steps.slope)], axis=1)
    made = np.flatnonzero(steps.kind == MAP)
    status = np.zeros(steps.kind.size, dtype=np.int32)
    bits = np.zeros(steps.kind.size, dtype=np.uint32)
    status[made], bits[made] = evaluate_map(table, inputs[made])
    status[made] |= steps.remarks[made]
    source = np.maximum.accumulate(np.where(steps.kind == MAP, np.arange(steps.kind.size), 0))
    status, bits = status[source], bits[source]
    status[steps.kind == KEEP] |= _HELD
    fallen = steps.kind == FALLBACK
    status[fallen] = _HELD | _FALLBACK
    bits[fallen] = table.fallback
    return np.concatenate([[np.int32(_HELD)], status]).astype(np.int32), np.concatenate(
        [[np.uint32(0)], bits]
    ).astype(np.uint32)


def _bits(table: Table, numbers: NDArray[Any]) -> Words:
    if table.numeric == "f32":
        return np.asarray(numbers, dtype=np.float32).view(np.uint32)
    return np.asarray(numbers, dtype=np.int64).astype(np.int32).view(np.uint32)
