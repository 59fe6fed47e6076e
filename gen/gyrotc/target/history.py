"""Whole histories: what every call of the step functions answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .corrections import arithmetic_of, corrections, evidence, settings_of
from .follow import Settings, Steps, follow
from .maps import evaluate_map
from .sigma import sigma_bits
from .status import HELD
from .stream import Stream
from .table import Table, Words

__all__ = ["Replay", "answers", "replay"]


_SPREAD = np.uint32(0x9E3779B1)  # odd: 2^32 over the golden ratio (Knuth, TAOCP 3, section 6.4)


class CallSequence(Protocol):
    """Calls of the step functions, one entry each: bits of every channel, or `missed` samples (0: none)."""

    @property
    def channels(self) -> Words: ...

    @property
    def missed(self) -> NDArray[np.int64]: ...


class KnownInputs(Protocol):
    """Inputs of the known-answer test, as `gyrotc.tables.vectors` makes them."""

    @property
    def samples_per_block(self) -> int: ...

    def map_inputs(self, numeric: str) -> Words: ...

    def calls(self, numeric: str) -> CallSequence: ...


@dataclass(frozen=True, slots=True)
class Replay:
    """Every step of a history, one entry per row (call of `sample`)."""

    sample_status: NDArray[np.int32]  # what `sample` returns
    status: NDArray[np.int32]  # what `bias` returns after it
    bits: Words  # of the bias that it writes
    missed_status: NDArray[np.int32]  # what `missed` returns before the row (0 where nothing was missed)
    block_valid: NDArray[np.bool_]  # the row's own block has enough believed samples
    begun: NDArray[np.bool_]  # a correction has been made; before it bias is 0, and says so by HELD
    sigma: Words | None  # bits of 1 σ that `snapshot` writes; None: the table has no uncertainties
    age: NDArray[np.int64]  # blocks that it writes


def replay(table: Table, channels: Words, *, missed: NDArray[np.int64], samples_per_block: int) -> Replay:
    """Feeds a history to a fresh state.

    Args:
        table: The table.
        channels: Bits of every row's channels, shape (n, n_channels).
        missed: Samples that did not arrive before each row, shape (n,).
        samples_per_block: What the target gives to `gtc_<n>_init`.
    """
    settings = settings_of(table, samples_per_block)
    channels, missed = np.asarray(channels), np.asarray(missed, dtype=np.int64)
    stream, steps = _followed(table, settings, channels, missed)
    status, bits = corrections(table, steps, stream, channels, samples_per_block)
    sigma, age = _uncertain(table, steps, stream, channels, samples_per_block, status)
    position = stream.position
    valid = steps.valid[position // samples_per_block]
    in_force = steps.in_force(position)
    begun = in_force >= 0
    in_force += 1
    gaps = np.flatnonzero(stream.missed)
    missed_status = np.zeros(position.size, dtype=np.int32)
    missed_status[gaps] = status[steps.in_force(position[gaps] - 1) + 1] | HELD
    held = np.where(steps.believed[position], np.int32(0), np.int32(HELD))
    at_rows = status[in_force]
    return Replay(
        sample_status=at_rows | held,
        status=at_rows,
        bits=bits[in_force],
        missed_status=missed_status,
        block_valid=valid,
        begun=begun,
        sigma=None if sigma is None else sigma[in_force],
        age=age[in_force],
    )


def _uncertain(
    table: Table,
    steps: Steps,
    stream: Stream,
    channels: Words,
    samples_per_block: int,
    status: NDArray[np.int32],
) -> tuple[Words | None, NDArray[np.int64]]:
    """Bits of 1 σ and age of every correction, after one entry for the time before the first."""
    found = evidence(table, steps, stream, channels, samples_per_block, status[1:])
    age = np.concatenate([[0], found.age])
    return sigma_bits(table, found) if table.sigma.size else None, age


def _followed(
    table: Table, settings: Settings, channels: Words, missed: NDArray[np.int64]
) -> tuple[Stream, Steps]:
    """The front end over a history."""
    arithmetic = arithmetic_of(table)
    stream = Stream.of_rows(arithmetic, settings, table.numbers(channels)[:, 0], missed)
    return stream, follow(arithmetic, stream.samples, settings)


def answers(table: Table, vectors: KnownInputs) -> NDArray[np.uint32]:
    """What `board_test.c` prints for a table: (status, bits) of every result, shape (n, 2).

    In order: the self-test; every map vector; `init`; every step of the history, whose status is that of
    the call plus 256 times that of `gtc_<n>_bias` after it; with uncertainties the bits of sigma, spread over a word,
    are added to those of the bias.
    """
    status, bits = evaluate_map(table, vectors.map_inputs(table.numeric))
    maps = np.stack([status.astype(np.uint32), bits], axis=1)
    zero = np.zeros((1, 2), dtype=np.uint32)
    history = _step_answers(table, vectors.calls(table.numeric), vectors.samples_per_block)
    return np.concatenate([zero, maps, zero, history])


def _step_answers(table: Table, calls: CallSequence, samples_per_block: int) -> NDArray[np.uint32]:
    """Answers of the step functions; each call is a row, or samples missed before the next row."""
    settings = settings_of(table, samples_per_block)
    was_missed = calls.missed > 0
    channels = calls.channels[~was_missed]
    missed = np.diff(np.cumsum(calls.missed)[~was_missed], prepend=0)
    waiting = int(calls.missed.sum() - missed.sum())
    if waiting:  # the history ends with missing samples: one more holds their place
        absent = np.full((1, table.n_channels), table.encode_inputs(np.nan), dtype=np.uint32)
        channels, missed = np.concatenate([channels, absent]), np.append(missed, waiting)
    stream, steps = _followed(table, settings, channels, missed)
    status, bits = corrections(table, steps, stream, channels, samples_per_block)
    sigma, _ = _uncertain(table, steps, stream, channels, samples_per_block, status)
    if sigma is not None:
        bits = bits + sigma * _SPREAD
    row = np.cumsum(~was_missed) - 1
    last = np.where(
        was_missed, stream.position[np.minimum(row + 1, len(channels) - 1)] - 1, stream.position[row]
    )
    k = steps.in_force(last) + 1
    held = np.where(was_missed | ~steps.believed[last], HELD, 0)
    call = status[k] | held
    return np.stack([(call + 256 * status[k]).astype(np.uint32), bits[k]], axis=1)
