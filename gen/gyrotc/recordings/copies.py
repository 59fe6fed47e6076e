"""Rows or noise that two recordings have in common: a gyro's noise never repeats, a copy does, however it was written.

A window of consecutive rows is hashed (temperature and rates as float32; times do not count). Of the hashes every
sixteenth is kept (of long recordings fewer), chosen by its own value, so that two recordings keep the same ones and
memory stays small
(winnowing: Schleimer, Wilkerson, Aiken, "Winnowing: local algorithms for document fingerprinting", SIGMOD 2003).

Quantised rates repeat by chance, so a window counts only where chance cannot have made it. A row tells as many bits as
its rate is unexpected after the rate before it, and after the sixteen before, by how often these occur in the recording
itself, the row not counted: (n(both) - 1/2) / n(before), 1/2 as of Krichevsky and Trofimov. A rate that is constant,
toggles or repeats a pattern tells nothing; rows that only repeat the one before are left out.

A copy that was rounded, shifted, scaled, resampled or given a little noise has no row in common; it is found by the
correlation of what is left of the rates without their slow parts. Each run becomes means over one grid of time,
differenced and clipped, with a spectrum of equal magnitudes: offsets, scales, slow curves and lines of the mains or of
a chamber's fan then count for nothing, and a copy is a peak at the lag of its clock (generalized cross-correlation
with phase transform: Knapp and Carter, "The generalized correlation method for estimation of time delay", IEEE Trans.
ASSP 24, 1976).

Gyros of a fleet are too many for a spectrum of each pair: of each run the signs of the same whitened noise are kept.
"""

from __future__ import annotations

import base64
import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from .._core import windows_of
from ..common.arrays import FloatArray
from ..common.metrics import MAD_TO_SIGMA, median
from ..results.fleet import NoiseSigns
from .records import Run

Words = NDArray[np.uint64]

_LENGTHS = (128, 1024)  # of windows, rows; the longer ones for coarse rates
_ONE_IN = 16  # power of 2; a sixteenth of the windows finds a shared stretch of a few hundred rows
_MOST_KEPT = 2**16  # windows of a length, about: longer recordings keep one in 32, 64, ...
_BITS = 80.0  # 2^50 alignments of two dozen runs of 100 h at 100 Hz, and a false alarm in 2^30 data sets
_SEARCHED, _OVERLAP = 2**18, 2**11  # rows that are looked at together, and those seen again with the next
_PATTERN = 3  # windows that a recording holds this often are a pattern
_SKETCH = 128  # hashes: rows that two gyros share are seen from a twentieth on (docs/fleet.md)


@dataclass(frozen=True, slots=True)
class Fingerprints:
    """What is kept of a recording's rows: increasing hashes of windows, shape (n,), first and last row, their times."""

    hash: Words
    first: NDArray[np.int32]
    last: NDArray[np.int32]
    first_s: FloatArray
    last_s: FloatArray

    def within(self, run: Run) -> Fingerprints:
        """Those whose first and last row belong to a run."""
        kept = run.in_span(self.first_s) & run.in_span(self.last_s)
        return Fingerprints(self.hash[kept], self.first[kept], self.last[kept], self.first_s[kept], self.last_s[kept])


def fingerprints_of(time_s: FloatArray, temperature_c: FloatArray, rates: Sequence[FloatArray]) -> Fingerprints:
    """Fingerprints of a recording: times (s), temperatures, rates or pulses of every axis; arrays of shape (n,)."""
    one_in = _ONE_IN
    while len(time_s) > one_in * _MOST_KEPT:
        one_in *= 2
    found = []
    for start in range(0, max(len(time_s), 1), _SEARCHED):
        part = slice(start, start + _SEARCHED + _OVERLAP)
        columns = [np.ascontiguousarray(values[part], dtype=np.float64) for values in (temperature_c, *rates)]
        kept = windows_of(columns[0], columns[1:], _LENGTHS, one_in - 1, _BITS, _SEARCHED)
        found.append((kept[0], kept[1] + start, kept[2] + start))
    hashes, first, last = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.lexsort((first, hashes))
    hashes = hashes[order]
    often = np.diff(np.flatnonzero(np.r_[_new(hashes), True]))
    rare = np.repeat(often < _PATTERN, often)
    hashes, order = hashes[rare], order[rare]
    first, last = first[order], last[order]
    return Fingerprints(hashes, first.astype(np.int32), last.astype(np.int32), time_s[first], time_s[last])


def _new(ordered: Words) -> NDArray[np.bool_]:
    """Which of ordered words differ from the one before."""
    new = np.ones(len(ordered), dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=new[1:])
    return new


def windows_in_common(prints: Sequence[Fingerprints]) -> dict[tuple[int, int], NDArray[np.int64]]:
    """First row of each window that two runs have, in the one and in the other, and its rows, shape (n, 3), in order.

    Returns:
        By the numbers of the two runs, the later one first; of a run with itself: a window that comes again.
    """
    found = {(j, j): windows for j, one in enumerate(prints) if len(windows := _that_repeat(one))}
    at = [np.flatnonzero(_new(one.hash)) for one in prints]
    hashes = np.concatenate([np.zeros(0, np.uint64), *(one.hash[rows] for one, rows in zip(prints, at, strict=True))])
    run = np.repeat(np.arange(len(prints)), [len(rows) for rows in at])
    order = np.argsort(hashes, kind="stable")  # those that are alike by run
    hashes, run, place = hashes[order], run[order], np.concatenate([np.zeros(0, np.int64), *at])[order]
    pairs = []
    for lag in range(1, len(prints)):
        alike = np.flatnonzero(hashes[lag:] == hashes[:-lag])
        if len(alike) == 0:
            break
        pairs.append(np.column_stack([run[alike + lag], run[alike], place[alike + lag], place[alike]]))
    each = np.concatenate(pairs) if pairs else np.zeros((0, 4), dtype=np.int64)
    for j, i in np.unique(each[:, :2], axis=0).tolist():
        mine, its = each[(each[:, 0] == j) & (each[:, 1] == i), 2:].T
        found[j, i] = _windows(prints[j], mine, prints[i].first[its])
    return dict(sorted(found.items()))


def _that_repeat(mine: Fingerprints) -> NDArray[np.int64]:
    before = np.flatnonzero(~_new(mine.hash)) - 1
    return _windows(mine, before + 1, mine.first[before])


def _windows(mine: Fingerprints, at: NDArray[np.int64], other: NDArray[np.int32]) -> NDArray[np.int64]:
    first, last = mine.first[at].astype(np.int64), mine.last[at]
    found = np.column_stack([first, other, last - first + 1])
    return np.asarray(found[np.lexsort((found[:, 1], first))])


def sketch(fingerprints: Sequence[Fingerprints]) -> tuple[int, ...]:
    """The smallest hashes of all recordings of a gyro: two gyros that share rows share some of them.

    A twentieth of the rows in common shows with more than 99 % (Broder, "On the resemblance and containment of
    documents", 1997: 128 draws).
    """
    smallest = [one.hash[: _PATTERN * _SKETCH] for one in fingerprints]  # in order, each less than _PATTERN times
    every = np.unique(np.concatenate([np.zeros(0, np.uint64), *smallest]))
    return tuple(every[:_SKETCH].tolist())


_MOST_ROWS = 2**14  # that are kept of a recording, means of several rows of a longer one
_LEAST = 64  # values: of fewer no correlation stands out
_STEPS = 4  # grids of time in an octave: no run is averaged over much more than its own rows
_CLIP_SIGMAS = 4.0  # a spike, or a corner of the chamber's profile, is one value among the others
_COARSE = 0.5  # share of rows that repeat the one before: the noise is below the resolution of the rate
_SIGMAS = 8.0  # a peak by chance among 1e5 lags of 1e5 pairs: 1e10 values, one in 1e15 beyond 8 sigma
_LEAST_PEAK = 0.15  # 1: the same noise in all of both runs
_MOST_SIGNS = 2**11  # of a run
SLOWEST = 1.0 / 32.0
"""Of the grid's frequency: slower parts are the gyro's bias, which does come again."""
FASTEST_SIGNS = 0.25
"""Of the grid's frequency: signs of what is slower hardly depend on where in a row the grid begins."""
AXES_ALIKE = 0.9
"""Likeness of two axes that were recorded together: below it, what shakes both of them may do it."""


@dataclass(frozen=True)
class NoisePrint:
    """What a run is compared by: times, s, and rates of its rows or of means of several, shape (n,) each."""

    time_s: FloatArray
    rate: FloatArray

    @functools.cached_property
    def period_s(self) -> float:
        """Median step, s."""
        return median(np.diff(self.time_s))

    def within(self, inside: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> NoisePrint:
        """Of some of the rows."""
        return NoisePrint(self.time_s[inside], self.rate[inside])


@dataclass(frozen=True, slots=True)
class NoiseCopy:
    """Two runs with the same noise.

    Attributes:
        one: Number of the one.
        other: Number of the other.
        late_s: What has to be added to times of the one to get those of the other, s.
        likeness: Height of the peak, 1 for the same noise in all of both.
    """

    one: int
    other: int
    late_s: float
    likeness: float


def noise_of(time_s: FloatArray, rate: FloatArray) -> NoisePrint:
    """What a recording is compared by: times, s, and rates in any unit, NaN where there is none; shape (n,)."""
    known = np.isfinite(rate)
    if not known.all():
        time_s, rate = time_s[known], rate[known]
    each = -(-len(time_s) // _MOST_ROWS)
    if each > 1:
        n = len(time_s) // each * each
        time_s, rate = (values[:n].reshape(-1, each).mean(axis=1) for values in (time_s, rate))
    return NoisePrint(time_s, rate)


def noise_copies(prints: Sequence[NoisePrint]) -> Iterator[NoiseCopy]:
    """Every pair of runs with the same noise."""
    grids = [_grid_of(one) for one in prints]
    for grid in sorted({g for g in grids if g is not None}):
        there = [k for k, g in enumerate(grids) if g is not None and g <= grid]
        pairs = [(i, j) for i, j in itertools.combinations(there, 2) if grid in (grids[i], grids[j])]
        period = 2.0 ** (grid / _STEPS)
        series = {k: one for k in {*itertools.chain(*pairs)} if (one := _series(prints[k], period)) is not None}
        size = max((len(one) for one in series.values()), default=0)
        n = int(scipy.fft.next_fast_len(2 * size, real=True)) if size else 0
        spectra = {k: _phases(one, n) for k, one in series.items()}
        for i, j in pairs:
            if i in spectra and j in spectra:
                found = _peak(spectra[i], spectra[j], n, len(series[i]), len(series[j]))
                if found is not None:
                    shift = prints[j].time_s[0] - prints[i].time_s[0]
                    yield NoiseCopy(i, j, float(shift - found[0] * period), found[1])


def noise_signs(file: str, one: NoisePrint) -> Iterator[NoiseSigns]:
    """Signs of a run's whitened noise on the finest grid of whole octaves, and on the next for copies in other rows."""
    if _grid_of(one) is None:
        return
    span_s = one.time_s[-1] - one.time_s[0] + one.period_s
    finest = math.ceil(math.log2(max(one.period_s, span_s / _MOST_SIGNS)) - 1e-6)
    for octave in (finest, finest + 1):
        series = _series(one, 2.0**octave)
        if series is not None:
            n = int(scipy.fft.next_fast_len(len(series), real=True))
            spectrum = _phases(series, n)
            spectrum[int(FASTEST_SIGNS * n) + 1 :] = 0.0
            signs = np.packbits(scipy.fft.irfft(spectrum, n)[: len(series)] > 0.0)
            text = base64.b64encode(signs.tobytes()).decode("ascii")
            yield NoiseSigns(file=file, octave=octave, count=len(series), signs=text)


def _grid_of(one: NoisePrint) -> int | None:
    """Number of the finest grid of time that a run is averaged over; None where it has no noise to compare."""
    if len(one.time_s) < _LEAST or float(np.mean(np.diff(one.rate) == 0.0)) > _COARSE:
        return None
    return math.ceil(_STEPS * math.log2(one.period_s) - 1e-6)


def _series(one: NoisePrint, period_s: float) -> FloatArray | None:
    """Differences of means over cells of a grid, clipped; None where too few are left."""
    edges = np.r_[one.time_s, one.time_s[-1] + one.period_s]
    total = np.r_[0.0, np.cumsum((one.rate - np.mean(one.rate)) * np.diff(edges))]
    cells = int((edges[-1] - edges[0]) / period_s * (1.0 + 1e-9))
    if not _LEAST < cells <= 2 * _MOST_ROWS:  # a gap of months is no grid
        return None
    at = edges[0] + period_s * np.arange(cells + 1)
    change = np.diff(np.interp(at, edges, total), 2) / period_s
    sigma = MAD_TO_SIGMA * median(np.abs(change))
    return np.clip(change, -_CLIP_SIGMAS * sigma, _CLIP_SIGMAS * sigma) if sigma > 0.0 else None


def _phases(series: FloatArray, n: int) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    spectrum = scipy.fft.rfft(series, n)
    size = np.abs(spectrum)
    size[: int(SLOWEST * n) + 1] = np.inf
    size[size == 0.0] = np.inf
    return np.asarray(spectrum / size)


def _peak(
    one: np.ndarray[tuple[int], np.dtype[np.complex128]],
    other: np.ndarray[tuple[int], np.dtype[np.complex128]],
    n: int,
    n_one: int,
    n_other: int,
) -> tuple[int, float] | None:
    """Lag (by how many cells the other's values come earlier, each from its own start) and height of a copy's peak."""
    like = scipy.fft.irfft(one * np.conj(other), n)
    np.abs(like, out=like)
    like /= 1.0 - 2.0 * SLOWEST
    like[n_one : n - n_other + 1] = 0.0  # lags at which nothing of the two overlaps
    best = int(np.argmax(like))
    height = float(like[best])
    if height < _LEAST_PEAK:
        return None
    there = np.concatenate([like[:n_one], like[n - n_other + 1 :]])
    if height < _SIGMAS * MAD_TO_SIGMA * median(there):
        return None
    return (best if best < n_one else best - n), height
