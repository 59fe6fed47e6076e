"""Training samples of a recording: the front end that the target will have, run over its rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..common.inputs import PLAUSIBLE_C
from ..mirror import table as status_bits
from ..mirror.front_end import (
    FROM_FALLBACK,
    FROM_KEPT,
    FROM_MAP,
    SampleStream,
    Settings,
    Steps,
    follow,
    missed_before,
    period_us,
    samples_per_block,
)
from ..mirror.readings import Guarded
from ..mirror.recursions import F32

if TYPE_CHECKING:
    from ..recordings.records import Rows, Run

_PART = 2**18  # rows that are looked at together: bounds memory


@dataclass(frozen=True, slots=True)
class Blocks:
    """Blocks that the front end forms of one run, from the first row of the file on.

    A training sample is a block that is `used`: input (`temperature_c`, `slope_c`), answer
    `rate_dph`, weight `rows`.
    """

    start_s: NDArray[np.float64]
    valid: NDArray[np.bool_]  # the block itself has enough accepted samples
    temperature_c: NDArray[np.float32]  # input in force during the block (NaN before the first sample)
    slope_c: NDArray[np.float32]  # input in force, C per block
    mean_c: NDArray[np.float32]  # mean of the block itself (0 where it has no accepted sample)
    status: NDArray[np.int32]  # status bits in force, as in gtc.h, without those of the map
    rate_dph: NDArray[np.float64]  # mean measured rate of the block's rows in the span (NaN: none)
    rows: NDArray[np.int64]  # number of these rows
    steps: Steps  # every correction of the run
    in_force: NDArray[np.int64]  # the correction in force that the map made last (-1 before the first sample)
    stream: SampleStream  # its samples
    settings: Settings

    @property
    def begins_s(self) -> float | None:
        """Start of the first block with rows of the run, s: means of it begin here, accepted or not."""
        starts = self.start_s[self.rows > 0]
        return float(starts[0]) if starts.size else None

    @property
    def used(self) -> NDArray[np.bool_]:
        """Mask of the blocks that are training samples."""
        return self.valid & (self.rows > 0) & np.isfinite(self.temperature_c)


def run_blocks(
    rows: Rows,
    run: Run,
    usable: NDArray[np.bool_],
    *,
    block_s: float,
    slope_blocks: int,
    max_step_c: float,
    max_rate_c_per_min: float,
    stuck_s: float = 0.0,
    agree_s: float = 0.0,
    hold_blocks: int = 30,
    lead_blocks: int = 0,
) -> Blocks:
    """Run the float32 front end over a recording.

    Args:
        rows: All rows of the run's file.
        run: Gives the row period.
        usable: Which rows count for the means of the rate.
        block_s: Length of a block, s.
        slope_blocks: Window of dT/dt, blocks.
        max_step_c: Largest accepted change between two samples, C, besides ...
        max_rate_c_per_min: ... this rate times the time since the last accepted one.
        agree_s: Least time from the first to the last of the readings that agree and do not follow the last accepted
            one, s; 0: one of them is enough.
        stuck_s: Time after which a reading that stays the same is none, s; 0: never.
        hold_blocks: Invalid blocks in a row that are bridged before the fallback.
        lead_blocks: 1: map and terms see where the slope brings a block's mean by the time that it is in force.
    """
    n = samples_per_block(block_s, run.row_period_s)
    block_us = max(1, round(block_s * 1e6))
    guard = Guarded(
        low=np.float32(PLAUSIBLE_C[0]),
        high=np.float32(PLAUSIBLE_C[1]),
        max_step=np.float32(max_step_c),
        max_rate=np.float32(max_rate_c_per_min / 60e6),
        agree_us=round(agree_s * 1e6),
        stuck_us=round(stuck_s * 1e6),
        missing_blocks=hold_blocks,
    )
    settings = Settings(
        samples_per_block=n,
        period_us=period_us(block_us, n),
        block_us=block_us,
        slope_blocks=slope_blocks,
        guard=guard,
        longest_blocks=hold_blocks,
    )
    missed = missed_before(rows.time_s, run.row_period_s)
    stream = SampleStream.of_rows(F32, settings, F32.numbers(rows.temperature_c), missed, run.file)
    steps = follow(F32, stream.samples, settings).led(lead_blocks)
    n_blocks = steps.valid.size
    last = np.minimum(np.arange(1, n_blocks + 1) * n, stream.samples.size) - 1
    k = steps.in_force(last)
    temperature, slope, status = _in_force(steps, k)
    starts = np.minimum(np.arange(n_blocks + 1) * n, stream.samples.size)
    first_row = stream.first_rows(starts)
    start_s = _time_of(starts[:-1], stream, rows.time_s)
    rate, count = _mean_rate(rows, usable, first_row, n)
    return Blocks(
        start_s=start_s,
        valid=steps.valid,
        temperature_c=temperature,
        slope_c=slope,
        mean_c=steps.mean,
        status=status,
        rate_dph=rate,
        rows=count,
        steps=steps,
        in_force=_last_map(steps, k),
        stream=stream,
        settings=settings,
    )


def _last_map(steps: Steps, k: NDArray[np.int64]) -> NDArray[np.int64]:
    """The last correction up to each of k that the map made: one that is kept goes on."""
    if steps.kind.size == 0:
        return k
    made = np.maximum.accumulate(np.where(steps.kind == FROM_MAP, np.arange(steps.kind.size), -1))
    return np.where(k >= 0, made[k], -1)


def _in_force(steps: Steps, k: NDArray[np.int64]) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32]]:
    """Input and status in force during each block, from the correction at its last sample (-1: none)."""
    started = k >= 0
    source, made = k[started], _last_map(steps, k)[started]
    temperature = np.full(k.size, np.nan, dtype=np.float32)
    slope = np.zeros(k.size, dtype=np.float32)
    status = np.full(k.size, status_bits.HELD, dtype=np.int32)
    temperature[started] = np.where(made < 0, np.float32(np.nan), steps.temperature[made])
    slope[started] = np.where(made < 0, np.float32(0.0), steps.slope[made])
    kind = steps.kind[source]
    kept = steps.remarks[source] | np.where(kind == FROM_KEPT, status_bits.HELD, 0)
    status[started] = np.where(kind == FROM_FALLBACK, status_bits.HELD | status_bits.FALLBACK, kept)
    return temperature, slope, status


def _time_of(samples: NDArray[np.integer], stream: SampleStream, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Times of samples, shape (k,), between the rows beside them."""
    if len(time_s) == 0:
        return np.empty(0)
    after = np.minimum(stream.first_rows(samples), len(time_s) - 1)
    after = after[np.diff(after, prepend=-1) > 0]  # both are sorted: without repetitions in one pass
    near = np.stack([np.maximum(after - 1, 0), after], axis=1).reshape(-1)
    near = near[np.diff(near, prepend=-1) > 0]
    return np.asarray(np.interp(samples, stream.samples_of(near), time_s[near]))


def _mean_rate(
    rows: Rows, usable: NDArray[np.bool_], first_row: NDArray[np.int64], rows_per_block: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the mean measured rate and the number of usable rows of each block.

    Args:
        first_row: Of each block, and that behind the last block's; shape (blocks + 1,).
    """
    n_blocks, together = len(first_row) - 1, max(1, _PART // rows_per_block)
    count, total = np.zeros(n_blocks), np.zeros(n_blocks)
    for start in range(0, n_blocks, together):
        of_blocks = first_row[start : start + together + 1]
        part = slice(of_blocks[0], of_blocks[-1])
        block = np.repeat(np.arange(len(of_blocks) - 1), np.diff(of_blocks))
        here, blocks = usable[part], slice(start, start + len(of_blocks) - 1)
        rate = np.where(here, rows.rate_dph[part], 0.0)
        count[blocks] = np.bincount(block, weights=here, minlength=len(of_blocks) - 1)
        total[blocks] = np.bincount(block, weights=rate, minlength=len(of_blocks) - 1)
    with np.errstate(invalid="ignore"):
        mean = total / count
    return mean, count.astype(np.int64)
