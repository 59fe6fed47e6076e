"""Find the values of a column that leave the level around them and come back, from single rows to minutes.

The level is a running median of 17 blocks, at octaves of the time scale: single rows, blocks of 8 rows, of 64 rows, and
so on. Up to eight outlying blocks are its minority and are found whole. At the ends the level is a repeated-median
line, so that bad rows at an end are found like those in the middle. On each scale the rows are a two-state path:
outliers (Cauchy) or noise (Student's t), of which the likeliest segments are taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from ..common.arrays import FloatArray, IntArray
from ..common.metrics import MAD_TO_SIGMA
from .odds import FALSE_ALARMS, OCTAVE, WINDOW, cost_of, freedom_of, largest_of_groups, outlier_odds

# Values to one estimate of the noise: its median is known to a tenth.
_GROUP = 200
# Values that are looked at together; bounds memory.
_PART = 2**18
# Single bad rows that are expected in a recording: every logger garbles one now and then. They are told from normal
# noise so well that the false ones stay below one in a hundred recordings.
_EXPECTED_SINGLES = 0.3
# Values beyond this many standard deviations count as these for the correlation of neighbours.
_CLIP = 3.0
# Share of its deviation within which the level behind a stretch has to be that before it.
_BACK = 0.5
# Log-odds of the last block of a stretch, at least: a block of the noise that happens to lie far does not lengthen it.
_LIKELY = 1.0
# Larger log-odds of a block count as this: sums keep their digits.
_MAX_SCORE = 1e4
# Outliers bend the column by more than this share of their deviation within a block. A corner of a programme bends it
# by less than half; the edge of a disturbance within a block of several rows is shared by two bends.
_BEND_OF_ROWS, _BEND_OF_BLOCKS = 0.6, 0.45


class Outliers(NamedTuple):
    """A stretch of outliers: first row, row after the last, largest deviation, noise of a row, log-odds."""

    first: int
    end: int
    size: float
    sigma: float
    log_odds: float


def outlying(values: FloatArray, longest: int) -> list[Outliers]:
    """Find stretches of outliers on every scale up to blocks of `longest` rows, in order of their rows.

    Args:
        values: A column of finite values in order of time.
        longest: Rows of the longest block; a disturbance of eight such blocks is found whole.
    """
    if len(values) < 4 * OCTAVE:
        return []
    clean, found = values, list[Outliers]()
    scales = [OCTAVE**k for k in range(32) if OCTAVE**k < longest] + [max(longest, 1)]
    cost = cost_of(2.0 * len(scales) * len(values))
    row_sigma = 0.0
    for n in scales:
        if len(values) // n < 4 * OCTAVE:
            break
        count = len(values) // n
        edges = np.arange(count + 1 if n > 1 else 0) * len(values) // count
        blocks = clean if n == 1 else np.add.reduceat(clean, edges[:-1]) / np.diff(edges)
        scale = _Scale(blocks)
        row_sigma = row_sigma or scale.usual_sigma
        for first, end, odds in scale.segments(cost):
            level = scale.level(max(first - 1, 0), min(end + 1, len(blocks)))
            off = blocks[first:end] - scale.level(first, end)
            if first == 0 and _fades(off):
                continue  # a warm-up that lasts few blocks
            far = float(np.max(np.abs(off)))
            around = blocks[max(first - 2, 0) : end + 2]
            bend = float(np.abs(np.diff(around, 2)).max())
            if bend < (_BEND_OF_ROWS if n == 1 else _BEND_OF_BLOCKS) * far:
                continue  # a warm-up or a peak of the map bends little from block to block
            before = float(level[0]) if first > 0 else float(level[-1])
            after = float(level[-1]) if end < len(blocks) else before
            if abs(after - before) > _BACK * far:
                continue  # it does not come back: a step, which the level follows late where the column slopes
            rows = (first, end) if n == 1 else (int(edges[first]), int(edges[end]))
            if n > 1:
                size = float(np.mean(blocks[first:end])) - 0.5 * (before + after)
                rows = _refined(clean, edges, (first, end), (0.5 * (before + after), size), row_sigma)
            line = np.linspace(before, after, rows[1] - rows[0])
            beyond = values[rows[0] : rows[1]] - line
            found.append(Outliers(*rows, float(beyond[np.argmax(np.abs(beyond))]), row_sigma, odds))
            if clean is values:
                clean = values.copy()
            clean[rows[0] : rows[1]] = line
    return _joined(found)


class _Scale:
    """Blocks of one scale, how far each lies outside the level around it, and the noise that it is judged by."""

    def __init__(self, blocks: FloatArray) -> None:
        self._blocks = blocks
        self._start, self._end = _line(blocks[: 2 * WINDOW]), _line(blocks[-2 * WINDOW :])
        self._group = len(blocks) // max(len(blocks) // _GROUP, 1)
        beyond, rest, bends = list[NDArray[np.float32]](), list[FloatArray](), list[FloatArray]()
        for first, end in self._parts():
            of_part = self._beyond(first, end)
            beyond.append(of_part[0])
            rest.append(self._medians(of_part[1]))
            around = blocks[max(first - 1, 0) : end + 1]
            around = np.pad(around, (int(first == 0), int(end == len(blocks))), "reflect")
            bends.append(self._medians(np.diff(around, 2) / np.sqrt(6.0)))
        # Noise of each group: about the level, or by second differences, whichever is larger, since the level follows
        # noise that a filter made slow
        sigma = np.maximum(_smoothed(np.concatenate(rest)), _smoothed(np.concatenate(bends)))
        self.usual_sigma = float(np.median(sigma))
        self._z = np.concatenate(beyond)
        for first, end in self._parts():
            group = np.minimum(np.arange(first, end) // self._group, len(sigma) - 1)
            self._z[first:end] /= sigma[group]
        self._freedom = freedom_of(largest_of_groups(self._z))

    def _parts(self) -> Iterator[tuple[int, int]]:
        size = max(_PART // self._group, 1) * self._group
        return ((at, min(at + size, len(self._blocks))) for at in range(0, len(self._blocks), size))

    def level(self, first: int, end: int) -> FloatArray:
        """Return the level at some blocks."""
        low, high = max(first - WINDOW, 0), min(end + WINDOW, len(self._blocks))
        level = np.asarray(median_filter(self._blocks[low:high], WINDOW, mode="nearest"))
        if low == 0:
            level[:OCTAVE] = self._start[:OCTAVE]
        if high == len(self._blocks):
            level[-OCTAVE:] = self._end[-OCTAVE:]
        return np.asarray(level[first - low : end - low])

    def _medians(self, values: FloatArray) -> FloatArray:
        size = np.abs(values)
        whole = size[: len(size) // self._group * self._group].reshape(-1, self._group)
        if not len(whole):
            return np.zeros(0)
        median = np.median(whole, axis=1)
        # A coarse column repeats: its differences are what it shows of its step
        return np.where(median > 0.0, median, whole.mean(axis=1) / MAD_TO_SIGMA)

    def _beyond(self, first: int, end: int) -> tuple[NDArray[np.float32], FloatArray]:
        """Return how far blocks lie outside the level of their neighbours, and how far from their own."""
        low, high = max(first - 1, 0), min(end + 1, len(self._blocks))
        level = np.pad(self.level(low, high), (int(low == first), int(high == end)), "edge")
        floor = np.minimum(np.minimum(level[:-2], level[1:-1]), level[2:])
        ceiling = np.maximum(np.maximum(level[:-2], level[1:-1]), level[2:])
        blocks = self._blocks[first:end]
        return (blocks - np.clip(blocks, floor, ceiling)).astype(np.float32), blocks - level[1:-1]

    def segments(self, cost: float) -> list[tuple[int, int, float]]:
        """Return the segments of outliers (first, end, log-odds)."""
        share, of_one = 1.0, cost - np.log(_EXPECTED_SINGLES / FALSE_ALARMS)
        if len(self._z) > 2:
            small = np.clip(self._z, -_CLIP, _CLIP)
            power = float(small @ small)
            alike = min(max(float(small[1:] @ small[:-1]) / power, 0.0), 0.9) if power > 0.0 else 0.0
            share = (1.0 - alike) / (1.0 + alike)
        regions, carried = list[tuple[int, int, float]](), 0.0
        for start in range(0, len(self._z), _PART):
            total = carried + np.cumsum(self._scores(start, start + _PART, share))
            height = total - np.minimum(np.minimum.accumulate(total), 0.0)
            carried, inside = float(height[-1]), height > 0.0
            first = np.flatnonzero(inside & ~np.r_[False, inside[:-1]])
            end = np.flatnonzero(inside & ~np.r_[inside[1:], False]) + 1
            peak = np.maximum.reduceat(height, first) if len(first) else height[:0]
            for k in np.flatnonzero((peak > of_one) | (first == 0) | (end == len(height))).tolist():
                one = int(first[k]) + start, int(end[k]) + start, float(peak[k])
                if regions and regions[-1][1] == one[0]:  # it goes on from the part before
                    one = regions[-1][0], one[1], max(regions.pop()[2], one[2])
                regions.append(one)
        found = [(first, end) for first, end, peak in regions if peak > of_one]
        return [one for first, end in found for one in _cut(self._scores(first, end, share), first, cost, of_one)]

    def _scores(self, first: int, end: int, share: float) -> FloatArray:
        score = np.minimum(outlier_odds(self._z[first:end].astype(np.float64), self._freedom), _MAX_SCORE)
        # Neighbours in filtered or slow noise are alike: all rows of a stretch but the first count for less
        likely = np.flatnonzero(score > 0.0)
        again = likely[np.diff(likely, prepend=-2 * OCTAVE) <= OCTAVE]
        score[again] *= share
        return score


def _cut(score: FloatArray, first: int, cost: float, of_one: float) -> Iterator[tuple[int, int, float]]:
    """Yield the segments of a region: each ends at its largest sum, before a fall of more than `cost`.

    Args:
        cost: Prior log-odds, negated, of a segment.
        of_one: The same of a segment of one block.
    """
    begin, height, best, at = -1, 0.0, 0.0, -1
    for k, value in enumerate(score.tolist()):
        if begin < 0 and value > _LIKELY:
            begin, height, best = k, 0.0, 0.0
        if begin >= 0:
            height += value
            if height > best and value > _LIKELY:
                best, at = height, k
            if height < best - cost or height <= 0.0 or k == len(score) - 1:
                best -= of_one if at == begin else cost
                if best > 0.0:
                    yield first + begin, first + at + 1, best
                begin = -1


def _fades(off: FloatArray) -> bool:
    """Test whether three deviations or more become smaller one after the other, all to one side."""
    size = np.abs(off)
    return len(off) >= 3 and bool((off > 0.0).all() or (off < 0.0).all()) and bool((np.diff(size) < 0.0).all())


def _line(values: FloatArray) -> FloatArray:
    """Return the repeated-median line of a few values; fewer than half of them may be wrong (Siegel, 1982)."""
    n = len(values)
    x = np.arange(n, dtype=np.float64)
    others = ~np.eye(n, dtype=bool)
    rise, run = ((of[:, None] - of[None, :])[others].reshape(n, n - 1) for of in (values, x))
    slope = float(np.median(np.median(rise / run, axis=1)))
    return np.asarray(np.median(values - slope * x) + slope * x)


def _smoothed(groups: FloatArray) -> FloatArray:
    """Return standard deviations from the medians of groups, at least half of the usual one."""
    usual = float(np.median(groups))
    if usual == 0.0:
        usual = float(np.mean(groups)) or 1.0
    around = np.asarray(median_filter(groups, min(5, len(groups)), mode="mirror"))
    return np.asarray(MAD_TO_SIGMA * np.maximum(around, 0.5 * usual))


def _refined(
    rows: FloatArray, edges: IntArray, blocks: tuple[int, int], line: tuple[float, float], sigma: float
) -> tuple[int, int]:
    """Return the rows of a stretch that was found in blocks: those beyond half of its size.

    Args:
        line: Level beside the stretch and mean deviation of its blocks.
        sigma: Noise of a row.
    """
    level, size = line
    first, end = int(edges[max(blocks[0] - 1, 0)]), int(edges[min(blocks[1] + 1, len(edges) - 1)])
    far = np.flatnonzero(np.abs(rows[first:end] - level) > max(0.5 * abs(size), 3.0 * sigma))
    if abs(size) > 6.0 * sigma and len(far):
        return first + int(far[0]), first + int(far[-1]) + 1
    return int(edges[blocks[0]]), int(edges[blocks[1]])


def _joined(found: list[Outliers]) -> list[Outliers]:
    """Join stretches with less than an octave of rows between them: a disturbance is in the rows between, too."""
    kept: list[Outliers] = []
    for one in sorted(found):
        if kept and one.first <= kept[-1].end + OCTAVE:
            last = kept.pop()
            larger = max(last, one, key=lambda other: abs(other.size))
            odds = last.log_odds + one.log_odds
            kept.append(Outliers(last.first, max(last.end, one.end), larger.size, larger.sigma, odds))
        else:
            kept.append(one)
    return kept
