"""Front end: what the target makes of its temperature samples, mirrored operation by operation.

Stage 2 of the house (recordings → **samples** → model → tables → C → proof). docs/numerics.md,
section 1, is the text that this package and libc/gtc_front.inl both follow, to the bit:
`numbers` holds the operations of each arithmetic, `believe` decides which samples are believed,
`follow` makes block means, slopes and the sequence of corrections, `stream` counts samples and blocks as the
target does, `training` turns a recording into training samples.
"""

from __future__ import annotations

from .believe import BELIEVED, HELD, RESTART, Guarded, believe
from .channels import channel_at
from .follow import (
    FALLBACK,
    KEEP,
    MAP,
    Settings,
    Steps,
    expand_missed,
    follow,
    period_us,
    positions,
    samples_per_block,
    with_missing,
)
from .numbers import F32, Q31, Arithmetic
from .screen import departing_rows
from .stream import Stream
from .training import (
    PLAUSIBLE_C,
    Blocks,
    blocks_since_power_on,
    missed_before,
    run_blocks,
)

__all__ = [
    "BELIEVED",
    "F32",
    "FALLBACK",
    "HELD",
    "KEEP",
    "MAP",
    "PLAUSIBLE_C",
    "Q31",
    "RESTART",
    "Arithmetic",
    "Blocks",
    "Guarded",
    "Settings",
    "Steps",
    "Stream",
    "believe",
    "blocks_since_power_on",
    "channel_at",
    "departing_rows",
    "expand_missed",
    "follow",
    "missed_before",
    "period_us",
    "positions",
    "run_blocks",
    "samples_per_block",
    "with_missing",
]
