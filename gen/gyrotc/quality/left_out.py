"""What the screen of the front end left out of training, for `training.json`: files, times, rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..recordings.records import Run
from ..results.training import LeftOutRows, Outliers

__all__ = ["exclude_text", "outliers_of", "stretches_left_out"]

_JOINED = 10  # rows between two that make them one stretch
_LISTED = 200  # stretches; beyond, they are counted only


def stretches_left_out(run: Run, times_s: NDArray[np.float64]) -> list[LeftOutRows]:
    """Stretches of rows that were left out, times on the clock of the run, the end exclusive.

    Args:
        times_s: Times of these rows, increasing.
    """
    if len(times_s) == 0:
        return []
    first = np.flatnonzero(np.diff(times_s, prepend=-np.inf) > _JOINED * run.row_period_s)
    last = np.r_[first[1:], len(times_s)] - 1
    return [
        LeftOutRows(
            file=run.file,
            from_s=float(times_s[a]),
            to_s=round(float(times_s[b] + 0.5 * run.row_period_s), 6),
            rows=int(b - a + 1),
        )
        for a, b in zip(first, last, strict=True)
    ]


def outliers_of(stretches: Sequence[LeftOutRows], kept: float) -> Outliers:
    """`outliers` of `training.json`: number of rows left out, their share of all, where (the first 200 stretches).

    Args:
        kept: Number of rows that training took.
    """
    rows = sum(stretch.rows for stretch in stretches)
    return Outliers(rows=rows, share=rows / (rows + kept), stretches=tuple(stretches[:_LISTED]))


def exclude_text(stretches: Sequence[LeftOutRows]) -> str:
    """The line of a run's entry in dataset.toml that leaves stretches of its file out of every figure."""
    each = (f'{{from_s = {s.from_s!r}, to_s = {s.to_s!r}, reason = "outlier"}}' for s in stretches)
    return f"exclude = [{', '.join(each)}]"
