"""From samples to the sequence of corrections: blocks, slopes, holds, restarts, fallback.

docs/numerics.md, section 1, for a whole history at once: blocks are columns of arrays, and every
float32 operation is the one that the target does, in its order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..inputs import need_memory
from ..status import WARMING
from .believe import HELD, RESTART, believe
from .numbers import Arithmetic, Numbers

__all__ = [
    "FALLBACK",
    "KEEP",
    "MAP",
    "Settings",
    "Steps",
    "expand_missed",
    "follow",
    "positions",
    "with_missing",
]

MAP, KEEP, FALLBACK = 0, 1, 2  # any three numbers
_SAMPLE_BYTES = 24  # of what is kept for each sample while a history is followed
_LARGEST = 2**31 - 1  # of a number in fixed point
_PART = 2**16  # samples that are looked at together; few, so that what is computed of them stays small


@dataclass(frozen=True, slots=True)
class Settings:
    """Members of the table that the front end uses, as numbers of the arithmetic."""

    samples_per_block: int
    slope_blocks: int
    hold_blocks: int
    period_us: int  # of the samples
    stuck_us: int
    max_step: Any
    max_rate: Any  # per microsecond; in fixed point 2^-40 C


@dataclass(frozen=True, slots=True)
class Steps:
    """The corrections of a history, in the order in which they come into force.

    `believed[i]`: sample i was believed. For correction k: it is in force from sample `at[k]` on (at the
    same sample the later one wins); `kind` MAP (the map at `temperature`, `slope`), KEEP (the correction
    before it stays, held) or FALLBACK; `is_restart`: made by a sample, not by a block that closes; `remarks`:
    GTC_WARMING or 0. Where `kind` is not MAP, temperature,
    slope and remarks are those of the last map. Before the first one the correction is
    0, held. `valid[n]`, `mean[n]`: block n itself (the last one may be incomplete; its missing end counts
    as not valid).
    """

    believed: NDArray[np.bool_]
    at: NDArray[np.int64]
    kind: NDArray[np.int8]
    temperature: Numbers
    slope: Numbers
    remarks: NDArray[np.int32]
    is_restart: NDArray[np.bool_]
    valid: NDArray[np.bool_]
    mean: Numbers

    def led(self, blocks: int) -> Steps:
        """The same corrections with every mean where its slope brings it within `blocks` (0 or 1) blocks.

        A correction is in force for the block after the one that it was made of; so it is not late.
        """
        if blocks == 0:
            return self
        slope = np.where(self.kind == MAP, self.slope, self.slope.dtype.type(0))
        temperature = self.temperature + slope
        if np.issubdtype(temperature.dtype, np.integer):
            temperature = np.clip(temperature, -_LARGEST, _LARGEST)
        return replace(self, temperature=temperature)

    def in_force(self, samples: NDArray[np.int64]) -> NDArray[np.int64]:
        """Index of the correction in force at each of the ascending `samples`; -1 before the first."""
        first = np.searchsorted(samples, self.at, side="left")
        count = np.bincount(first, minlength=samples.size + 1)[: samples.size]
        np.cumsum(count, out=count)
        count -= 1
        return count


def expand_missed(missed: NDArray[np.int64], settings: Settings) -> NDArray[np.int64]:
    """Counts of missing samples as `gtc_<n>_missed` shortens them: by whole blocks."""
    n = settings.samples_per_block
    most = settings.hold_blocks + settings.slope_blocks + 2
    many = np.flatnonzero(missed >= (most + 1) * n)
    shortened = missed.copy() if many.size else missed
    shortened[many] -= (missed[many] // n - most) * n
    return shortened


def positions(missed: NDArray[np.int64], where: str = "the recording") -> NDArray[np.int64]:
    """Number of each row's sample where `missed` samples come before the row.

    Raises:
        InputError: Rows and gaps together are more samples than memory is granted for.
    """
    need_memory(_SAMPLE_BYTES * float(missed.size + missed.sum()), where, "its rows and gaps as samples")
    position = np.arange(missed.size)
    if missed.any():
        position += np.cumsum(missed)
    return position


def with_missing(arithmetic: Arithmetic, x: Numbers, position: NDArray[np.int64]) -> Numbers:
    """Samples at their positions, missing ones between them."""
    n = int(position[-1]) + 1 if position.size else 0
    if n == x.size:
        return x
    samples = arithmetic.missing(n)
    samples[position] = x
    return samples


def follow(arithmetic: Arithmetic, x: Numbers, settings: Settings) -> Steps:
    """Follows samples x, shape (n,), from the start of a state on."""
    step = arithmetic.step_per_sample(settings.max_rate, settings.period_us)
    stuck_samples = -(-settings.stuck_us // settings.period_us)
    verdict = believe(arithmetic, x, max_step=settings.max_step, step=step, stuck_samples=stuck_samples)
    valid, mean = _block_means(arithmetic, x, verdict, settings.samples_per_block)
    restarts, fallback = _restarts(verdict, valid, settings)
    # A block closes when the next sample arrives.
    n_closed = max(0, x.size - 1) // settings.samples_per_block
    closings = _closings(arithmetic, valid[:n_closed], mean, fallback, restarts, settings)
    starts = _Corrections(
        at=restarts,
        kind=np.zeros(restarts.size, dtype=np.int8),
        temperature=x[restarts],
        slope=np.zeros_like(x[restarts]),
        remarks=np.full(restarts.size, WARMING, dtype=np.int32),
    )
    # Stable: a block closes before the sample that opens the next one is judged.
    order = np.argsort(np.concatenate([closings.at, starts.at]), kind="stable")
    kind = np.concatenate([closings.kind, starts.kind])[order]
    made = order[np.maximum.accumulate(np.where(kind == MAP, np.arange(kind.size), 0))]
    return Steps(
        believed=verdict != HELD,
        at=np.concatenate([closings.at, starts.at])[order],
        kind=kind,
        temperature=np.concatenate([closings.temperature, starts.temperature])[made],
        slope=np.concatenate([closings.slope, starts.slope])[made],
        remarks=np.concatenate([closings.remarks, starts.remarks])[made],
        is_restart=order >= closings.at.size,
        valid=valid,
        mean=mean,
    )


@dataclass(frozen=True, slots=True)
class _Corrections:
    at: NDArray[np.int64]
    kind: NDArray[np.int8]
    temperature: Numbers
    slope: Numbers
    remarks: NDArray[np.int32]


def _block_means(
    arithmetic: Arithmetic, x: Numbers, verdict: NDArray[np.int8], n: int
) -> tuple[NDArray[np.bool_], Numbers]:
    """Which blocks are valid, and their means (0 where no sample was believed)."""
    used = verdict != HELD
    for i in np.flatnonzero(verdict == RESTART):  # what came before in the block is dropped
        used[i - i % n : i] = False
    step = n * max(1, _PART // n)
    parts = [
        _means(arithmetic, x[start : start + step], used[start : start + step], n)
        for start in range(0, max(x.size, 1), step)
    ]
    valid, mean = zip(*parts, strict=True)
    return np.concatenate(valid), np.concatenate(mean)


def _means(
    arithmetic: Arithmetic, x: Numbers, used: NDArray[np.bool_], n: int
) -> tuple[NDArray[np.bool_], Numbers]:
    """`_block_means` of a part that begins with a block."""
    blocks = -(-x.size // n)
    if blocks == 1:
        n, whole = x.size, n  # a block may be far longer than the recording
    else:
        whole = n
    values, there = np.zeros((blocks, n), dtype=x.dtype), np.zeros((blocks, n), dtype=np.bool_)
    values.reshape(-1)[: x.size] = np.where(used, x, 0)
    there.reshape(-1)[: x.size] = used
    count = np.count_nonzero(there, axis=1)
    base = values[np.arange(blocks), np.argmax(there, axis=1)]
    d = np.where(there, arithmetic.diff(values, base[:, None]), values.dtype.type(0))
    mean = arithmetic.mean(base, arithmetic.running_sum(d), np.maximum(count, 1))
    return 2 * count >= whole, mean


def _restarts(
    verdict: NDArray[np.int8], valid: NDArray[np.bool_], settings: Settings
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Samples at which the front end restarts; blocks after which the fallback is in force."""
    n = settings.samples_per_block
    fallback = np.zeros(valid.size, dtype=np.bool_)
    restarts = np.flatnonzero(verdict == RESTART)
    if restarts.size == 0:
        return restarts, fallback
    restarted = set((restarts // n).tolist())
    invalid = np.flatnonzero(~valid)
    after_fallback: list[int] = []
    held, previous, fell = 0, -2, False
    for block in invalid[invalid >= restarts[0] // n].tolist():
        if block != previous + 1:
            held, fell = 0, False
        first = int(np.argmax(verdict[block * n : (block + 1) * n] != HELD)) + block * n
        believes = verdict[first] != HELD
        if fell and believes:
            after_fallback.append(first)
        if believes and (fell or block in restarted):
            held = 0
        held += 1
        fell = held > settings.hold_blocks
        fallback[block] = fell
        previous = block
        if fell and block + 1 < valid.size and valid[block + 1]:
            opens = (block + 1) * n
            after_fallback.append(opens + int(np.argmax(verdict[opens : opens + n] != HELD)))
    return np.union1d(restarts, np.array(after_fallback, dtype=np.int64)), fallback


def _closings(
    arithmetic: Arithmetic,
    valid: NDArray[np.bool_],
    mean: Numbers,
    fallback: NDArray[np.bool_],
    restarts: NDArray[np.int64],
    settings: Settings,
) -> _Corrections:
    """The corrections made by blocks that close, from the block of the first restart on."""
    n, window = settings.samples_per_block, settings.slope_blocks
    first = int(restarts[0]) // n if restarts.size else valid.size
    blocks = np.arange(first, valid.size)
    latest = (restarts // n)[np.searchsorted(restarts, (blocks + 1) * n) - 1]
    good = valid[blocks]
    full = good & (blocks - latest + 1 >= window)
    slope = np.zeros_like(mean[blocks])
    used = [valid[blocks[full] - (window - 1) + k] for k in range(window)]
    enough = np.zeros(int(full.sum()), dtype=np.int64)
    for there in used:
        enough = enough + there
    d = [arithmetic.diff(mean[blocks[full] - (window - 1) + k], mean[blocks[full]]) for k in range(window)]
    steep = arithmetic.slope(d, list(range(window)), used)
    sure = enough >= max(2, (window + 1) // 2)
    slope[full] = np.where(sure, steep, slope.dtype.type(0))
    warming = ~full
    warming[full] = ~sure
    kind = np.where(good, MAP, np.where(fallback[blocks], FALLBACK, KEEP)).astype(np.int8)
    return _Corrections(
        at=(blocks + 1) * n,
        kind=kind,
        temperature=mean[blocks],
        slope=slope,
        remarks=np.where(good & warming, WARMING, 0).astype(np.int32),
    )
