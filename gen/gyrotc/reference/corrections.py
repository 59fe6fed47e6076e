"""Every correction of a history: the front end's inputs, what the terms make of them, the map.

The static map is evaluated for all corrections at once; what depends on the order (held, fallen back)
was settled by `frontend.follow`, and terms are stepped through the corrections one after the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

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
    positions,
    with_missing,
)
from ..frontend.numbers import Numbers
from ..table import Table, Words
from .maps import evaluate_map
from .terms import Effect, hooks

__all__ = ["Stream", "arithmetic_of", "corrections", "settings_of"]

_HELD, _FALLBACK = 8, 16  # as in gtc.h
_MAX_ELAPSED = 0xFFFFFF


def settings_of(table: Table, samples_per_block: int) -> Settings:
    """Members of a table that the front end uses."""
    number = table.numbers([table.max_step, table.max_slope])
    return Settings(
        samples_per_block=samples_per_block,
        slope_blocks=table.slope_blocks,
        hold_blocks=table.hold_blocks,
        stuck_samples=table.stuck_samples,
        max_step=number[0],
        max_slope=number[1],
    )


def arithmetic_of(table: Table) -> Arithmetic:
    """Operations of a table's arithmetic."""
    return F32 if table.numeric == "f32" else Q31


@dataclass(frozen=True, slots=True)
class Stream:
    """Samples as the front end counts them, missing ones among them.

    `position[k]`: sample number of row k; `channels[k]`: its channels; `missed[k]`: samples missed before
    it, shortened, and `dropped[k]`: whole blocks that were left out of them.
    """

    samples: Numbers
    position: NDArray[np.int64]
    channels: NDArray[Any]
    missed: NDArray[np.int64]
    dropped: NDArray[np.int64]

    @staticmethod
    def of_rows(table: Table, settings: Settings, channels: Words, missed: NDArray[np.int64]) -> Stream:
        shortened = expand_missed(missed, settings)
        position = positions(shortened)
        numbers = table.numbers(channels)
        samples = with_missing(arithmetic_of(table), numbers[:, 0], position)
        dropped = (missed - shortened) // settings.samples_per_block
        return Stream(samples, position, numbers, shortened, dropped)

    def elapsed(self, at: NDArray[np.int64], samples_per_block: int) -> NDArray[np.int64]:
        """Blocks since the start at each sample number, with those that were left out."""
        total = np.concatenate([[0], np.cumsum(self.dropped)])
        runs = self.position - self.missed  # where the missing samples before each row begin
        passed = at // samples_per_block + total[np.searchsorted(runs, at, side="right")]
        return np.asarray(np.minimum(passed, _MAX_ELAPSED))


def corrections(
    table: Table, steps: Steps, stream: Stream, samples_per_block: int
) -> tuple[NDArray[np.int32], Words]:
    """Status and bits of every correction, after one entry for the time before the first."""
    made = np.flatnonzero(steps.kind == MAP)
    effects = _effects(table, steps, stream, samples_per_block)
    inputs = np.stack([_bits(table, effects.temperature), _bits(table, effects.slope)], axis=1)
    status = np.zeros(steps.kind.size, dtype=np.int32)
    bits = np.zeros(steps.kind.size, dtype=np.uint32)
    status[made], plain = evaluate_map(table, inputs[made])
    bits[made] = _total(table, plain, effects.added[made])
    status[made] |= effects.remarks[made]
    source = np.maximum.accumulate(np.where(steps.kind == MAP, np.arange(steps.kind.size), 0))
    status, bits = status[source], bits[source]
    status[steps.kind == KEEP] |= _HELD
    fallen = steps.kind == FALLBACK
    status[fallen] = _HELD | _FALLBACK
    bits[fallen] = table.fallback
    return np.concatenate([[np.int32(_HELD)], status]).astype(np.int32), np.concatenate(
        [[np.uint32(0)], bits]
    ).astype(np.uint32)


@dataclass(frozen=True, slots=True)
class _Effects:
    """`Effect` of every correction."""

    temperature: Numbers
    slope: Numbers
    added: Numbers
    remarks: NDArray[np.int32]


def _effects(table: Table, steps: Steps, stream: Stream, samples_per_block: int) -> _Effects:
    """What the terms make of every correction that the map makes."""
    found = _Effects(
        np.array(steps.temperature),
        np.array(steps.slope),
        np.zeros_like(steps.temperature),
        np.array(steps.remarks),
    )
    terms = hooks(table)
    if not terms or steps.at.size == 0:
        return found
    elapsed = stream.elapsed(steps.at, samples_per_block)
    restarts = steps.is_restart
    row = 0
    for k, at in enumerate(steps.at.tolist()):
        # A block closes before the sample that opens the next one is taken.
        until = at + 1 if restarts[k] else at
        while row < stream.position.size and stream.position[row] < until:
            for term in terms:
                term.take(stream.channels[row, term.channel])
            row += 1
        x = found.temperature[k]
        for term in terms:
            if k == 0:
                term.begin(x, 0)
            elif not restarts[k]:
                term.step(x, samples_per_block)
        if steps.kind[k] == MAP:
            effect = Effect(x, found.slope[k], found.added[k], int(found.remarks[k]))
            for term in terms:
                term.apply(x, int(elapsed[k]), effect)
            found.temperature[k], found.slope[k] = effect.temperature, effect.slope
            found.added[k], found.remarks[k] = effect.added, effect.remarks
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
