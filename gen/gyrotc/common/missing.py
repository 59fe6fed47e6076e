"""Find the places at which rows are missing, by time stamps that may be uneven."""

from __future__ import annotations

import numpy as np

from .arrays import FloatArray, IntArray, parts_of, steps_where

# A step longer than this, in row periods, has room for a missing row.
_ROOM = 1.5
# Rows on either side of a step whose stamps say where the even clock of the rows is: an uneven stamp comes back.
_BESIDE = 10
# Steps that are looked at together, for memory.
_TOGETHER = 2**14


def missing_rows(time_s: FloatArray, period_s: float) -> tuple[IntArray, IntArray]:
    """Return the rows behind which others are missing, and how many are missing there.

    A stamp that is late makes a long step and a short one. After missing rows the stamps stay behind the count of the
    rows, by as many periods as rows are missing.

    Args:
        time_s: Times in order, s, shape (n,).
        period_s: Row period, s.
    """
    before = np.flatnonzero(steps_where(time_s, lambda step: step > _ROOM * period_s))
    room = np.round((time_s[before + 1] - time_s[before]) / period_s).astype(np.int64) - 1
    count = _shifts(time_s, period_s, before, np.array([-1, len(time_s) - 1]))
    # The first count is too large near another gap.
    gaps = np.r_[-1, before[count > 0], len(time_s) - 1]
    count = np.minimum(room, _shifts(time_s, period_s, before, gaps))
    return before[count > 0], count[count > 0]


def _shifts(time_s: FloatArray, period_s: float, before: IntArray, gaps: IntArray) -> IntArray:
    """Return by how many periods the stamps are later behind some rows than ahead of them.

    Args:
        before: The last rows ahead of the places.
        gaps: Last rows ahead of gaps, in order; only rows between two gaps are compared.
    """
    found = np.zeros(len(before), dtype=np.int64)
    offsets = np.arange(_BESIDE)
    for part in parts_of(len(before), _TOGETHER):
        rows = before[part, None]
        behind = np.minimum(rows + 1 + offsets, gaps[np.searchsorted(gaps, rows, side="right")])
        ahead = np.maximum(rows - offsets, gaps[np.searchsorted(gaps, rows, side="left") - 1] + 1)
        later, earlier = (np.median(time_s[k] - period_s * k, axis=1) for k in (behind, ahead))
        found[part] = np.round((later - earlier) / period_s)
    return found
