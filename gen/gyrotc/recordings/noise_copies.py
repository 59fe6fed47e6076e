"""Runs that hold the same noise: a gyro's noise never repeats, so what repeats it is a copy, however it was written.

`shared_rows` finds rows that are the same. A copy that was rounded, shifted, scaled, resampled or given a little noise
has none; it is found by the correlation of what is left of the rates without their slow parts. Each run becomes means
over one grid of time, differenced and clipped, with a spectrum of equal magnitudes: offsets, scales, slow curves and
lines of the mains or of a chamber's fan then count for nothing, and a copy is a peak at the lag of its clock
(generalized cross-correlation with phase transform: Knapp and Carter, "The generalized correlation method for
estimation of time delay", IEEE Trans. ASSP 24, 1976).

Gyros of a fleet are too many for a spectrum of each pair: of each run the signs of the same whitened noise are kept.
"""

from __future__ import annotations

import base64
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.fft

from ..common.arrays import FloatArray
from ..common.metrics import MAD_TO_SIGMA, median
from ..results.fleet import NoiseSigns

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


@dataclass(frozen=True, slots=True)
class NoisePrint:
    """What a run is compared by: times, s, and rates of its rows or of means of several, shape (n,) each."""

    time_s: FloatArray
    rate: FloatArray

    @property
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
