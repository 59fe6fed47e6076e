"""Find the parts of a run whose rows are noisier or quieter than the others: the best partition of their log-noise."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..common.arrays import FloatArray, parts_of
from ..common.statistics import noise_of
from .odds import NOISE_FACTOR, cost_of

# Second differences to one mean magnitude, at least: it is then known to a fifth.
_GROUP = 20
# Groups of a run at most: bounds the time of the search.
_MAX_GROUPS = 1000
_MIN_GROUPS = 20
# Differences beyond this many medians of their group, four standard deviations, count as these: outliers are no noise.
_CLIP = 6.0
# Quantile of the groups that is the noise of the run: a disturbance of less than three quarters of it is the exception.
_USUAL = 0.25
# Steps of the column: where second differences are smaller they show its resolution and no noise.
_STEPS = 2.0
# Standard errors beyond the least factor that is reported.
_SIGMAS = 3.0


class NoisePart(NamedTuple):
    """Rows with another noise: first row, row after the last, factor, its uncertainty, log-odds."""

    first: int
    end: int
    factor: float
    sigma: float
    log_odds: float


def noise_parts(rate: FloatArray, step: float) -> list[NoisePart]:
    """Return the parts of a rate whose noise is not that of the run.

    Args:
        rate: Finite values in order of time, without what is smooth in them.
        step: Resolution of the column, in the unit of the rate.
    """
    groups, size = _groups(rate)
    count = len(groups)
    if count < _MIN_GROUPS or np.median(groups) < _STEPS * step:
        return []
    noise = np.log(np.maximum(groups, 0.01 * np.median(groups)))
    sigma = noise_of(np.diff(noise)) / np.sqrt(2.0) + 1e-3
    cost = cost_of(2.0 * count)
    bounds = _partition(noise / sigma, 2.0 * cost)
    usual, found = float(np.quantile(noise, _USUAL)), list[NoisePart]()
    for a, b in pairwise(bounds):
        change, error = float(noise[a:b].mean()) - usual, float(sigma / np.sqrt(b - a))
        if abs(change) <= np.log(NOISE_FACTOR) + _SIGMAS * error:
            continue
        factor = float(np.exp(change))
        end = len(rate) if b == count else b * size + 1
        part = NoisePart(a * size, end, factor, factor * error, 0.5 * (change / error) ** 2 - cost)
        if found and found[-1].end >= part.first and (found[-1].factor > 1.0) == (factor > 1.0):
            last = found.pop()
            longer = max(last, part, key=lambda one: one.end - one.first)
            part = longer._replace(first=last.first, end=end, log_odds=last.log_odds + part.log_odds)
        found.append(part)
    return found


def _groups(rate: FloatArray) -> tuple[FloatArray, int]:
    """Return mean magnitudes of the second differences of groups of rows, and the rows of a group."""
    n = len(rate) - 2
    size = max(_GROUP, n // _MAX_GROUPS)
    count = n // size
    if count < _MIN_GROUPS:
        return np.zeros(0), size
    together = max(2**18 // size, 1) * size

    def bends(part: slice) -> FloatArray:
        return np.abs(np.diff(rate[part.start : part.stop + 2], 2)).reshape(-1, size)

    return np.concatenate([_magnitudes(bends(part)) for part in parts_of(count * size, together)]), size


def _magnitudes(groups: FloatArray) -> FloatArray:
    """Return the mean magnitude of each group, shape (n, size), without what its outliers add."""
    limit = _CLIP * np.median(groups, axis=1, keepdims=True)
    return np.asarray(np.minimum(groups, np.where(limit > 0.0, limit, np.inf)).mean(axis=1))


def _partition(values: FloatArray, penalty: float) -> list[int]:
    """Return the bounds of the partition into constant parts with the least squares and a penalty for each.

    Jackson et al., IEEE Signal Process. Lett. 12 (2005) 105.
    """
    n = len(values)
    total, squares = np.r_[0.0, np.cumsum(values)], np.r_[0.0, np.cumsum(values**2)]
    best, last = np.full(n + 1, -penalty), np.zeros(n + 1, dtype=int)
    ends = np.arange(n + 1.0)
    for end in range(1, n + 1):
        reached = best[:end] - squares[:end] - (total[end] - total[:end]) ** 2 / (end - ends[:end])
        at = int(np.argmin(reached))
        best[end], last[end] = squares[end] + reached[at] + penalty, at
    bounds = [n]
    while bounds[-1] > 0:
        bounds.append(int(last[bounds[-1]]))
    return bounds[::-1]
