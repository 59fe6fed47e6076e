"""Whole histories: every correction of the front end, the terms and the map, as the step functions answer.

The static map is evaluated for all corrections at once; what depends on the order (held, fallen back)
was settled by `mirror.front_end` and by the recursions of the terms, whose operations in float32 and in
fixed point (mirrors of libc/gtc_num_<n>.h) stand here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from . import f32, q31
from . import table as status_bits
from .front_end import (
    FROM_FALLBACK,
    FROM_KEPT,
    FROM_MAP,
    SampleStream,
    Settings,
    Steps,
    follow,
    period_us,
    with_missing,
)
from .kinds import TableKind, recursion_of
from .readings import Guarded
from .recursions import (
    F32,
    Q31,
    Arithmetic,
    Bells,
    CourseChannel,
    NumberArray,
    Operations,
    Recursion,
    TermOutcome,
)
from .sigma import evidence_of, sigma_bits
from .table import CHANNEL_LOST, CLAMPED, E_ARG, HELD, MISSING_Q31, UNCOVERED, Table, Words

_SINE_F32 = tuple(
    np.float32(float.fromhex(c))
    for c in ("0x1.3c4b2cp-13", "-0x1.3232fap-8", "0x1.46676ep-4", "-0x1.4abbb6p-1", "0x1.921fb4p+0")
)
_SINE_Q31 = (161942, -5016767, 85564854, -693597876, 1686629674)  # 2^-30
_ROUND = np.float32(1.5 * 2**23)  # added and subtracted again: rounds to an integer
_ONE, _FOUR = np.float32(1.0), np.float32(4.0)  # a turn has four quarters
_LARGEST = 2**31 - 1  # a signed 32-bit word
_PART = 2**30  # of a factor of products that keep to 63 bits
_FAR = 6 * 2**28  # an argument whose square is 36 octaves: a Gaussian ends at 32


class _F32(Operations):
    """float32: the same operations, one by one, on numpy's float32; exponential and cosine are its own."""

    def scalars(self, x: NumberArray) -> Sequence[Any]:
        return list(x)

    def array(self, x: Sequence[Any]) -> NumberArray:
        return np.array(x, dtype=np.float32)

    def fading(self, blocks: NDArray[np.int64], gain: Any, amplitude: Any) -> NumberArray:
        u = blocks.astype(np.float32) * gain
        return np.asarray(amplitude * f32.gauss(u))

    def wave(self, x: NumberArray, frequency: Any, phase: Any, amplitude: Any) -> NumberArray:
        turns = x * frequency
        turns = turns + phase
        whole = turns + _ROUND
        whole = whole - _ROUND
        t = np.abs(turns - whole)
        t = _FOUR * t
        t = _ONE - t
        s = t * t
        h = np.full_like(s, _SINE_F32[0])
        for coefficient in _SINE_F32[1:]:
            h = h * s
            h = h + coefficient
        h = h * t
        return np.asarray(amplitude * h)

    def bells(self, x: NumberArray, gain: Any, bells: Bells) -> NumberArray:
        first, second = (self._bell(x, gain, center, weight) for center, weight in bells)
        return np.asarray(first + second)

    def _bell(self, x: NumberArray, gain: Any, center: Any, weight: Any) -> NumberArray:
        u = x - center
        u = u * gain
        u = u * u
        return np.asarray(weight * f32.gauss(u))


class _Q31(Operations):
    """Fixed point: Python integers one by one, int64 in arrays; no product leaves 63 bits."""

    def array(self, x: Sequence[Any]) -> NumberArray:
        return np.array(x, dtype=np.int64)

    def settle(self, x: Any) -> Any:
        return x << 16

    def reading(self, z: NumberArray) -> NumberArray:
        return np.asarray(z >> 16)

    def follow(self, z: Any, x: Any, gain: Any) -> Any:
        d = (x << 16) - z
        return z + (((d >> 10) * gain) >> 21)

    def scaled_difference(self, a: NumberArray, b: Any, factor: Any) -> NumberArray:
        return np.asarray(((a - b) * factor) >> 16)

    def slope_of(self, a: NumberArray, b: NumberArray, rate: Any) -> NumberArray:
        return np.asarray(np.clip(((a - b) * rate) >> 24, -_LARGEST, _LARGEST))

    def fading(self, blocks: NDArray[np.int64], gain: Any, amplitude: Any) -> NumberArray:
        u = (blocks * gain) >> 4
        power = q31.exp2(np.minimum(u, q31.CUT - 1).astype(np.uint64)).astype(np.int64)
        return np.where(u >= q31.CUT, 0, (amplitude * power) >> 29)

    def wave(self, x: NumberArray, frequency: Any, phase: Any, amplitude: Any) -> NumberArray:
        part = (((x * frequency) >> 16) + phase) & 0xFFFFFFFF
        t = 2**30 - np.where(part > 2**31, 2**32 - part, part)
        s = (t * t) >> 30
        h = np.full_like(s, _SINE_Q31[0])
        for coefficient in _SINE_Q31[1:]:
            h = ((h * s) >> 30) + coefficient
        h = (h * t) >> 30
        return np.asarray((amplitude * h) >> 30)

    def limited(self, x: NumberArray) -> NumberArray:
        return np.clip(x, -_PART, _PART)

    def bells(self, x: NumberArray, gain: Any, bells: Bells) -> NumberArray:
        first, second = (weight * self._bell(x, gain, center) for center, weight in bells)
        return np.asarray((first + second) >> 29)

    def _bell(self, x: NumberArray, gain: Any, center: Any) -> NumberArray:
        """2^-((x - center) gain)^2 in 2^-29."""
        argument = ((x - center) * gain) >> 12
        far = np.abs(argument) > _FAR
        u = (np.where(far, 0, argument) ** 2) >> 32
        power = q31.exp2(np.minimum(u, q31.CUT - 1).astype(np.uint64)).astype(np.int64)
        return np.where(far | (u >= q31.CUT), 0, power)


_OPERATIONS: dict[str, Operations] = {"f32": _F32(), "q31": _Q31()}


def recursions_of_table(table: Table) -> list[Recursion]:
    """The terms of a table."""
    made = []
    for record in table.records("terms"):
        numbers = table.numbers(record[2:])
        parameters = list(numbers) if table.numeric == "f32" else [int(n) for n in numbers]
        made.append(recursion_of(TableKind(int(record[0])), _OPERATIONS[table.numeric], parameters))
    return made


__all__ = ["FollowedHistory", "Replay", "answers", "evaluate_map", "follow_history", "replay"]

_WINDOW = 2  # blocks: the slope of a channel is of no use


def channel_at(
    arithmetic: Arithmetic, readings: NumberArray, guard: Guarded, fallback: Any, settings: Settings, steps: Steps
) -> CourseChannel:
    """Mean of a channel and remarks at every correction.

    Args:
        arithmetic: The numbers that the target computes with.
        readings: One for each sample of the temperature, missing ones as `arithmetic.missing`.
        guard: What is accepted of them.
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
    remarks[1:] = np.where(clamped, CLAMPED, 0) | np.where(own.kind == FROM_KEPT, HELD, 0)
    fallen = 1 + np.flatnonzero(own.kind == FROM_FALLBACK)
    mean[fallen], remarks[fallen] = fallback, HELD | CHANNEL_LOST
    is_away = np.zeros(own.at.size + 1, dtype=np.bool_)
    is_away[0] = is_away[fallen] = True
    return CourseChannel(mean[k + 1], remarks[k + 1], is_away[k + 1])


def _clamped(readings: NumberArray, guard: Guarded, own: Steps, n: int) -> NDArray[np.bool_]:
    """Return a mask of the corrections whose mean has a reading that was taken as the edge of its range."""
    edge = own.accepted & (guard.limited(readings) != readings)
    restarts = own.at[own.is_restart]
    used = edge.copy()
    for i in restarts.tolist():  # what came before in the block is dropped
        used[i - i % n : i] = False
    blocks = np.zeros(-(-max(readings.size, 1) // n) + 1, dtype=np.bool_)
    blocks[np.flatnonzero(used) // n] = True
    found = np.where(own.is_restart, edge[np.minimum(own.at, readings.size - 1)], blocks[own.at // n - 1])
    if not found.size:
        return found
    source = np.maximum.accumulate(np.where(own.kind == FROM_MAP, np.arange(own.kind.size), 0))
    return np.asarray(found[source])


def _settings(table: Table, samples_per_block: int) -> Settings:
    """Members of a table that the front end uses."""
    missing = table.records("guards")[:, 6]
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
    record = table.records("guards")[channel]
    low, high, max_step, max_rate = table.numbers(record)[:4]
    agree_us, stuck_us, missing_blocks = (int(word) for word in record[4:7])
    return Guarded(low, high, max_step, max_rate, agree_us, stuck_us, missing_blocks, takes_edge=channel > 0)


@dataclass(frozen=True, slots=True)
class FollowedHistory:
    """A history that was followed: its corrections, of which `steps` gives what every row sees of them.

    Attributes:
        stream: The samples.
        corrections: In the order in which they come into force.
        samples_per_block: As the target has it.
        status, bits, sigma, age: Of each correction, with one entry more, the first, for the time before any; sigma is
            None where the table has no uncertainties.
    """

    stream: SampleStream
    corrections: Steps
    samples_per_block: int
    status: NDArray[np.int32]
    bits: Words
    sigma: Words | None
    age: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.stream)

    def rows(self, part: slice) -> Replay:
        """Replay a part of the rows, in steps of 1; a long recording as a whole would fill memory."""
        position, steps = self.stream.positions(part), self.corrections
        in_force = steps.in_force(position)
        begun = in_force >= 0
        in_force += 1
        gaps = np.flatnonzero(self.stream.missed[part])
        missed_status = np.zeros(position.size, dtype=np.int32)
        missed_status[gaps] = self.status[steps.in_force(position[gaps] - 1) + 1] | HELD
        held = np.where(steps.accepted[position], np.int32(0), np.int32(HELD))
        at_rows = self.status[in_force]
        return Replay(
            sample_status=at_rows | held,
            status=at_rows,
            bits=self.bits[in_force],
            missed_status=missed_status,
            block_valid=steps.valid[position // self.samples_per_block],
            begun=begun,
            sigma=None if self.sigma is None else self.sigma[in_force],
            age=self.age[in_force],
        )


def follow_history(
    table: Table, channels: Words, *, missed: NDArray[np.int64], samples_per_block: int
) -> FollowedHistory:
    """Front end, terms, map and uncertainty over a history; arguments as of `replay`."""
    settings, arithmetic = _settings(table, samples_per_block), F32 if table.numeric == "f32" else Q31
    readings = table.numbers(channels)
    stream = SampleStream.of_rows(arithmetic, settings, readings[:, 0], missed)
    steps = follow(arithmetic, stream.samples, settings)
    led = steps.led(table.lead_blocks)
    seen = np.clip(led.temperature, *table.numbers(table.envelope)[:2])
    course = replace(stream.course(led, samples_per_block), temperature=seen)
    outcome = TermOutcome(
        led.temperature,
        led.slope,
        np.zeros_like(led.temperature),
        led.remarks | np.where(seen != led.temperature, CLAMPED, 0).astype(np.int32),
    )
    if not led.at.size:  # no corrections: nothing that terms could change
        outcome.away += [np.zeros(0, dtype=np.bool_) for channel in table.channels if channel]
    terms = zip(recursions_of_table(table), table.channels, table.fallback_models, strict=True)
    for recursion, channel, number in terms if led.at.size else ():
        shown = None
        if channel:
            of_rows = with_missing(arithmetic, readings[:, channel], stream.placed)
            fallback = table.numbers(table.records("guards")[channel])[7]
            shown = channel_at(arithmetic, of_rows, _guarded(table, channel), fallback, settings, led)
            if number:
                shown = replace(shown, fallback_model=_fallback_model(table, number, outcome, shown, led))
        recursion.apply(course, shown, outcome)
    status, bits = _corrections(table, led, outcome)
    found = evidence_of(table, steps, course, outcome, status, samples_per_block)
    return FollowedHistory(
        stream,
        steps,
        samples_per_block,
        np.concatenate([[np.int32(HELD)], status]).astype(np.int32),
        np.concatenate([[np.uint32(0)], bits]).astype(np.uint32),
        sigma_bits(table, found) if table.sigma.size else None,
        np.concatenate([[0], found.age]),
    )


def _fallback_model(table: Table, number: int, outcome: TermOutcome, shown: CourseChannel, steps: Steps) -> NumberArray:
    """Return what a term adds without its channel, where a fallback model stands for it; else 0."""
    asked = np.flatnonzero((shown.is_away | ((shown.remarks & CLAMPED) != 0)) & (steps.kind == FROM_MAP))
    found = np.zeros_like(outcome.added)
    found[asked] = fallback_model(table, number, outcome.temperature[asked], outcome.slope[asked])
    return found


def _corrections(table: Table, steps: Steps, outcome: TermOutcome) -> tuple[NDArray[np.int32], Words]:
    """Status and bits of every correction."""
    made = np.flatnonzero(steps.kind == FROM_MAP)
    inputs = table.bits(np.stack([outcome.temperature, outcome.slope], axis=1))
    status = np.zeros(steps.kind.size, dtype=np.int32)
    bits = np.zeros(steps.kind.size, dtype=np.uint32)
    status[made], plain = evaluate_map(table, inputs[made])
    bits[made], remarks = _total(table, plain, outcome.added[made], outcome.remarks[made])
    status[made] |= remarks
    source = np.maximum.accumulate(np.where(steps.kind == FROM_MAP, np.arange(steps.kind.size), 0))
    status, bits = status[source], bits[source]
    status[steps.kind == FROM_KEPT] |= HELD
    fallen = steps.kind == FROM_FALLBACK
    status[fallen] = HELD | status_bits.FALLBACK
    bits[fallen] = table.fallback
    return status, bits


def _total(
    table: Table, bits: Words, added: NumberArray, remarks: NDArray[np.int32]
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
    remarks = remarks | np.where(clamped | beyond, CLAMPED, 0).astype(np.int32)
    return table.bits(total), remarks


_SPREAD = np.uint32(0x9E3779B1)  # odd: 2^32 over the golden ratio (Knuth, TAOCP 3, section 6.4)


@dataclass(frozen=True, slots=True)
class Calls:
    """Calls of the step functions, one entry each, in order.

    `missed[k]`: 0 for a call of `sample` with the bits `channels[k]`, shape (n, n_channels); else the count of a
    call of `missed`.
    """

    channels: Words
    missed: NDArray[np.int64]


class KnownInputs(Protocol):
    """Inputs of the known-answer test, as `gyrotc.tables.vectors` makes them."""

    @property
    def samples_per_block(self) -> int: ...

    def map_inputs(self, numeric: str) -> Words: ...

    def calls(self, numeric: str) -> Calls: ...


@dataclass(frozen=True, slots=True)
class Replay:
    """Every step of a history, one entry per row (call of `sample`)."""

    sample_status: NDArray[np.int32]  # what `sample` returns
    status: NDArray[np.int32]  # what `bias` returns after it
    bits: Words  # of the bias that it writes
    missed_status: NDArray[np.int32]  # what `missed` returns before the row (0 where nothing was missed)
    block_valid: NDArray[np.bool_]  # the row's own block has enough accepted samples
    begun: NDArray[np.bool_]  # a correction has been made; before it bias is 0, and says so by HELD
    sigma: Words | None  # bits of 1 σ that `snapshot` writes; None: the table has no uncertainties
    age: NDArray[np.int64]  # blocks that it writes


def replay(table: Table, channels: Words, *, missed: NDArray[np.int64], samples_per_block: int) -> Replay:
    """Feed a history to a fresh state.

    Args:
        table: The table.
        channels: Bits of every row's channels, shape (n, n_channels).
        missed: Samples that did not arrive before each row, shape (n,).
        samples_per_block: What the target gives to `gtc_<n>_init`.
    """
    missed = np.asarray(missed, dtype=np.int64)
    found = follow_history(table, np.asarray(channels), missed=missed, samples_per_block=samples_per_block)
    return found.rows(slice(None))


def answers(table: Table, vectors: KnownInputs) -> NDArray[np.uint32]:
    """Return the answers that `board_test.c` prints for a table: (status, bits) of every result, shape (n, 2).

    In order: the self-test; every map vector; `init`; every step of the history, whose status is that of
    the call plus 256 times that of `gtc_<n>_bias` after it; with uncertainties the bits of sigma, spread over a word,
    are added to those of the bias.
    """
    status, bits = evaluate_map(table, vectors.map_inputs(table.numeric))
    maps = np.stack([status.astype(np.uint32), bits], axis=1)
    zero = np.zeros((1, 2), dtype=np.uint32)
    history = _step_answers(table, vectors.calls(table.numeric), vectors.samples_per_block)
    return np.concatenate([zero, maps, zero, history])


def _step_answers(table: Table, calls: Calls, samples_per_block: int) -> NDArray[np.uint32]:
    """Answers of the step functions; each call is a row, or samples missed before the next row."""
    was_missed = calls.missed > 0
    channels = calls.channels[~was_missed]
    missed = np.diff(np.cumsum(calls.missed)[~was_missed], prepend=0)
    waiting = int(calls.missed.sum() - missed.sum())
    if waiting:  # the history ends with missing samples: one more holds their place
        absent = np.full((1, table.n_channels), table.encode_inputs(np.nan), dtype=np.uint32)
        channels, missed = np.concatenate([channels, absent]), np.append(missed, waiting)
    found = follow_history(table, channels, missed=missed, samples_per_block=samples_per_block)
    stream, steps, status = found.stream, found.corrections, found.status
    bits = found.bits if found.sigma is None else found.bits + found.sigma * _SPREAD
    position = stream.position
    row = np.cumsum(~was_missed) - 1
    last = np.where(was_missed, position[np.minimum(row + 1, len(channels) - 1)] - 1, position[row])
    k = steps.in_force(last) + 1
    held = np.where(was_missed | ~steps.accepted[last], HELD, 0)
    call = status[k] | held
    return np.stack([(call + 256 * status[k]).astype(np.uint32), bits[k]], axis=1)


def evaluate_map(table: Table, inputs: Words, fused: f32.Fused = frozenset()) -> tuple[NDArray[np.int32], Words]:
    """`gtc_<n>_map` for many inputs.

    Args:
        table: The table.
        inputs: Bits of (temperature, slope per block), shape (n, 2).
        fused: Sums of the float32 map (of `FUSIBLE`) that a wrong build fuses; none in a right answer.

    Returns:
        Statuses, shape (n,), and the bits of the biases (0 where the status is negative).
    """
    numbers = table.numbers(inputs)
    missing = ~np.isfinite(numbers) if table.numeric == "f32" else numbers == MISSING_Q31
    usable = ~(missing[:, 0] | missing[:, 1])
    x = np.where(usable[:, None], numbers, table.numbers(table.envelope)[[0, 2]])
    low, high = table.numbers(table.envelope).reshape(2, 2).T
    beyond = (x < low) | (x > high)
    status = np.where(beyond[:, 0] | beyond[:, 1], CLAMPED, 0)
    x = np.minimum(np.maximum(x, low), high)
    if table.numeric == "f32":
        points = f32.normalise(table, x, fused)
        cells = f32.cells(table, points, table.coverage_cells)
        bias: NDArray[Any] = f32.biases(table, points, fused)
    else:
        positions = q31.normalise(table, x)
        cells, bias = q31.cells(positions, table.coverage_cells), q31.biases(table, positions)
    within, clamped = governed(table.numbers(table.authority), bias)
    bits = table.bits(np.where(clamped, within, bias))
    status = status | np.where(clamped, CLAMPED, 0)
    status = status | np.where(_is_covered(table, cells), 0, UNCOVERED)
    status = np.where(usable, status, E_ARG).astype(np.int32)
    return status, np.where(usable, bits, np.uint32(0)).astype(np.uint32)


def fallback_model(table: Table, number: int, temperature: NDArray[Any], slope: NDArray[Any]) -> NDArray[Any]:
    """Evaluate the fallback model of a term whose channel is not known.

    Args:
        table: The table.
        number: Of the fallback model among its networks, from 1 on.
        temperature, slope: Inputs of the map, numbers of the arithmetic, shape (n,) each.
    """
    low, high = table.numbers(table.envelope).reshape(2, 2).T
    x = np.minimum(np.maximum(np.stack([temperature, slope], axis=1), low), high)
    if table.numeric == "f32":
        return f32.fallback_model(table, number, f32.normalise(table, x))
    return q31.fallback_model(table, number, q31.normalise(table, x))


def governed(bounds: NDArray[Any], x: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Numbers within bounds, and which of them were not."""
    low, high = bounds
    return np.clip(x, low, high), (x < low) | (x > high)


def _is_covered(table: Table, cell: NDArray[np.int64]) -> NDArray[np.bool_]:
    if table.coverage.size == 0:
        return np.ones(len(cell), dtype=np.bool_)
    index = cell[:, 1] * table.coverage_cells[0] + cell[:, 0]
    return np.asarray((table.coverage[index >> 5] >> (index & 31).astype(np.uint32)) & 1).astype(np.bool_)
