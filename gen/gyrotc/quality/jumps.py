"""Find places at which a temperature jumps: lines before and behind do not meet in any corner of a programme.

Where a chamber turns a ramp into a hold the two lines meet within a row, so that their difference between the rows is
less than a step of the steeper one. What is beyond that is a jump, whatever the speed of the chamber is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..common.arrays import FloatArray, parts_of
from ..common.metrics import MAD_TO_SIGMA
from .odds import CELL_S, MIN_JUMP_C, OCTAVE, cost_of, outlier_odds

# Value half a block behind four blocks, by their line.
_EXTRAPOLATED = np.array([-0.35, 0.05, 0.45, 0.85])
_BESIDE = len(_EXTRAPOLATED)
# Of the largest step that a sharp corner makes: a sensor with a lag of some rows rounds the lines beside it.
_CORNERS = 2.0
# A temperature sensor that comes off its place settles within this time.
_SETTLES_S = 6.0 * CELL_S


class Jump(NamedTuple):
    """A jump: first row, row after the last of those among which it is, size and its uncertainty (C), log-odds."""

    first: int
    end: int
    size: float
    sigma: float
    log_odds: float


def jumps(temperature: FloatArray, period_s: float) -> list[Jump]:
    """Return the jumps of a temperature (finite, in order of time), by their rows."""
    found: list[Jump] = []
    cost, n = cost_of(2.0 * len(temperature)), 1
    while n <= max(_SETTLES_S / period_s, 1.0) and len(temperature) // n >= 4 * OCTAVE:
        count = len(temperature) // n
        blocks = temperature[: count * n] if n == 1 else temperature[: count * n].reshape(count, n).mean(axis=1)
        places = list(parts_of(count - 2 * _BESIDE + 1))
        usual = [float(np.median(np.abs(_jump(blocks, part)[0]))) for part in places]
        sigma = max(MAD_TO_SIGMA * float(np.median(usual)), 1e-9)
        for part in places:
            size, beyond = _jump(blocks, part)
            far = np.flatnonzero((np.abs(size) > MIN_JUMP_C) & (beyond > sigma))
            odds = outlier_odds(beyond[far] / sigma, np.inf) - cost
            for k, log_odds in zip(far[odds > 0.0].tolist(), odds[odds > 0.0].tolist(), strict=True):
                first = (part.start + k + _BESIDE - 1) * n
                end = min(first + 2 * n, len(temperature))
                known = any(one.first - _BESIDE * n < end and first < one.end + _BESIDE * n for one in found)
                if not known and beyond[k] >= beyond[max(k - _BESIDE, 0) : k + _BESIDE + 1].max():
                    found.append(Jump(first, end, float(size[k]), sigma, log_odds))
        n *= OCTAVE
    return sorted(found)


def _jump(blocks: FloatArray, part: slice) -> tuple[FloatArray, FloatArray]:
    """Return the jump behind the fourth block from each place of a part on, and by how much no corner explains it."""
    near = blocks[part.start : part.stop + 2 * _BESIDE - 1]
    count = part.stop - part.start
    behind = np.correlate(near[_BESIDE:], _EXTRAPOLATED[::-1])[:count]
    size = behind - np.correlate(near, _EXTRAPOLATED)[:count]
    step = np.diff(near)
    slopes = np.stack([step[k : k + count] for k in (0, 2, 4, 6)])
    return size, np.maximum(np.abs(size) - _CORNERS * np.ptp(slopes, axis=0), 0.0)
