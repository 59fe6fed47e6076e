"""Rows that two recordings have in common: a gyro's noise never repeats, a copied row does.

A window of consecutive rows is hashed (temperature and rates as float32; times do not count). Of the hashes every
sixteenth is kept, chosen by its own value, so that two recordings keep the same ones and memory stays small
(winnowing: Schleimer, Wilkerson, Aiken, "Winnowing: local algorithms for document fingerprinting", SIGMOD 2003).

Quantised rates repeat by chance, so a window counts only where chance cannot have made it. A row tells as many bits as
its rate is unexpected after the rate before it, and after the sixteen before, by how often these occur in the recording
itself, the row not counted: (n(both) - 1/2) / n(before), 1/2 as of Krichevsky and Trofimov. A rate that is constant,
toggles or repeats a pattern tells nothing; rows that only repeat the one before are left out.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from .records import Run

__all__ = ["Fingerprints", "fingerprints_of", "sketch", "windows_in_common", "windows_that_repeat"]

Words = NDArray[np.uint64]

_SCALES = (7, 10)  # windows of 2^7 and, for coarse rates, 2^10 rows
_ONE_IN = 16  # power of 2; a sixteenth of the windows finds a shared stretch of a few hundred rows
_BITS = 80.0  # 2^50 alignments of two dozen runs of 100 h at 100 Hz, and a false alarm in 2^30 data sets
_TABLE = 2**20  # counters: 4 MiB
_SEARCHED, _OVERLAP = 2**18, 2**11  # rows that are looked at together, and those seen again with the next
_CONTEXT = 4  # doublings: patterns are known by sixteen rows
_PATTERN = 3  # windows that a recording holds this often are a pattern
_FIRST, _SECOND = (
    np.uint64(0x9E3779B97F4A7C15),
    np.uint64(0xBF58476D1CE4E5B9),
)  # SplitMix64, Steele et al. 2014
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
        return Fingerprints(
            self.hash[kept], self.first[kept], self.last[kept], self.first_s[kept], self.last_s[kept]
        )


def fingerprints_of(
    time_s: FloatArray, temperature_c: FloatArray, rates: Sequence[FloatArray]
) -> Fingerprints:
    """Fingerprints of a recording: times (s), temperatures, rates or pulses of every axis; arrays of shape (n,)."""
    found = []
    for start in range(0, max(len(time_s), 1), _SEARCHED):
        part = slice(start, start + _SEARCHED + _OVERLAP)
        rows = _Rows.of(temperature_c[part], [values[part] for values in rates])
        for scale in _SCALES:
            hashes, first, last = rows.windows(scale)
            own = first < _SEARCHED
            found.append((hashes[own], first[own] + start, last[own] + start))
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


@dataclass(frozen=True, slots=True)
class _Rows:
    """Hashes of the rows that differ from the one before, where they stand, and the bits told before each."""

    hash: Words
    at: NDArray[np.int64]
    told: FloatArray

    @staticmethod
    def of(temperature_c: FloatArray, rates: Sequence[FloatArray]) -> _Rows:
        rate = np.zeros(len(temperature_c), dtype=np.uint64)
        known = np.ones(len(temperature_c), dtype=bool)
        for values in rates:
            known &= np.isfinite(values)
            rate = _mixed(rate * _SECOND + _bits(values))
        row = _mixed(rate * _FIRST + _bits(temperature_c))
        at = np.flatnonzero(known & np.r_[True, row[1:] != row[:-1]])
        told = np.r_[0.0, np.cumsum(_surprise(rate[at]), dtype=np.float64)]
        return _Rows(row[at], at, told)

    def windows(self, scale: int) -> tuple[Words, NDArray[np.int64], NDArray[np.int64]]:
        """Kept hashes of the windows of 2^scale rows that chance cannot have made, with their first and last row."""
        words, length = self.hash, 1
        for _ in range(scale):
            words = _mixed(words[:-length] * _FIRST + words[length:])
            length *= 2
        kept = np.flatnonzero(words & np.uint64(_ONE_IN - 1) == 0)
        kept = kept[self.told[kept + length] - self.told[kept + 1] >= _BITS]
        return words[kept], self.at[kept], self.at[kept + length - 1]


def _bits(values: FloatArray) -> Words:
    """Values as float32, as whole numbers; 0 and -0 are one, and so is all that is beyond float32."""
    with np.errstate(over="ignore"):
        bits = (values.astype(np.float32) + np.float32(0.0)).view(np.uint32)
    return np.asarray(bits.astype(np.uint64))


def _mixed(words: Words) -> Words:
    """Words scattered over all 64 bits; `words` are lost."""
    words ^= words >> np.uint64(30)
    words *= _SECOND
    words ^= words >> np.uint64(27)
    words *= _FIRST
    words ^= words >> np.uint64(31)
    return words


def _surprise(rate: Words) -> NDArray[np.float32]:
    """How unexpected each row's rate is after the one before, and after the sixteen before, whichever is less; bits."""
    bits = np.zeros(len(rate), dtype=np.float32)
    before, length = rate, 1
    bits[1:] = _unexpected(before[:-1], rate[1:])
    for _ in range(_CONTEXT):
        before = _mixed(before[:-length] * _FIRST + before[length:])
        length *= 2
    late = bits[length:]
    if len(late):
        np.minimum(late, _unexpected(before[:-1], rate[length:]), out=late)
    return np.maximum(bits, 0.0, out=bits)


def _unexpected(before: Words, rate: Words) -> NDArray[np.float32]:
    """Bits that rates tell after what was before them, shape (n,), from how often that occurs here."""
    mask = np.uint64(_TABLE - 1)
    slot = (before & mask).view(np.int64)
    pair = (_mixed(before * _FIRST + rate) & mask).view(np.int64)
    alone, both = _occurrences(slot), _occurrences(pair)  # at least 1: each row counts itself
    return np.asarray(np.log2(alone) - np.log2(both - np.float32(0.5)), dtype=np.float32)


class _Scratch(threading.local):
    """Counters that are all 0 between uses: a new table for each use would cost more than what is counted in it."""

    def __init__(self) -> None:
        self.counters = np.zeros(_TABLE, dtype=np.uint32)


_scratch = _Scratch()


def _occurrences(slot: NDArray[np.int64]) -> NDArray[np.float32]:
    """How often each number occurs among all, same shape."""
    counters = _scratch.counters
    np.add.at(counters, slot, np.uint32(1))
    found = counters[slot].astype(np.float32)
    counters[slot] = 0
    return found


def windows_in_common(mine: Fingerprints, its: Fingerprints) -> NDArray[np.int64]:
    """First row of each window that two runs have, in the one and in the other, and its rows; (n, 3), in order."""
    a = np.flatnonzero(_new(mine.hash))
    b = np.minimum(np.searchsorted(its.hash, mine.hash[a]), len(its.hash) - 1)
    same = its.hash[b] == mine.hash[a] if len(its.hash) else np.zeros(len(a), dtype=bool)
    return _windows(mine, a[same], its.first[b[same]])


def windows_that_repeat(mine: Fingerprints) -> NDArray[np.int64]:
    """As `windows_in_common`, of a run with itself: a window that comes again, where it was first, its rows."""
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
    every = np.unique(np.concatenate([np.zeros(0, np.uint64), *(f.hash for f in fingerprints)]))
    return tuple(every[:_SKETCH].tolist())
