"""Passages of runs over the same temperatures: what the static map does there, whatever the level of each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray

__all__ = ["Rows", "curve_elsewhere"]

Rows = tuple[FloatArray, FloatArray, FloatArray]
"""Time in s, temperature in C, rate in deg/h of a run, shape (n,) each."""

_BINS = 48  # over the temperatures of a window, which has 24 to 40 cells: a quick passage is as sharp as in its cells
_WHOLE = 0.75  # of these temperatures, what a passage has to cover for its level to be that of the others
_LEAST_C = 0.3  # what a chamber's ripple moves is no passage


def curve_elsewhere(
    runs: Sequence[Rows], run: int, window_s: tuple[float, float], temperature: FloatArray
) -> FloatArray | None:
    """Mean rate over temperature of all passages but a run's own window, less each one's mean, shape (n,).

    Args:
        runs: All runs; `run` is the number of the window's.
        window_s: From and to, on that run's clock.
        temperature: Where the curve is wanted, C, shape (n,): the temperatures of the window.

    Returns:
        None where the temperature stands still or nothing else passes there.
    """
    edges = np.linspace(float(temperature.min()), float(temperature.max()), _BINS + 1)
    if edges[-1] - edges[0] < _LEAST_C:
        return None
    curves = []
    for k, (time, x, y) in enumerate(runs):
        counts = (x >= edges[0]) & (x <= edges[-1])
        if k == run:
            counts &= (time < window_s[0]) | (time > window_s[1])
        curves += list(_curves(x, y, counts, edges))
    if not curves:
        return None
    return np.interp(temperature, 0.5 * (edges[1:] + edges[:-1]), np.mean(curves, axis=0))


def _curves(
    x: FloatArray, y: FloatArray, counts: NDArray[np.bool_], edges: FloatArray
) -> Iterator[FloatArray]:
    """Of every stretch of rows that count and cover most of the bins: mean rate of each, less the mean of all."""
    at = np.flatnonzero(counts)
    middle = 0.5 * (edges[1:] + edges[:-1])
    for part in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1):
        if len(part) < 2 or np.ptp(x[part]) < _WHOLE * (edges[-1] - edges[0]):
            continue
        number = np.minimum(np.searchsorted(edges, x[part], side="right") - 1, _BINS - 1)
        count = np.bincount(number, minlength=_BINS)
        mean = np.bincount(number, y[part], minlength=_BINS)[count > 0] / count[count > 0]
        curve = np.interp(middle, middle[count > 0], mean)
        yield curve - curve.mean()
