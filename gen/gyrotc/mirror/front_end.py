"""Form the sequence of corrections from samples: counting, blocks, slopes, holds, restarts, fallback.

docs/numerics.md, section 1, for a whole history at once: blocks are columns of arrays, and every
float32 operation is the one that the target does, in its order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..common.inputs import need_memory
from ..common.missing import missing_rows
from .readings import READING_HELD, READING_RESTART, Guarded, judge_readings
from .recursions import Arithmetic, Course, NumberArray
from .table import WARMING

if TYPE_CHECKING:
    from ..recordings.records import Rows, Run

FROM_MAP, FROM_KEPT, FROM_FALLBACK = 0, 1, 2  # any three numbers
_SAMPLE_BYTES = 24  # of what is kept for each sample while a history is followed
_LARGEST = 2**31 - 1  # of a number in fixed point
_PART = 2**16  # samples that are looked at together; few, so that what is computed of them stays small
_MAX_MISSED = 2**32 - 1  # samples between two readings: the runtime counts them in 32 bits


@dataclass(frozen=True, slots=True)
class Settings:
    """Members of the table that the front end uses, as numbers of the arithmetic."""

    samples_per_block: int
    period_us: int  # of the samples
    block_us: int
    slope_blocks: int
    guard: Guarded  # of the temperature
    longest_blocks: int  # the longest missing_blocks of all guards


@dataclass(frozen=True, slots=True)
class Steps:
    """The corrections of a history, in the order in which they come into force.

    `accepted[i]`: sample i was accepted. For correction k: it is in force from sample `at[k]` on (at the same
    sample the later one wins); `kind` FROM_MAP (the map at `temperature`, `slope`), FROM_KEPT (the correction
    before it stays, held) or FROM_FALLBACK; `is_restart`: made by a sample, not by a block that closes; `remarks`:
    GTC_WARMING or 0; `missing`: samples without a reading in the block that it was made of. Where `kind` is not
    FROM_MAP, temperature, slope, remarks and `missing` are those of the last map, 0 where there was none. Before
    the first one the correction is 0, held. `valid[n]`, `mean[n]`: block n itself (the last one may be incomplete;
    its missing end counts as not valid).
    """

    accepted: NDArray[np.bool_]
    at: NDArray[np.int64]
    kind: NDArray[np.int8]
    temperature: NumberArray
    slope: NumberArray
    remarks: NDArray[np.int32]
    is_restart: NDArray[np.bool_]
    missing: NDArray[np.int64]
    valid: NDArray[np.bool_]
    mean: NumberArray

    def led(self, blocks: int) -> Steps:
        """The same corrections with every mean where its slope brings it within `blocks` (0 or 1) blocks.

        A correction is in force for the block after the one that it was made of; so it is not late.
        """
        if blocks == 0:
            return self
        slope = np.where(self.kind == FROM_MAP, self.slope, self.slope.dtype.type(0))
        temperature = self.temperature + slope
        if np.issubdtype(temperature.dtype, np.integer):
            temperature = np.clip(temperature, -_LARGEST, _LARGEST)
        return replace(self, temperature=temperature)

    def in_force(self, samples: NDArray[np.integer]) -> NDArray[np.int64]:
        """Index of the correction in force at each of the ascending `samples`; -1 before the first."""
        first = np.searchsorted(samples, self.at, side="left")
        count = np.bincount(first, minlength=samples.size + 1)[: samples.size]
        np.cumsum(count, out=count)
        count -= 1
        return count


def expand_missed(missed: NDArray[np.int64], settings: Settings) -> NDArray[np.int64]:
    """Counts of missing samples, shortened by whole blocks where nothing changes any more but the times."""
    n, longest = settings.samples_per_block, settings.longest_blocks
    # So late that every channel is lost and its candidate forgotten; a block of samples may be shorter than block_us.
    forgotten = -(-(longest + 1) * settings.block_us // (n * settings.period_us))
    most = max(longest + 2, forgotten + 1)
    many = np.flatnonzero(missed >= (most + 1) * n)
    if many.size == 0:
        return missed
    shortened = missed.copy()
    shortened[many] -= (missed[many] // n - most) * n
    return np.asarray(shortened)


def positions(missed: NDArray[np.int64], where: str = "the recording") -> NDArray[np.integer] | None:
    """Number of each row's sample where `missed` samples come before the row; None: that of the row.

    Raises:
        InputError: Rows and gaps together are more samples than memory is granted for.
    """
    samples = missed.size + int(missed.sum())
    need_memory(_SAMPLE_BYTES * float(samples), where, "its rows and gaps as samples")
    if samples == missed.size:
        return None
    position = np.arange(missed.size, dtype=_number_type(samples))
    position += np.cumsum(missed, dtype=position.dtype)
    return position


def _number_type(samples: int) -> type[np.integer]:
    return np.int32 if samples < 2**31 else np.int64


def with_missing(arithmetic: Arithmetic, x: NumberArray, position: NDArray[np.integer] | None) -> NumberArray:
    """Samples at their positions, missing ones between them; None: there are none."""
    if position is None:
        return x
    samples = arithmetic.missing(int(position[-1]) + 1)
    samples[position] = x
    return samples


def follow(arithmetic: Arithmetic, x: NumberArray, settings: Settings) -> Steps:
    """Follow samples x, shape (n,), from the start of a state on."""
    verdict, fallback = _accepted(arithmetic, x, settings)
    x = settings.guard.limited(x)
    valid, mean, count = _block_means(arithmetic, x, verdict, settings.samples_per_block)
    restarts = np.flatnonzero(verdict == READING_RESTART)
    # A block closes when the next sample arrives.
    n_closed = max(0, x.size - 1) // settings.samples_per_block
    closings = _closings(arithmetic, valid[:n_closed], mean, count, fallback, restarts, settings)
    starts = _Corrections(
        at=restarts,
        kind=np.zeros(restarts.size, dtype=np.int8),
        temperature=x[restarts],
        slope=np.zeros_like(x[restarts]),
        remarks=np.full(restarts.size, WARMING, dtype=np.int32),
        missing=np.zeros(restarts.size, dtype=np.int64),
    )
    # Stable: a block closes before the sample that opens the next one is judged.
    order = np.argsort(np.concatenate([closings.at, starts.at]), kind="stable")
    kind = np.concatenate([closings.kind, starts.kind])[order]
    made = order[np.maximum.accumulate(np.where(kind == FROM_MAP, np.arange(kind.size), 0))]
    return Steps(
        accepted=verdict != READING_HELD,
        at=np.concatenate([closings.at, starts.at])[order],
        kind=kind,
        temperature=np.concatenate([closings.temperature, starts.temperature])[made],
        slope=np.concatenate([closings.slope, starts.slope])[made],
        remarks=np.concatenate([closings.remarks, starts.remarks])[made],
        is_restart=order >= closings.at.size,
        missing=np.concatenate([closings.missing, starts.missing])[made],
        valid=valid,
        mean=mean,
    )


@dataclass(frozen=True, slots=True)
class _Corrections:
    at: NDArray[np.int64]
    kind: NDArray[np.int8]
    temperature: NumberArray
    slope: NumberArray
    remarks: NDArray[np.int32]
    missing: NDArray[np.int64]


def _block_means(
    arithmetic: Arithmetic, x: NumberArray, verdict: NDArray[np.int8], n: int
) -> tuple[NDArray[np.bool_], NumberArray, NDArray[np.int64]]:
    """Return a mask of valid blocks, their means (0 without an accepted sample), and the count of accepted samples."""
    used = _used(verdict, n)
    step = n * max(1, _PART // n)
    parts = [
        _means(arithmetic, x[start : start + step], used[start : start + step], n)
        for start in range(0, max(x.size, 1), step)
    ]
    valid, mean, count = zip(*parts, strict=True)
    return np.concatenate(valid), np.concatenate(mean), np.concatenate(count)


def _means(
    arithmetic: Arithmetic, x: NumberArray, used: NDArray[np.bool_], n: int
) -> tuple[NDArray[np.bool_], NumberArray, NDArray[np.int64]]:
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
    d = np.where(there, values - base[:, None], values.dtype.type(0))
    mean = arithmetic.mean(base, arithmetic.running_sum(d), np.maximum(count, 1))
    return _is_enough(count, whole), mean, count


def _is_enough(count: NDArray[np.integer], n: int) -> NDArray[np.bool_]:
    """Readings that make a mean: half of a block, or two, which agree."""
    return np.asarray((2 * count >= n) | (count >= 2))


def _accepted(arithmetic: Arithmetic, x: NumberArray, settings: Settings) -> tuple[NDArray[np.int8], NDArray[np.bool_]]:
    """Verdict on every sample, and blocks after which the fallback is in force.

    What is accepted after a loss depends on when the blocks made it one: judged again from each loss on.
    """
    n = settings.samples_per_block
    lost: list[int] = []
    while True:
        verdict = judge_readings(
            arithmetic, x, settings.guard, period_us=settings.period_us, block_us=settings.block_us, lost=lost
        )
        fallback = _fallen(verdict, settings)
        starts = (1 + np.flatnonzero(fallback & ~np.concatenate([[False], fallback[:-1]]))) * n
        new = [int(start) for start in starts if start < x.size and start not in lost]
        if not new:
            return verdict, fallback
        lost.append(new[0])


def _fallen(verdict: NDArray[np.int8], settings: Settings) -> NDArray[np.bool_]:
    """Blocks after which the fallback is in force."""
    n = settings.samples_per_block
    used = _used(verdict, n)
    blocks = max(1, -(-verdict.size // n))
    whole = used.size // n * n
    count = np.count_nonzero(used[:whole].reshape(-1, n), axis=1)
    valid = _is_enough(np.append(count, np.count_nonzero(used[whole:]))[:blocks], n)
    restarted = np.zeros(blocks, dtype=np.bool_)
    restarted[np.flatnonzero(verdict == READING_RESTART) // n] = True
    fallback = np.zeros(blocks, dtype=np.bool_)
    held, previous = 0, -2
    for block in np.flatnonzero(~valid).tolist():
        if block != previous + 1 or restarted[block]:
            held = 0
        held += 1
        fallback[block] = held > settings.guard.missing_blocks
        previous = block
    return fallback


def _used(verdict: NDArray[np.int8], n: int) -> NDArray[np.bool_]:
    """Samples that count for their block: accepted, and none before a restart in it."""
    used: NDArray[np.bool_] = verdict != READING_HELD
    for i in np.flatnonzero(verdict == READING_RESTART):  # what came before in the block is dropped
        used[i - i % n : i] = False
    return used


def _closings(
    arithmetic: Arithmetic,
    valid: NDArray[np.bool_],
    mean: NumberArray,
    count: NDArray[np.int64],
    fallback: NDArray[np.bool_],
    restarts: NDArray[np.int64],
    settings: Settings,
) -> _Corrections:
    """The corrections made by blocks that close: before the first restart only those that fall back."""
    n, window = settings.samples_per_block, settings.slope_blocks
    first = min(int(restarts[0]) // n, valid.size) if restarts.size else valid.size
    before = np.flatnonzero(fallback[:first])
    blocks = np.arange(first, valid.size)
    latest = (restarts // n)[np.searchsorted(restarts, (blocks + 1) * n) - 1]
    good = valid[blocks]
    full = good & (blocks - latest + 1 >= window)
    slope = np.zeros_like(mean[blocks])
    last = blocks[full]
    at = last - (window - 1) + np.arange(window)[:, None]
    used = valid[at]
    d = mean[at] - mean[last]
    steep = arithmetic.slope(d, used)
    sure = np.count_nonzero(used, axis=0) >= max(2, (window + 1) // 2)
    slope[full] = np.where(sure, steep, slope.dtype.type(0))
    warming = ~full
    warming[full] = ~sure
    kind = np.where(good, FROM_MAP, np.where(fallback[blocks], FROM_FALLBACK, FROM_KEPT)).astype(np.int8)
    none = np.zeros(before.size)
    return _Corrections(
        at=(np.concatenate([before, blocks]) + 1) * n,
        kind=np.concatenate([none + FROM_FALLBACK, kind]).astype(np.int8),
        temperature=np.concatenate([none.astype(mean.dtype), mean[blocks]]),
        slope=np.concatenate([none.astype(slope.dtype), slope]),
        remarks=np.concatenate([none, np.where(good & warming, WARMING, 0)]).astype(np.int32),
        missing=np.concatenate([none, n - count[blocks]]).astype(np.int64),
    )


def samples_per_block(block_s: float, row_period_s: float) -> int:
    """Rows per block, at least 1."""
    return max(1, round(block_s / row_period_s))


def period_us(block_us: int, samples_per_block: int) -> int:
    """Sample period of a target with so many samples in a block, microseconds; at least 1."""
    return max(1, (block_us + samples_per_block // 2) // samples_per_block)


_MAX_ELAPSED = 0xFFFFFF  # blocks since power-on that a target counts


@dataclass(frozen=True, slots=True)
class SampleStream:
    """Samples, missing ones among them.

    `samples`: temperatures; `placed[k]`: sample number of row k, None where that is k; `missed[k]`: samples missed
    before it, shortened, and `dropped[k]`: whole blocks that were left out of them.
    """

    samples: NumberArray
    placed: NDArray[np.integer] | None
    missed: NDArray[np.int64]
    dropped: NDArray[np.int64]

    def __len__(self) -> int:
        return self.missed.size

    @property
    def position(self) -> NDArray[np.integer]:
        """Sample number of each row."""
        return self.positions(slice(0, len(self)))

    def first_rows(self, samples: NDArray[np.integer]) -> NDArray[np.int64]:
        """The first row at or behind each sample number, without a number for every row."""
        if self.placed is None:
            return np.asarray(np.minimum(samples, len(self)), dtype=np.int64)
        return np.asarray(np.searchsorted(self.placed, samples.astype(self.placed.dtype)))

    def samples_of(self, rows: NDArray[np.int64]) -> NDArray[np.integer]:
        """Sample numbers of some rows."""
        return rows if self.placed is None else self.placed[rows]

    def positions(self, part: slice) -> NDArray[np.integer]:
        """Return the positions of some rows."""
        if self.placed is not None:
            return self.placed[part]
        return np.arange(*part.indices(len(self)), dtype=_number_type(len(self)))

    @staticmethod
    def of_rows(
        arithmetic: Arithmetic,
        settings: Settings,
        temperature: NumberArray,
        missed: NDArray[np.int64],
        where: str = "the recording",
    ) -> SampleStream:
        """Samples of rows, shape (n,), with `missed` samples before each.

        Raises:
            InputError: Rows and gaps of `where` together are more samples than memory is granted for.
        """
        shortened = expand_missed(missed, settings)
        position = positions(shortened, where)
        samples = with_missing(arithmetic, temperature, position)
        dropped = np.broadcast_to(np.int64(0), missed.shape)  # takes no memory
        if shortened is not missed:
            dropped = (missed - shortened) // settings.samples_per_block
        return SampleStream(samples, position, shortened, dropped)

    def course(self, steps: Steps, samples_per_block: int, blocks_before: int = 0) -> Course:
        """The corrections as terms see them, `blocks_before` blocks after power-on at the first sample."""
        return Course(
            temperature=steps.temperature,
            closes=~steps.is_restart,
            elapsed=np.minimum(self._elapsed(steps.at, samples_per_block) + blocks_before, _MAX_ELAPSED),
        )

    def _elapsed(self, at: NDArray[np.int64], samples_per_block: int) -> NDArray[np.int64]:
        """Blocks since the start at each sample number, with those that were left out."""
        if not self.dropped.any():
            return np.asarray(at // samples_per_block)
        total = np.concatenate([[0], np.cumsum(self.dropped)])
        runs = self.position - self.missed  # where the missing samples before each row begin
        return np.asarray(at // samples_per_block + total[np.searchsorted(runs, at, side="right")])


def missed_before(time_s: NDArray[np.float64], row_period_s: float) -> NDArray[np.int64]:
    """Return the number of rows that are missing before each row; a stamp that is only late is no missing row."""
    before, count = missing_rows(time_s, row_period_s)
    if len(before) == 0:
        return np.broadcast_to(np.int64(0), time_s.shape)  # which takes no memory
    missed = np.zeros(time_s.size, dtype=np.int64)
    missed[before + 1] = np.minimum(count, _MAX_MISSED)
    return missed


def blocks_since_power_on(rows: Rows, run: Run, block_s: float) -> int:
    """Return the number of blocks from power-on to the first row; negative if it came later, 0 if it is unknown."""
    if run.power_on_s is None:
        return 0
    return round((float(rows.time_s[0]) - run.power_on_s) / block_s)
